// SPDX-License-Identifier: GPL-3.0-or-later
// Turns the sums of photons into the caustics.

#include "caustics_lib.glsl"

// The greatest value of a half float.
#define MAX_HALF 65504.0

void main()
{
#ifdef COUNTERS
  int size = textureSize(counters, 0).x;
#else
  int size = textureSize(sums, 0).x;
#endif
  ivec2 at = min(ivec2((0.5 * v_ndc + 0.5) * float(size)), ivec2(size - 1));
#ifdef COUNTERS
  float light = float(texelFetch(counters, at, 0).r) +
                4294967296.0 * float(texelFetch(counters, at + ivec2(0, size), 0).r);
  vec2 found = vec2(light, float(texelFetch(counters, at + ivec2(0, 2 * size), 0).r)) / counter_scale;
#else
  vec2 found = texelFetch(sums, at, 0).rg;
#endif
  out_value = min(resolved(found.x, found.y, vec2(at), float(size), float(size) / photons), MAX_HALF);
}
