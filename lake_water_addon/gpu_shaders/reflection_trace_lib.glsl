// SPDX-License-Identifier: GPL-3.0-or-later
// The reflected ray, followed through the depth of the reflection texture. Twin: core/depth_trace.py.

#include "lookup_lib.glsl"
#include "depth_trace_lib.glsl"

#define FARTHEST 5e4
#define HIDDEN_LAND 0.4

Trace trace_reflection(vec3 surface, vec3 direction)
{
  vec3 origin = transform_point(water.reflection_view, surface);
  vec3 along = transform_direction(water.reflection_view, direction);
  float size = water.fresnel.w;
  TextureRay ray = texture_ray(origin, along, water.reflection_projection, FARTHEST, size);
  return trace(reflection_depth, ray, size, HIDDEN_LAND);
}

vec3 traced_reflection(vec3 surface, vec3 direction)
{
  Trace found = trace_reflection(surface, direction);
  vec4 texel = texture(reflection_color, found.uv);
  float known = found.known * clamp(4.0 * texel.a, 0.0, 1.0) * inside_texture(found.uv);
#ifdef HITS
  reflected_hit = vec4(surface + found.way * direction, 1.0) * step(0.5, known);
#endif
  vec3 color = texel.rgb / max(texel.a, 1e-4);
  return known < 1.0 ? mix(sky_radiance(direction), color, known) : color;
}

// What the surface mirrors. A ray that a wave sends downwards meets another wave, which mirrors its part of what is
// above; for what comes out of the water there, what does here is taken.
vec3 mirrored_radiance(vec3 surface, vec3 incident, vec3 normal, vec3 refracted)
{
  vec3 reflected = traced_reflection(surface, reflect_upwards(incident, normal));
  float rise = reflect_direction(incident, normal).z;
  if (rise < 0.0) {
    reflected = mix_fresnel(refracted, reflected, fresnel_dielectric(water.color.w - rise, water.optics.w));
  }
  return reflected;
}
