// SPDX-License-Identifier: GPL-3.0-or-later
// A photon as a point that covers the texels of its tent, or as several where one cannot be so large: `parts` along
// each side. Vertices are the columns of the photon map; instances the rows, once for each part.

#include "caustics_lib.glsl"

void main()
{
  int photons = textureSize(photon_map, 0).x;
  ivec2 index = ivec2(int(column), gl_InstanceID % photons);
  vec4 found = texelFetch(photon_map, index, 0);
  float spacing = size / float(photons);
  v_center = found.xy * size;
  v_half_width = tent_spread(texelFetch(spread_map, index, 0).rg, size, spacing);
  v_light = spacing * spacing * found.z;

  int part = gl_InstanceID / photons;
  vec2 last = min(floor(v_center + v_half_width), size - 1.0);
  v_first = max(floor(v_center - v_half_width), 0.0) + LARGEST_POINT * vec2(part % parts, part / parts);
  vec2 extent = min(last - v_first + 1.0, LARGEST_POINT);
  float side = max(extent.x, extent.y);
  // A point whose middle lies outside is not drawn at all.
  vec2 start = min(v_first, size - side);
  bool drawn = found.a > 0.5 && min(extent.x, extent.y) > 0.0;
  gl_Position = vec4(drawn ? 2.0 * (start + 0.5 * side) / size - 1.0 : vec2(2.0), 0.0, 1.0);
  gl_PointSize = side;
}
