// SPDX-License-Identifier: GPL-3.0-or-later
// Lookups in the pictures that the water sees. Twin: core/lookup.py.

// 1 inside the texture, falling to 0 over a narrow band at its border.
float inside_texture(vec2 uv)
{
  vec2 edge = min(uv, 1.0 - uv);
  return smoothstep(0.0, water.fresnel.z, min(edge.x, edge.y));
}
