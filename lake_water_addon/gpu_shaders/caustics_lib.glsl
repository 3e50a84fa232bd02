// SPDX-License-Identifier: GPL-3.0-or-later
// How photons are spread and summed. Twin: core/caustics.py, which explains it.

#define MIN_SPREAD 0.25
#define MAX_SPREAD 8.0
#define MIN_COVERAGE 0.45

// What one texel of the photon map adds to the caustics.
struct Deposit {
  vec2 center;     // texels
  vec2 half_width; // texels
  float light;     // of a photon that landed
  float missing;   // of one that was not launched from water, where a calm surface would have sent it
};

// Half widths in texels of a photon's tent. spread: in uv; spacing: of the photons, in texels.
vec2 tent_spread(vec2 spread, float size, float spacing)
{
  return clamp(spread * size, min(MIN_SPREAD, spacing), max(MAX_SPREAD, 2.0 * spacing));
}

// Part of a tent over [-1, 1] that lies before z.
float tent_before(float z)
{
  z = clamp(z, -1.0, 1.0);
  return 0.5 + z - 0.5 * z * abs(z);
}

// Part of a tent about `center` that lies in a texel, all in texels.
float tent_part(float texel, float center, float half_width)
{
  return tent_before((texel + 1.0 - center) / half_width) - tent_before((texel - center) / half_width);
}

// found, spread: of the maps; index: in them; size: of the caustics, spacing: of the photons, in texels.
Deposit deposit(vec4 found, vec2 spread, vec2 index, float size, float spacing)
{
  float flux = spacing * spacing;
  if (spread.x <= 0.0) {
    return Deposit((index + 0.5) * spacing, vec2(spacing), 0.0, flux);
  }
  return Deposit(found.xy * size, tent_spread(spread, size, spacing), found.a > 0.5 ? flux * found.z : 0.0, 0.0);
}

// Coverage of a texel, in one axis, when all photons are launched from water: 1 but for what tents from
// beyond the border would add.
float border_coverage(float texel, float size, float spacing)
{
  float from_left = tent_part(texel, -0.5 * spacing, spacing);
  float from_right = tent_part(size - 1.0 - texel, -0.5 * spacing, spacing);
  return 1.0 - spacing * (from_left + from_right);
}

// Sum that photons of light 1 give a texel under a calm surface, less what is missing of them.
float coverage(float missing, vec2 texel, float size, float spacing)
{
  return border_coverage(texel.x, size, spacing) * border_coverage(texel.y, size, spacing) - missing;
}
