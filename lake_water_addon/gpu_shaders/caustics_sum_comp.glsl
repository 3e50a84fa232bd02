// SPDX-License-Identifier: GPL-3.0-or-later
// Adds the photons with integer atomics, whose order does not matter: bit-identical in every run. `counters` are three
// squares, one above the other: light, what its 32 bits carried over, and what is missing.

#include "caustics_lib.glsl"

void main()
{
  ivec2 index = ivec2(gl_GlobalInvocationID.xy);
  ivec2 photons = textureSize(photon_map, 0);
  if (any(greaterThanEqual(index, photons))) {
    return;
  }
  int size = imageSize(counters).x;
  Deposit given = deposit(texelFetch(photon_map, index, 0), texelFetch(spread_map, index, 0).rg, vec2(index),
                          float(size), float(size) / float(photons.x));
  float amount = counter_scale * (given.light + given.missing);
  if (amount <= 0.0) {
    return;
  }
  int square = given.missing > 0.0 ? 2 * size : 0;
  ivec2 first = max(ivec2(floor(given.center - given.half_width)), ivec2(0));
  ivec2 last = min(ivec2(floor(given.center + given.half_width)), ivec2(size - 1));
  vec2 scale = 1.0 / given.half_width;
  float before_row = tent_before((float(first.y) - given.center.y) * scale.y);
  for (int y = first.y; y <= last.y; y++) {
    float after_row = tent_before((float(y + 1) - given.center.y) * scale.y);
    float row = amount * (after_row - before_row);
    before_row = after_row;
    float before = tent_before((float(first.x) - given.center.x) * scale.x);
    for (int x = first.x; x <= last.x; x++) {
      float after = tent_before((float(x + 1) - given.center.x) * scale.x);
      uint units = uint(row * (after - before) + 0.5);
      before = after;
      uint old = imageAtomicAdd(counters, ivec2(x, y + square), units);
      if (old > 0xFFFFFFFFu - units) {
        imageAtomicAdd(counters, ivec2(x, y + size), 1u);
      }
    }
  }
}
