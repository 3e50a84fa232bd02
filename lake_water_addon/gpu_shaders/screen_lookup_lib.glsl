// SPDX-License-Identifier: GPL-3.0-or-later
// Lookups at a fragment's own place in the picture, for Pond and Ripple. Twin: core/screen_lookup.py.

#include "air_lookup_lib.glsl"
#include "surface_lib.glsl"

#define MIN_WIDTH 1e-6

vec2 from_water_frame(vec2 v)
{
  vec2 axis = water.grid_axis.xy;
  return vec2(axis.x * v.x - axis.y * v.y, axis.y * v.x + axis.x * v.y);
}

// In both textures.
vec2 screen_coordinate(vec3 surface)
{
  return to_texture(water.refraction_projection, transform_point(water.refraction_view, surface));
}

// Of the reflection texture: a ripple far off does not look beyond the mirrored horizon, at the sky's nadir.
vec2 under_horizon(vec2 at)
{
  mat4 projection = water.reflection_projection;
  if (is_orthographic(projection)) {
    return at;
  }
  vec2 ndc = 2.0 * at - 1.0;
  vec2 ray = (ndc + projection[2].xy) / vec2(projection[0][0], projection[1][1]);
  return to_texture(projection, over_horizon(vec3(ray, -1.0)));
}

float viewing_distance(vec3 surface)
{
  vec3 u = transform_point(water.refraction_view, surface);
  return is_orthographic(water.refraction_projection) ? max(-u.z, 0.0) : length(u);
}

// m of water over what is seen straight through the surface: x downwards, y on that line.
vec2 water_below(vec3 surface)
{
  vec3 u = transform_point(water.refraction_view, surface);
  vec3 a = straight_bottom(u);
  if (a.z >= u.z) {
    return vec2(0.0);
  }
  vec3 up = water.refraction_view[2].xyz;
  return vec2(max(dot(u - a, up), 0.0), distance(a, u));
}

// 0 up to range.x, 1 from range.y on.
float ramp(float x, vec2 range)
{
  float width = range.y - range.x;
  if (abs(width) < MIN_WIDTH) {
    return x >= range.x ? 1.0 : 0.0;
  }
  return clamp((x - range.x) / width, 0.0, 1.0);
}

// Where nothing is known `at` a place, such as the inside of a solid that is cut open: the fragment's own.
vec3 radiance_near(sampler2D picture, vec2 at, vec2 own, vec3 substitute)
{
  vec4 texel = texture(picture, at);
  if (texel.a < LEAST_KNOWN) {
    texel = texture(picture, own);
#ifdef HITS
    at = own;
#endif
  }
#ifdef HITS
  looked_up = vec3(at, clamp(4.0 * texel.a, 0.0, 1.0));
#endif
  return mix(substitute, texel.rgb / max(texel.a, 1e-4), clamp(4.0 * texel.a, 0.0, 1.0));
}
