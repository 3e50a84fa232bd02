// SPDX-License-Identifier: GPL-3.0-or-later
// What a calm surface would give each texel. Twin: core/caustics.py, which explains it.
// The includer has the sampler `spread_map`.

#include "caustics_lib.glsl"

bool is_wet(ivec2 photon)
{
  return texelFetch(spread_map, photon, 0).r > 0.0;
}

// Coverage of a texel, in one axis, when all photons are launched from water: 1 but for what tents from
// beyond the border would add.
float border_coverage(float texel, float size, float spacing)
{
  float from_left = tent_part(texel, -0.5 * spacing, spacing);
  float from_right = tent_part(size - 1.0 - texel, -0.5 * spacing, spacing);
  return 1.0 - spacing * (from_left + from_right);
}

// The same in both axes.
float whole_coverage(ivec2 texel, float size, float spacing)
{
  return border_coverage(float(texel.x), size, spacing) * border_coverage(float(texel.y), size, spacing);
}

// Sum that the photons launched from water, had they light 1, would give a texel under a calm surface.
float coverage(ivec2 texel, float size, float spacing)
{
  ivec2 first = max(ivec2(floor(vec2(texel) / spacing - 0.5)) - 1, ivec2(0));
  ivec2 last = min(ivec2(ceil(vec2(texel + 1) / spacing + 0.5)), textureSize(spread_map, 0) - 1);
  float covered = 0.0;
  for (int y = first.y; y <= last.y; y++) {
    float row = spacing * tent_part(float(texel.y), (float(y) + 0.5) * spacing, spacing);
    for (int x = first.x; x <= last.x; x++) {
      float part = spacing * tent_part(float(texel.x), (float(x) + 0.5) * spacing, spacing);
      covered += is_wet(ivec2(x, y)) ? row * part : 0.0;
    }
  }
  return covered;
}
