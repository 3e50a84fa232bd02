// SPDX-License-Identifier: GPL-3.0-or-later
// The scene's own light: one sun (Lambert) and the sky. Twin: core/lighting.py.

#define INVERSE_PI 0.3183098861837907

// Radiance of a diffuse surface.
vec3 diffuse_radiance(vec3 albedo, vec3 normal)
{
  float cosine = max(dot(normal, lights.sun_direction.xyz), 0.0);
  return albedo * (lights.sun_irradiance.rgb * (cosine * INVERSE_PI) + sky_irradiance(normal));
}
