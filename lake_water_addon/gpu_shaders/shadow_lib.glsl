// SPDX-License-Identifier: GPL-3.0-or-later
// Shadows from the depth textures of the light cameras. Twin: core/shadows.py, which explains it.

#include "camera_lib.glsl"

// m: nothing is shaded by what is nearer than this in front of it.
#define SHADOW_BIAS 1e-3

// Quadratic B-spline around the texel whose centre lies `offset` texels (-1/2 to 1/2) before the point.
vec3 spline_weights(float offset)
{
  vec2 outer = vec2(0.5 - offset, 0.5 + offset);
  return vec3(0.5 * outer.x * outer.x, 0.75 - offset * offset, 0.5 * outer.y * outer.y);
}

// How far along its normal a point is moved before it is looked up, in m.
float normal_offset(vec3 normal, vec3 to_light, float texel)
{
  float cosine = clamp(dot(normal, to_light), 0.0, 1.0);
  return 2.0 * texel * sqrt(1.0 - cosine * cosine) + SHADOW_BIAS;
}

// Where a point lies in a window of `size` texels a side, in texels; false within a filter's reach of its border.
bool in_window(mat4 projection, float size, vec3 at, out vec2 texel)
{
  texel = to_texture(projection, at) * size;
  return min(texel.x, texel.y) >= 1.5 && max(texel.x, texel.y) <= size - 1.5;
}

// Part of the 3x3 texels around a place that has nothing nearer to the light than `along` m, 0 to 1.
float lit_part(sampler2D distances, vec2 texel, float along)
{
  vec2 nearest = floor(texel);
  vec3 wx = spline_weights(texel.x - nearest.x - 0.5);
  vec3 wy = spline_weights(texel.y - nearest.y - 0.5);
  float lit = 0.0;
  for (int y = 0; y < 3; y++) {
    for (int x = 0; x < 3; x++) {
      float nearest_thing = texelFetch(distances, ivec2(nearest) + ivec2(x - 1, y - 1), 0).r;
      lit += nearest_thing >= along ? wx[x] * wy[y] : 0.0;
    }
  }
  return lit;
}

#ifdef SHADOWS
// Part of the sun that is seen from a point in the air, 0 to 1: by the smallest window that has it.
float sun_visibility(vec3 position, vec3 normal)
{
  for (int i = 0; i < int(lights.shadow.x); i++) {
    float offset = normal_offset(normal, lights.sun_direction.xyz, lights.shadow_texels[i]);
    vec3 at = transform_point(lights.shadow_view, position + offset * normal);
    vec2 texel;
    if (in_window(lights.shadow_projections[i], lights.shadow.y, at, texel)) {
      texel.y += float(i) * lights.shadow.y;
      return lit_part(shadow_depth, texel, -at.z);
    }
  }
  return 1.0;
}
#endif
