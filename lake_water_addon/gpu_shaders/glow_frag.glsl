// SPDX-License-Identifier: GPL-3.0-or-later
// The sun's mirror image in the water, in the texels of the glow. None where the picture shows something
// nearer, and with SHADOWS none where the sun does not reach.

#include "camera_lib.glsl"
#include "waves_lib.glsl"
#include "surface_lib.glsl"
#include "optics_lib.glsl"
#include "glow_lib.glsl"
#ifdef SHADOWS
#  include "shadow_lib.glsl"
#endif

// Depths of the same triangles under two projections differ by rounding.
#define DEPTH_ROUNDING 1e-6

// The depth of the picture is that of the nearest pixel's middle. A slope of depth as steep as twice that of
// the triangle is taken for the water itself.
bool hidden_in_picture(float depth)
{
  vec2 size = vec2(textureSize(picture_depth, 0));
  vec3 in_camera = transform_point(picture_view.view, v_position);
  vec2 at = to_texture(picture_view.projection, in_camera) * size;
  vec2 texels_a_pixel = 1.0 / max(fwidth(at), 1e-6);
  vec2 slope = vec2(abs(dFdx(depth)), abs(dFdy(depth)));
  // Clamped before the conversion: beyond the picture's border the depth goes on as it is there.
  vec2 pixel = clamp(floor(at), vec2(0.0), size - 1.0);
  vec2 apart = abs(at - pixel - 0.5) * texels_a_pixel;
  float tolerance = 2.0 * dot(slope, apart) + DEPTH_ROUNDING;
  return texelFetch(picture_depth, ivec2(pixel), 0).r < depth - tolerance;
}

void main()
{
  vec3 to_eye = pass_view.eye.w > 0.5 ? pass_view.eye.xyz : normalize(pass_view.eye.xyz - v_position);
  float most = most_towards_eye(pass_view.eye, v_position);
  SurfacePoint surface = surface_in_sight(v_position, v_wave, v_slope, to_eye, most, 1.0);
  vec3 normal = face_viewer(normalize(vec3(-surface.slope, 1.0)), to_eye);
  float mirrored = highlight(reflect_direction(-to_eye, normal), lights.sun_direction.xyz, lobe.x, lobe.y);
  // Derivatives before any branch. The triangle seen from below mirrors what is under water.
  vec3 face = cross(dFdx(v_position), dFdy(v_position));
  bool from_below = dot(face, to_eye) * face.z < 0.0;
  bool hidden = hidden_in_picture(gl_FragCoord.z);
  if (hidden || from_below) {
    mirrored = 0.0;
  }
#ifdef SHADOWS
  if (mirrored > 0.0) {
    mirrored *= sun_visibility(surface.position, normal);
  }
#endif
  out_highlight = mirrored;
}
