// SPDX-License-Identifier: GPL-3.0-or-later
// Lookups in the pictures that the water sees. Twin: core/lookup.py.

// 1 inside the texture, falling to 0 over a narrow band at its border.
float inside_texture(vec2 uv)
{
  vec2 edge = min(uv, 1.0 - uv);
  return smoothstep(0.0, water.fresnel.z, min(edge.x, edge.y));
}

// rgb: radiance of a premultiplied texel at uv, without texels that have no color in the filter's mean; a: how far it is
// known.
vec4 known_color(vec4 texel, vec2 uv)
{
  return vec4(texel.rgb / max(texel.a, 1e-4), clamp(4.0 * texel.a, 0.0, 1.0) * inside_texture(uv));
}
