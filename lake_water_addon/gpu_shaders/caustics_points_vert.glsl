// SPDX-License-Identifier: GPL-3.0-or-later
// A photon as a point that covers the texels of its tent. Vertices are the columns, instances the rows.

#include "caustics_lib.glsl"

void main()
{
  ivec2 index = ivec2(int(column), gl_InstanceID);
  vec4 found = texelFetch(photon_map, index, 0);
  float spacing = size / float(textureSize(photon_map, 0).x);
  v_center = found.xy * size;
  v_half_width = tent_spread(texelFetch(spread_map, index, 0).rg, size, spacing);
  v_light = spacing * spacing * found.z;
  vec2 first = max(floor(v_center - v_half_width), 0.0);
  vec2 last = min(floor(v_center + v_half_width), size - 1.0);
  float side = max(last.x - first.x, last.y - first.y) + 1.0;
  // A point whose middle lies outside is not drawn at all.
  vec2 start = min(first, size - side);
  gl_Position = vec4(found.a > 0.5 ? 2.0 * (start + 0.5 * side) / size - 1.0 : vec2(2.0), 0.0, 1.0);
  gl_PointSize = side;
}
