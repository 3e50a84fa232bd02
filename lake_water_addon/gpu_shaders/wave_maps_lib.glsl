// SPDX-License-Identifier: GPL-3.0-or-later
// Texels of normal maps and dudv maps. Twin: core/wave_maps.py.

#define MIN_Z 1e-3

// Grey has no direction at all: z is at least MIN_Z.
vec3 decode_normal(vec4 texel)
{
  vec3 n = 2.0 * texel.xyz - 1.0;
  return normalize(vec3(n.xy, max(n.z, MIN_Z)));
}

vec2 decode_dudv(vec4 texel)
{
  return 2.0 * texel.xy - 1.0;
}
