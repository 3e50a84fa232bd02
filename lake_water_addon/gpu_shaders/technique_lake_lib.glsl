// SPDX-License-Identifier: GPL-3.0-or-later
// The Lake technique (Mihalik's thesis, 2008; MODEL section 1), camera in the air. Twin: core/technique_lake.py.

#include "air_lookup_lib.glsl"

vec3 refracted_radiance(vec3 surface, vec3 direction)
{
  vec3 u = transform_point(water.refraction_view, surface);
  vec3 r = transform_direction(water.refraction_view, direction);
  Intersection found = intersect(u, r, water.refraction_projection, int(water.fresnel.y));
  vec2 uv = to_texture(water.refraction_projection, found.hit);
  return radiance_through_water(u, uv, distance(found.bottom, u));
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec3 refracted = refracted_radiance(surface, refract_direction(-to_eye, normal, water.optics.w));
  vec3 reflected = reflected_radiance(surface, reflect_upwards(-to_eye, normal));
  float fresnel = schlick(dot(to_eye, normal), water.fresnel.x, water.optics.y);
  return mix_fresnel(refracted, reflected, fresnel);
}
