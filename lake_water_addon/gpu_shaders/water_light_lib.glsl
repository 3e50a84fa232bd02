// SPDX-License-Identifier: GPL-3.0-or-later
// Sunlight below a water surface. Twin: core/water_light.py, which explains it.
// Includes and defines as for shadow_lib.glsl; CAUSTICS: there is a caustics texture.

#include "optics_lib.glsl"
#include "shadow_lib.glsl"

// Width, in texels of the light depth, over which the caustics give way to the light through a calm surface.
#define WINDOW_FADE 4.0

// Length of the way of sunlight through the water under a calm surface, in m.
float calm_light_path(vec3 position)
{
  return max(water.plane.z - position.z, 0.0) / max(-water_light.direction.z, 1e-6);
}

#ifdef SHADOWS
// Part of the light in the water that reaches a point of a face with this normal, 0 to 1: what lies under
// water casts these shadows.
float water_light_visibility(vec3 position, vec3 normal)
{
  vec3 out_of = transform_direction(water_light.view, normal);
  vec3 at = transform_point(water_light.view, position) +
            normal_offset(out_of, vec3(0.0, 0.0, 1.0), water_light.depth.y) * out_of;
  vec2 texel = in_window(water_light.projection, water_light.depth.x, at);
  if (window_weight(water_light.depth.x, texel, LEAST_BLEND) < 1.0) {
    return 1.0;
  }
  vec2 slope = face_slope(out_of, water_light.projection, water_light.depth.x);
  return lit_part(light_depth, texel, -at.z, slope);
}
#endif

// The sun's light through the water at a point, relative to that on the surface: caustics, or what a
// calm surface lets through where there are none.
float light_through_water(vec3 position)
{
  float path = calm_light_path(position);
  float calm = water_light.depth.z * attenuation(water.optics.x, path);
#ifdef CAUSTICS
  // Photons know the shadows of what stands in the air. What is seen lies within their window, but for its fade.
  vec2 uv = to_texture(water_light.projection, transform_point(water_light.view, position));
  vec2 edge = min(uv, 1.0 - uv);
  float known = smoothstep(0.0, WINDOW_FADE / water_light.depth.x, min(edge.x, edge.y));
  return mix(calm, texture(caustics, uv).r, known);
#else
#  ifdef SHADOWS
  calm *= sun_visibility(position - path * water_light.direction.xyz, vec3(0.0, 0.0, 1.0));
#  endif
  return calm;
#endif
}

// Part of the sky's light that is left at a point in the water.
vec3 sky_in_water(vec3 position)
{
  return water_light.sky.w * exp(-water_light.sky.rgb * max(water.plane.z - position.z, 0.0));
}

// Irradiance of the sun on a surface in the water. face: the normal of the face itself, for shadows.
vec3 sun_in_water(vec3 position, vec3 normal, vec3 face)
{
  float cosine = max(-dot(normal, water_light.direction.xyz), 0.0);
  float relative = water_light.depth.w * water_light.direction.w * cosine;
  if (relative <= 0.0) {
    return vec3(0.0);
  }
  relative *= light_through_water(position);
#ifdef SHADOWS
  relative *= water_light_visibility(position, face);
#endif
  vec3 by_color = water_light.sun.w * exp(-water_light.sun.rgb * calm_light_path(position));
  return lights.sun_irradiance.rgb * by_color * relative;
}
