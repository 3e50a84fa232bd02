// SPDX-License-Identifier: GPL-3.0-or-later
// The uniform buffers, filled by render/uniforms.py: std140, 16-byte members only, so that the
// layout is the order of the members. All positions are in render space (core/plan.py).

#define MAX_WAVES 32
#define MAX_SHADOWS 3
#define MAX_TECHNIQUE_VALUES 24

struct Lights {
  vec4 sun_direction;    // xyz: unit, towards the sun
  vec4 sun_irradiance;   // rgb
  vec4 sky;              // rgb: radiance, w: 1 when there is an image
  vec4 sky_image;        // x: strength, y: rotation
  vec4 irradiance_sh[9]; // rgb
  mat4 shadow_view;                     // render space to the cameras along the sun
  mat4 shadow_projections[MAX_SHADOWS]; // orthographic, the smallest window first
  vec4 shadow;                          // x: number of windows, stacked in one texture; y: texels a side of each
  vec4 shadow_texels;                   // size in m of a texel of each
};

struct View {
  mat4 view;
  mat4 projection;
  mat4 clip_to_direction; // perspective: device coordinates to the direction of sight in render space, not unit
  vec4 eye;               // xyz: position; orthographic: unit direction towards the viewer; w: 1 when orthographic
  vec4 clip;              // x: +1 keeps what is below, -1 what is above, 0 all; y: height of the plane; z: bias of images' level of detail
};

struct Water {
  vec4 plane;   // xyz: origin of the water frame; w: number of waves
  vec4 optics;  // k, q, c, n12
  vec4 fresnel; // f; y: the waves' greatest height; z: fade at the textures' border, w: their size
  vec4 color;   // rgb; w: mean slope of the waves that a ray meets which skims them
  vec4 grid;      // of the grid, or the box around the mesh: half extents x, y; centre x, y; in the water frame
  vec4 grid_axis; // cos, sin of the heading
  vec4 rays;      // steps along a refracted ray, a reflected one (from below any); heights of the lowest thing in the water, the highest over it
  mat4 refraction_view;
  mat4 refraction_projection;
  mat4 reflection_view;
  mat4 reflection_projection;
  vec4 waves[MAX_WAVES]; // kx, ky, amplitude, phase
};

// Sunlight in one body of water: the camera along it, and what is looked up in its textures.
struct WaterLight {
  mat4 view;       // render space to the light camera
  mat4 projection; // orthographic
  vec4 direction;  // xyz: unit, of the light below the flat surface, downwards; w: s.z / |r.z|
  vec4 caustics;   // photons a side, texels a side, intersection steps
  vec4 depth;      // texels a side, size of a texel in m, 1 - F of the flat surface, 1 when there is sunlight
  vec4 sun;        // rgb: absorption of sunlight beyond k, 1/m; w: part that enters beside 1 - F
  vec4 sky;        // rgb: absorption of the sky's light, 1/m of depth; w: part that enters
};

// Settings that only one technique has: one value each, in the order of their class (core/technique_settings.py).
struct Technique {
  vec4 values[MAX_TECHNIQUE_VALUES];
};

// The rectangle on which a picture begins (core/under_water.py).
struct NearPlane {
  vec4 origin; // xyz: the eye, or where an orthographic camera is
  vec4 center; // xyz: from there to the rectangle's middle; w: distance of the near plane, m
  vec4 right;  // xyz: from its middle to its right edge; w: near / far; orthographic: far - near
  vec4 up;     // xyz: from its middle to its upper edge; w: 1 when orthographic
  vec4 map;    // of the surface's heights: x, y of the lower left corner; texels per m along x, y
};
