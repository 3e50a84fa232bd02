// SPDX-License-Identifier: GPL-3.0-or-later
// Where the shores are: for each tile of photons, and those `margin` around it, how many are launched from water.
// 1: all, 0: none. The caustics have to look at single ones only in between.

#include "coverage_lib.glsl"

void main()
{
  int photons = textureSize(spread_map, 0).x;
  ivec2 tile = ivec2((0.5 * v_ndc + 0.5) * float((photons + TILE - 1) / TILE));
  ivec2 first = max(tile * TILE - margin, ivec2(0));
  ivec2 last = min(tile * TILE + TILE - 1 + margin, ivec2(photons - 1));
  int wet = 0;
  for (int y = first.y; y <= last.y; y++) {
    for (int x = first.x; x <= last.x; x++) {
      wet += is_wet(ivec2(x, y)) ? 1 : 0;
    }
  }
  ivec2 count = last - first + 1;
  out_part = wet == count.x * count.y ? 1.0 : (wet == 0 ? 0.0 : 0.5);
}
