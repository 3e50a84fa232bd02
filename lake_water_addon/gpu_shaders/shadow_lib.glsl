// SPDX-License-Identifier: GPL-3.0-or-later
// Shadows from the depth textures of the light cameras. Twin: core/shadows.py, which explains it.

#include "camera_lib.glsl"

// m: nothing is shaded by what is nearer than this in front of it.
#define SHADOW_BIAS 1e-3
// In texels: how far along its normal a point is moved, for light that grazes its face.
#define NORMAL_OFFSET 0.5
// Least cosine between a face's normal and the light for which its slope is still taken as it is.
#define LEAST_FACING 0.05
// In texels: how far from a place the filter reads.
#define FILTER_REACH 1.5
// Width, as a part of a window, over which it gives way to the next.
#define WINDOW_BLEND 0.0625
// In texels: the same of a window that is the last.
#define LEAST_BLEND 1e-3

// Quadratic B-spline around the texel whose centre lies `offset` texels (-1/2 to 1/2) before the point.
vec3 spline_weights(float offset)
{
  vec2 outer = vec2(0.5 - offset, 0.5 + offset);
  return vec3(0.5 * outer.x * outer.x, 0.75 - offset * offset, 0.5 * outer.y * outer.y);
}

// How far along its normal a point is moved before it is looked up, in m; negative: against it.
float normal_offset(vec3 normal, vec3 to_light, float texel)
{
  float cosine = clamp(dot(normal, to_light), -1.0, 1.0);
  float clearance = NORMAL_OFFSET * texel * sqrt(1.0 - cosine * cosine) + SHADOW_BIAS;
  return cosine < 0.0 ? -clearance : clearance;
}

// Along a face with this normal in a light camera's space: m along the light for each texel across it.
vec2 face_slope(vec3 normal, mat4 projection, float size)
{
  float facing = normal.z < 0.0 ? min(normal.z, -LEAST_FACING) : max(normal.z, LEAST_FACING);
  return 2.0 * normal.xy / (facing * size * vec2(projection[0][0], projection[1][1]));
}

// Where a point in a light camera's space lies in its window of `size` texels a side, in texels.
vec2 in_window(mat4 projection, float size, vec3 at)
{
  vec2 place = vec2(projection[0][0], projection[1][1]) * at.xy + projection[3].xy;
  return (0.5 * place + 0.5) * size;
}

// What a window counts at a place in it, 0 to 1: nothing within the filter's reach of its border, all of it
// from `blend` texels further in.
float window_weight(float size, vec2 texel, float blend)
{
  vec2 inside = min(texel, size - texel) - FILTER_REACH;
  return clamp(min(inside.x, inside.y) / blend, 0.0, 1.0);
}

// Part of the 3x3 texels around a place that has nothing nearer to the light than the face there, 0 to 1.
// along: m to the face at the place; slope: of the face.
float lit_part(sampler2D distances, vec2 texel, float along, vec2 slope)
{
  vec2 nearest = floor(texel);
  vec2 offset = texel - nearest - 0.5;
  vec3 wx = spline_weights(offset.x);
  vec3 wy = spline_weights(offset.y);
  ivec2 first = ivec2(nearest) - 1;
  vec3 face = vec3(along - dot(slope, offset + 1.0)) + vec3(0.0, slope.x, 2.0 * slope.x);
  float lit = 0.0;
  for (int y = 0; y < 3; y++) {
    vec3 row = vec3(texelFetch(distances, first + ivec2(0, y), 0).r,
                    texelFetch(distances, first + ivec2(1, y), 0).r,
                    texelFetch(distances, first + ivec2(2, y), 0).r);
    lit += wy[y] * dot(wx, vec3(greaterThanEqual(row, face + float(y) * slope.y)));
  }
  return lit;
}

#ifdef SHADOWS
// Part of the sun that is seen from a point in the air of a face with this normal, either of its two, 0 to 1:
// by the smallest window that has it, and near that one's border by the next, too.
float sun_visibility(vec3 position, vec3 normal)
{
  vec3 from = transform_point(lights.shadow_view, position);
  vec3 out_of = transform_direction(lights.shadow_view, normal);
  int count = int(lights.shadow.x);
  float lit = 0.0;
  float unknown = 1.0;
  for (int i = 0; i < count; i++) {
    vec3 at = from + normal_offset(out_of, vec3(0.0, 0.0, 1.0), lights.shadow_texels[i]) * out_of;
    vec2 texel = in_window(lights.shadow_projections[i], lights.shadow.y, at);
    // Beyond the last there is none to blend with.
    float blend = i < count - 1 ? WINDOW_BLEND * lights.shadow.y : LEAST_BLEND;
    float weight = unknown * window_weight(lights.shadow.y, texel, blend);
    if (weight > 0.0) {
      texel.y += float(i) * lights.shadow.y;
      vec2 slope = face_slope(out_of, lights.shadow_projections[i], lights.shadow.y);
      lit += weight * lit_part(shadow_depth, texel, -at.z, slope);
      unknown -= weight;
    }
    if (unknown <= 0.0) {
      break;
    }
  }
  return lit + unknown;
}
#endif
