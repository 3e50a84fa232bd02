// SPDX-License-Identifier: GPL-3.0-or-later
// The Traced technique: rays followed through the depth of the refraction and the reflection texture, exact
// Fresnel equations, absorption by colour. Twin: core/technique_traced.py, which explains it.

#include "lookup_lib.glsl"

#define MARCH_STEPS int(technique.values[0].x)
#define BISECTION_STEPS int(technique.values[1].x)
#define THICKNESS technique.values[2].x
#define ABSORPTION technique.values[3].rgb

#include "depth_trace_lib.glsl"
#include "reflection_trace_lib.glsl"

#define LEAST_DESCENT 0.05
#define BELOW_LOWEST 0.1
#define HIDDEN_BOTTOM 1.0

Trace trace_refraction(vec3 surface, vec3 direction)
{
  float end = (max(surface.z - water.grid_axis.z, 0.0) + BELOW_LOWEST) / max(-direction.z, LEAST_DESCENT);
  vec3 origin = transform_point(water.refraction_view, surface);
  vec3 along = transform_direction(water.refraction_view, direction);
  float size = water.fresnel.w;
  TextureRay ray = texture_ray(origin, along, water.refraction_projection, end, size);
  return trace(refraction_depth, ray, size, HIDDEN_BOTTOM);
}

vec3 traced_refraction(vec3 surface, vec3 direction)
{
  Trace found = trace_refraction(surface, direction);
  vec4 texel = texture(refraction_color, found.uv);
  float known = found.known * clamp(4.0 * texel.a, 0.0, 1.0) * inside_texture(found.uv);
#ifdef HITS
  refracted_hit = vec4(surface + found.way * direction, 1.0) * step(0.5, known);
#endif
  // Radiance falls by n^2 where rays leave the water and spread.
  vec3 color = texel.rgb / max(texel.a, 1e-4) * (water.optics.w * water.optics.w);
  vec3 left = known * exp(-ABSORPTION * found.way);
  return water.color.rgb + left * (color - water.color.rgb);
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec3 refracted = traced_refraction(surface, refract_direction(-to_eye, normal, water.optics.w));
  vec3 reflected = mirrored_radiance(surface, -to_eye, normal, refracted);
  return mix_fresnel(refracted, reflected, fresnel_dielectric(dot(to_eye, normal), water.optics.w));
}
