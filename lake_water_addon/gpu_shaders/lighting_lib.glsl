// SPDX-License-Identifier: GPL-3.0-or-later
// The scene's own light: one sun (Lambert) and the sky. Twin: core/lighting.py.

#define INVERSE_PI 0.3183098861837907

// Irradiance of the sun on a surface in the air that sees all of it.
vec3 sun_in_air(vec3 normal)
{
  return lights.sun_irradiance.rgb * max(dot(normal, lights.sun_direction.xyz), 0.0);
}

// Radiance of a diffuse surface under the sun's irradiance and a part of the sky's.
vec3 diffuse_radiance(vec3 albedo, vec3 normal, vec3 sun, vec3 sky)
{
  return albedo * (sun * INVERSE_PI + sky * sky_irradiance(normal));
}
