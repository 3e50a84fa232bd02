// SPDX-License-Identifier: GPL-3.0-or-later
// The Simple Lake technique (Mihalik and Durikovic's paper; MODEL section 2). The refraction camera is the main
// camera. Twin: core/technique_simple_lake.py.

#include "air_lookup_lib.glsl"

#define SIMPLE_LAKE_LONGEST_PATH technique.values[0].x
#define SIMPLE_LAKE_STEP technique.values[1].x

vec3 refracted_radiance(vec3 surface, vec3 direction)
{
  vec3 u = transform_point(water.refraction_view, surface);
  vec3 a = straight_bottom(u);
  float path = a.z < u.z ? distance(a, u) : 0.0;
  float step_length = min(path, SIMPLE_LAKE_LONGEST_PATH) * SIMPLE_LAKE_STEP;
  vec3 w = u + step_length * transform_direction(water.refraction_view, direction);
  return radiance_through_water(u, to_texture(water.refraction_projection, w), path);
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec3 refracted = refracted_radiance(surface, refract_direction(-to_eye, normal, water.optics.w));
  vec3 reflected = reflected_radiance(surface, reflect_upwards(-to_eye, normal));
  return mix_fresnel(refracted, reflected, schlick(dot(to_eye, normal), 0.0, water.optics.y));
}
