// SPDX-License-Identifier: GPL-3.0-or-later
// The star around each highlight. Twin: core/glow.py.
// Takes the sampler `highlights`.

#define REACH 3
#define TAPS 13.0

float highlight_at(ivec2 texel)
{
  bool inside = all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, textureSize(highlights, 0)));
  return inside ? texelFetch(highlights, texel, 0).r : 0.0;
}

// The mean of the two diagonals of the 7x7 window.
float star_filter(ivec2 texel)
{
  float total = highlight_at(texel);
  for (int k = 1; k <= REACH; k++) {
    total += highlight_at(texel + ivec2(k, k)) + highlight_at(texel - ivec2(k, k));
    total += highlight_at(texel + ivec2(k, -k)) + highlight_at(texel + ivec2(-k, k));
  }
  return total / TAPS;
}
