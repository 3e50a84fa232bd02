// SPDX-License-Identifier: GPL-3.0-or-later
// The Traced technique: rays followed through the depth of the refraction and the reflection texture, exact
// Fresnel equations, absorption by colour. Twin: core/technique_traced.py, which explains it.

#define MARCH_STEPS int(technique.values[0].x)
#define BISECTION_STEPS int(technique.values[1].x)
#define THICKNESS technique.values[2].x
#define ABSORPTION technique.values[3].rgb
#define REFLECTION_STEPS MARCH_STEPS

#include "reflection_trace_lib.glsl"

vec3 traced_refraction(vec3 surface, vec3 direction)
{
  Trace found = trace_downwards(
      refraction_depth, water.refraction_view, water.refraction_projection, surface, direction, MARCH_STEPS);
  vec4 color = color_and_known(refraction_color, found);
#ifdef HITS
  refracted_hit = hit_of(found, color.a, surface, direction);
#endif
  // Radiance falls by n^2 where rays leave the water and spread.
  vec3 leaving = color.rgb * (water.optics.w * water.optics.w);
  vec3 left = color.a * exp(-ABSORPTION * found.way);
  return water.color.rgb + left * (leaving - water.color.rgb);
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec3 refracted = traced_refraction(surface, refract_direction(-to_eye, normal, water.optics.w));
  vec3 reflected = mirrored_radiance(surface, -to_eye, normal, refracted);
  return mix_fresnel(refracted, reflected, fresnel_dielectric(dot(to_eye, normal), water.optics.w));
}
