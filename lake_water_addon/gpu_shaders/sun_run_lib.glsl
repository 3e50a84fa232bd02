// SPDX-License-Identifier: GPL-3.0-or-later
// Twin: core/caustics.py, which explains it.

#define MAX_RUN 3.0

// Way along a ray of the sun for each metre of height.
vec3 sun_run()
{
  vec3 to_sun = lights.sun_direction.xyz;
  return vec3(to_sun.xy / max(to_sun.z, length(to_sun.xy) / MAX_RUN), 1.0);
}
