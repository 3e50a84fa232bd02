// SPDX-License-Identifier: GPL-3.0-or-later
// Adds the photons with integer atomics, whose order does not matter: bit-identical in every run.
// `counters` are two squares, one above the other: the lower and the upper 32 bits of the light.

#include "caustics_lib.glsl"

void main()
{
  ivec2 index = ivec2(gl_GlobalInvocationID.xy);
  ivec2 photons = textureSize(photon_map, 0);
  if (any(greaterThanEqual(index, photons))) {
    return;
  }
  vec4 found = texelFetch(photon_map, index, 0);
  if (found.a < 0.5) {
    return;
  }
  int size = imageSize(counters).x;
  float spacing = float(size) / float(photons.x);
  vec2 center = found.xy * float(size);
  vec2 half_width = tent_spread(texelFetch(spread_map, index, 0).rg, float(size), spacing);
  ivec2 first = max(ivec2(floor(center - half_width)), ivec2(0));
  ivec2 last = min(ivec2(floor(center + half_width)), ivec2(size - 1));
  vec2 scale = 1.0 / half_width;
  float amount = COUNTS * spacing * spacing * found.z;
  float before_row = tent_before((float(first.y) - center.y) * scale.y);
  for (int y = first.y; y <= last.y; y++) {
    float after_row = tent_before((float(y + 1) - center.y) * scale.y);
    float row = amount * (after_row - before_row);
    before_row = after_row;
    float before = tent_before((float(first.x) - center.x) * scale.x);
    for (int x = first.x; x <= last.x; x++) {
      float after = tent_before((float(x + 1) - center.x) * scale.x);
      float counts = floor(row * (after - before) + 0.5);
      before = after;
      float upper = floor(counts / COUNTER);
      uint lower = uint(counts - upper * COUNTER);
      uint old = imageAtomicAdd(counters, ivec2(x, y), lower);
      uint carried = uint(upper) + (old > 0xFFFFFFFFu - lower ? 1u : 0u);
      if (carried > 0u) {
        imageAtomicAdd(counters, ivec2(x, y + size), carried);
      }
    }
  }
}
