// SPDX-License-Identifier: GPL-3.0-or-later
// Scene-linear to display-referred colour, from a table that Blender itself filled. Twin: core/view_transform.py.

// Where a scene-linear value lies in the table: logarithmic, so that highlights keep their place.
vec3 to_lattice(vec3 linear_color)
{
  vec3 stops = log2(max(linear_color, vec3(0.0)) / view_transform_range.x + 1.0);
  return stops / log2(view_transform_range.y / view_transform_range.x + 1.0);
}

// What Blender's viewport overlay shows as this display colour: it is encoded with a plain power of 2.2.
vec3 overlay_decoded(vec3 display)
{
  return pow(max(display, vec3(0.0)), vec3(2.2));
}

// For the viewport's overlay, which is merged after colour management.
vec3 view_transform(vec3 linear_color)
{
  float size = float(textureSize(view_transform_table, 0).x);
  vec3 at = clamp(to_lattice(linear_color), 0.0, 1.0);
  return overlay_decoded(texture(view_transform_table, (at * (size - 1.0) + 0.5) / size).rgb);
}
