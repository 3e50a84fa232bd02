// SPDX-License-Identifier: GPL-3.0-or-later
// Turns the sums of photons into the caustics. Twin: resolved() of core/caustics.py.

#include "caustics_lib.glsl"

// The greatest value of a half float.
#define MAX_HALF 65504.0

#ifdef COUNTERS
#  define SUMS counters
#else
#  define SUMS sums
#endif

// Light and what is missing.
vec2 sums_at(ivec2 texel)
{
#ifdef COUNTERS
  int size = textureSize(counters, 0).x;
  float light = float(texelFetch(counters, texel, 0).r) +
                4294967296.0 * float(texelFetch(counters, texel + ivec2(0, size), 0).r);
  return vec2(light, float(texelFetch(counters, texel + ivec2(0, 2 * size), 0).r)) / counter_scale;
#else
  return texelFetch(sums, texel, 0).rg;
#endif
}

void main()
{
  int size = textureSize(SUMS, 0).x;
  float spacing = float(size) / photons;
  ivec2 texel = min(ivec2((0.5 * v_ndc + 0.5) * float(size)), ivec2(size - 1));
  vec2 sum = sums_at(texel);
  float covered = coverage(sum.y, vec2(texel), float(size), spacing);
  if (covered < MIN_COVERAGE) {
    sum.x = 0.0;
    covered = 0.0;
    int away = int(ceil(spacing));
    for (int i = 0; i < 4; i++) {
      ivec2 along = i < 2 ? ivec2(1, 0) : ivec2(0, 1);
      ivec2 neighbor = clamp(texel + (i % 2 == 0 ? -away : away) * along, ivec2(0), ivec2(size - 1));
      vec2 beside = sums_at(neighbor);
      float weight = coverage(beside.y, vec2(neighbor), float(size), spacing);
      if (weight >= MIN_COVERAGE) {
        sum.x += beside.x;
        covered += weight;
      }
    }
  }
  out_value = covered > 0.0 ? min(sum.x / covered, MAX_HALF) : 0.0;
}
