// SPDX-License-Identifier: GPL-3.0-or-later
// Turns the sums of photons into the caustics. Twin: resolved() of core/caustics.py.

#include "coverage_lib.glsl"

#define MIN_COVERAGE 0.45

// The greatest value of a half float.
#define MAX_HALF 65504.0

#ifdef COUNTERS
#  define SUMS counters
#else
#  define SUMS sums
#endif

float sum_at(ivec2 texel)
{
#ifdef COUNTERS
  float upper = float(texelFetch(counters, texel + ivec2(0, textureSize(counters, 0).x), 0).r);
  return (float(texelFetch(counters, texel, 0).r) + COUNTER * upper) / COUNTS;
#else
  return texelFetch(sums, texel, 0).r;
#endif
}

void main()
{
  int size = textureSize(SUMS, 0).x;
  int photons = textureSize(spread_map, 0).x;
  float spacing = float(size) / float(photons);
  ivec2 texel = min(ivec2((0.5 * v_ndc + 0.5) * float(size)), ivec2(size - 1));
  ivec2 tile = min(ivec2((vec2(texel) + 0.5) / spacing), ivec2(photons - 1)) / TILE;
  float wet = texelFetch(shore, tile, 0).r;

  float light = sum_at(texel);
  float covered = wet > 0.25 ? whole_coverage(texel, float(size), spacing) : 0.0;
  int neighbors = 0;
  if (wet > 0.25 && wet < 0.75) {
    float least = MIN_COVERAGE * covered;
    covered = coverage(texel, float(size), spacing);
    if (covered < least) {
      light = 0.0;
      covered = 0.0;
      neighbors = 4;
    }
  }
  // Water hardly covers this texel: the mean of those one photon away that it covers.
  int away = int(ceil(spacing));
  for (int i = 0; i < neighbors; i++) {
    ivec2 along = i < 2 ? ivec2(1, 0) : ivec2(0, 1);
    ivec2 neighbor = clamp(texel + (i % 2 == 0 ? -away : away) * along, ivec2(0), ivec2(size - 1));
    float weight = coverage(neighbor, float(size), spacing);
    if (weight >= MIN_COVERAGE * whole_coverage(neighbor, float(size), spacing)) {
      light += sum_at(neighbor);
      covered += weight;
    }
  }
  out_value = covered > 0.0 ? min(light / covered, MAX_HALF) : 0.0;
}
