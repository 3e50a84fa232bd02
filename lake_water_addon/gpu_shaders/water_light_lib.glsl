// SPDX-License-Identifier: GPL-3.0-or-later
// Sunlight below a water surface. Twin: core/water_light.py, which explains it.
// Includes and defines as for shadow_lib.glsl; CAUSTICS: there is a caustics texture.

#include "optics_lib.glsl"
#include "shadow_lib.glsl"

// Width, as a part of the window, over which the caustics give way to the light through a calm surface.
#define WINDOW_FADE 0.03

// Length of the way of sunlight through the water under a calm surface, in m.
float calm_light_path(vec3 position)
{
  return max(water.plane.z - position.z, 0.0) / max(-water_light.direction.z, 1e-6);
}

#ifdef SHADOWS
// Part of the light in the water that reaches a point, 0 to 1: what lies under water casts these shadows.
float water_light_visibility(vec3 position, vec3 normal)
{
  vec3 moved = position + normal_offset(normal, -water_light.direction.xyz, water_light.depth.y) * normal;
  vec3 at = transform_point(water_light.view, moved);
  vec2 texel;
  if (!in_window(water_light.projection, water_light.depth.x, at, texel)) {
    return 1.0;
  }
  return lit_part(light_depth, texel, -at.z);
}
#endif

// The sun's light through the water at a point, relative to that on the surface: caustics, or what a
// calm surface lets through where there are none.
float light_through_water(vec3 position)
{
  float path = calm_light_path(position);
  float calm = water_light.depth.z * attenuation(water.optics.x, path);
  float known = 0.0;
#ifdef CAUSTICS
  vec2 uv = to_texture(water_light.projection, transform_point(water_light.view, position));
  vec2 edge = min(uv, 1.0 - uv);
  known = smoothstep(0.0, WINDOW_FADE, min(edge.x, edge.y));
  float caustic = texture(caustics, uv).r;
#endif
#ifdef SHADOWS
  // Photons know the shadows of what stands in the air.
  if (known < 1.0) {
    calm *= sun_visibility(position - path * water_light.direction.xyz, vec3(0.0, 0.0, 1.0));
  }
#endif
#ifdef CAUSTICS
  return mix(calm, caustic, known);
#else
  return calm;
#endif
}

// Irradiance of the sun on a surface in the water.
vec3 sun_in_water(vec3 position, vec3 normal)
{
  float cosine = max(-dot(normal, water_light.direction.xyz), 0.0);
  float relative = water_light.depth.w * water_light.direction.w * cosine;
  if (relative <= 0.0) {
    return vec3(0.0);
  }
  relative *= light_through_water(position);
#ifdef SHADOWS
  relative *= water_light_visibility(position, normal);
#endif
  return lights.sun_irradiance.rgb * relative;
}
