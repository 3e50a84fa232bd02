// SPDX-License-Identifier: GPL-3.0-or-later
// Scene-linear to display-referred colour, from a table that Blender itself filled. Twin: core/view_transform.py.

// Where a scene-linear value lies in the table: logarithmic, so that highlights keep their place.
vec3 to_lattice(vec3 linear_color)
{
  vec3 stops = log2(max(linear_color, vec3(0.0)) / view_transform_range.x + 1.0);
  return stops / log2(view_transform_range.y / view_transform_range.x + 1.0);
}

// Inverse of the sRGB encoding.
vec3 srgb_decoded(vec3 encoded)
{
  vec3 low = encoded / 12.92;
  vec3 high = pow((max(encoded, vec3(0.0)) + 0.055) / 1.055, vec3(2.4));
  return mix(high, low, vec3(lessThanEqual(encoded, vec3(0.04045))));
}

// For the viewport's overlay: its framebuffer encodes to sRGB what is written, so the display colour
// is decoded once.
vec3 view_transform(vec3 linear_color)
{
  float size = float(textureSize(view_transform_table, 0).x);
  vec3 at = clamp(to_lattice(linear_color), 0.0, 1.0);
  return srgb_decoded(texture(view_transform_table, (at * (size - 1.0) + 0.5) / size).rgb);
}
