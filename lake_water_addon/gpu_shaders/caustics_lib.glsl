// SPDX-License-Identifier: GPL-3.0-or-later
// How photons are spread over texels. Twin: core/caustics.py, which explains it.

#define MIN_SPREAD 0.25
#define MAX_SPREAD 8.0

// Integer sums: counts in a value of 1, and how many a counter of 32 bits can hold. The upper of two counters
// does not overflow with all light of the window in one texel.
#define COUNTS 2147483648.0
#define COUNTER 4294967296.0

// Half widths in texels of a photon's tent. spread: in uv; spacing: of the photons, in texels.
vec2 tent_spread(vec2 spread, float size, float spacing)
{
  return clamp(spread * size, min(MIN_SPREAD, spacing), max(MAX_SPREAD, spacing));
}

// Part of a tent over [-1, 1] that lies before z.
float tent_before(float z)
{
  z = clamp(z, -1.0, 1.0);
  return 0.5 + z * (1.0 - 0.5 * abs(z));
}

// Part of a tent about `center` that lies in a texel, all in texels.
float tent_part(float texel, float center, float half_width)
{
  return tent_before((texel + 1.0 - center) / half_width) - tent_before((texel - center) / half_width);
}
