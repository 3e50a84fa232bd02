// SPDX-License-Identifier: GPL-3.0-or-later
// What the surface mirrors, seen from the air, along rays that are followed. Twin: core/depth_trace.py.
// The includer defines REFLECTION_STEPS, most steps along a ray, and what depth_trace_lib.glsl asks for.

#include "depth_trace_lib.glsl"

vec3 traced_reflection(vec3 surface, vec3 direction)
{
  Trace found = trace_upwards(
      reflection_depth, water.reflection_view, water.reflection_projection, surface, direction, REFLECTION_STEPS);
  vec4 color = color_and_known(reflection_color, found);
#ifdef HITS
  reflected_hit = hit_of(found, color.a, surface, direction);
#endif
  return color.a < 1.0 ? mix(sky_radiance(direction), color.rgb, color.a) : color.rgb;
}

// A ray that a wave sends downwards meets another wave, which mirrors its part of what is above; for what comes
// out of the water there, what does here is taken.
vec3 mirrored_radiance(vec3 surface, vec3 incident, vec3 normal, vec3 refracted)
{
  vec3 reflected = traced_reflection(surface, reflect_upwards(incident, normal));
  float rise = reflect_direction(incident, normal).z;
  if (rise < 0.0) {
    reflected = mix_fresnel(refracted, reflected, fresnel_dielectric(water.color.w - rise, water.optics.w));
  }
  return reflected;
}
