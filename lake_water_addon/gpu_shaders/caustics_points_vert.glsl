// SPDX-License-Identifier: GPL-3.0-or-later
// A photon as a point that covers the texels of its tent. Vertices are the columns, instances the rows.

#include "caustics_lib.glsl"

void main()
{
  ivec2 index = ivec2(int(column), gl_InstanceID);
  float spacing = size / float(textureSize(photon_map, 0).x);
  Deposit given = deposit(texelFetch(photon_map, index, 0), texelFetch(spread_map, index, 0).rg, vec2(index),
                          size, spacing);
  v_center = given.center;
  v_half_width = given.half_width;
  v_amounts = vec2(given.light, given.missing);
  vec2 first = max(floor(given.center - given.half_width), 0.0);
  vec2 last = min(floor(given.center + given.half_width), size - 1.0);
  float side = max(last.x - first.x, last.y - first.y) + 1.0;
  // A point whose middle lies outside is not drawn at all.
  vec2 start = min(first, size - side);
  bool drawn = given.light + given.missing > 0.0;
  gl_Position = vec4(drawn ? 2.0 * (start + 0.5 * side) / size - 1.0 : vec2(2.0), 0.0, 1.0);
  gl_PointSize = side;
}
