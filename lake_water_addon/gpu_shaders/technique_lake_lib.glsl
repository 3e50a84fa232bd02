// SPDX-License-Identifier: GPL-3.0-or-later
// The Lake technique (Mihalik's thesis, 2008; MODEL section 1), camera in the air. Twin: core/technique_lake.py.

// TRACE_REFLECTIONS: reflected rays are followed, in place of the fixed offset c. TRACE_REFRACTIONS: refracted ones, in
// place of the search. EXACT_FRESNEL: Fresnel's equations.

#include "air_lookup_lib.glsl"

#define BISECTION_STEPS 6
#define THICKNESS 2.0
#define REFRACTION_STEPS int(water.rays.x)
#define REFLECTION_STEPS int(water.rays.y)

#include "depth_trace_lib.glsl"
#ifdef TRACE_REFLECTIONS
#  include "reflection_trace_lib.glsl"
#endif

#ifdef TRACE_REFRACTIONS
vec3 refracted_radiance(vec3 surface, vec3 direction)
{
  Trace found = trace_downwards(
      refraction_depth, water.refraction_view, water.refraction_projection, surface, direction, REFRACTION_STEPS);
  vec4 color = color_and_known(refraction_color, found);
#  ifdef HITS
  refracted_hit = hit_of(found, color.a, surface, direction);
#  endif
  return through_water(color.rgb, water.color.rgb, color.a * attenuation(water.optics.x, found.way));
}
#else
vec3 refracted_radiance(vec3 surface, vec3 direction)
{
  vec3 u = transform_point(water.refraction_view, surface);
  vec3 r = transform_direction(water.refraction_view, direction);
  Intersection found = intersect(u, r, water.refraction_projection, REFRACTION_STEPS);
  vec2 uv = to_texture(water.refraction_projection, found.hit);
  vec3 radiance = radiance_through_water(u, uv, distance(found.bottom, u));
#  ifdef HITS
  // W itself, unless nothing is drawn there.
  if (texture(refraction_color, uv).a >= LEAST_KNOWN) {
    refracted_hit.xyz = surface + dot(found.hit - u, r) * direction;
  }
#  endif
  return radiance;
}
#endif

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec3 refracted = refracted_radiance(surface, refract_direction(-to_eye, normal, water.optics.w));
#ifdef TRACE_REFLECTIONS
  vec3 reflected = mirrored_radiance(surface, -to_eye, normal, refracted);
#else
  vec3 reflected = reflected_radiance(surface, reflect_upwards(-to_eye, normal));
#endif
#ifdef EXACT_FRESNEL
  float fresnel = fresnel_dielectric(dot(to_eye, normal), water.optics.w);
#else
  float fresnel = schlick(dot(to_eye, normal), water.fresnel.x, water.optics.y);
#endif
  return mix_fresnel(refracted, reflected, fresnel);
}
