// SPDX-License-Identifier: GPL-3.0-or-later
// The Lake technique seen from under water (Mihalik's thesis, 2008; MODEL section 1). Twin:
// core/technique_lake_under.py. N points from the water to the air, E from the surface to the eye: E.N < 0.
// The block `water` holds the cameras of the two pictures that are looked up from below: refraction is
// what stands above the water, from the main camera, reflection what lies in it, from the mirrored one.
// FOLLOW: rays are followed through the depth of these pictures. EXACT: total reflection and Fresnel's equations.

#define BISECTION_STEPS 6
#define THICKNESS 2.0
#define FOLLOWED_STEPS int(water.rays.y)

#include "depth_trace_lib.glsl"

// m of the thesis: how far along its direction a ray is followed before it is looked up.
#define RAY_LENGTH 1.5
// Most by which the light that fog left in the picture is raised, where the way to the eye is shorter than it was drawn with.
#define MOST_CLEARED 4.0

// R1 of the thesis: bends like water, but leaves no hole of total reflection. Not unit.
vec3 refraction_without_hole(vec3 normal, vec3 to_eye)
{
  return (-normal - to_eye) / water.optics.w + normal;
}

vec3 radiance_from_above(vec3 surface, vec3 direction)
{
  // Below the horizon there is nothing above the water, and the picture has the sky's nadir there.
  direction.z = max(direction.z, MIN_RISE);
#ifdef FOLLOW
  direction = normalize(direction);
  Trace found = trace_upwards(
      refraction_depth, water.refraction_view, water.refraction_projection, surface, direction, FOLLOWED_STEPS);
  vec4 color = color_and_known(refraction_color, found);
#  ifdef HITS
  refracted_hit = hit_of(found, color.a, surface, direction);
#  endif
#else
  // As from the air: a lookup in the inside of something cut open is drawn back towards the surface.
  float reach = RAY_LENGTH;
  vec4 texel = vec4(0.0);
  vec2 uv = vec2(0.0);
  for (int i = 0; i < 4; i++) {
    vec3 w = transform_point(water.refraction_view, surface + reach * direction);
    uv = to_texture(water.refraction_projection, w);
    texel = texture(refraction_color, uv);
    if (texel.a > 0.5) {
      break;
    }
    reach = i < 2 ? 0.5 * reach : 0.0;
  }
  vec4 color = known_color(texel, uv);
#  ifdef HITS
  refracted_hit = shown_point(refraction_depth, water.refraction_view, water.refraction_projection, uv, color.a);
#  endif
#endif
  return color.a < 1.0 ? mix(sky_radiance(normalize(direction)), color.rgb, color.a) : color.rgb;
}

#ifdef FOLLOW
// The texture is fogged over the way from the mirrored camera to what it shows: over that which light really takes,
// path and way, there is as much more or less. What is beyond the texture is taken to be as at its border: endless
// water would show as a dark hole there.
vec3 radiance_from_below(vec3 surface, vec3 direction, float path)
{
  Trace found = trace_downwards(
      reflection_depth, water.reflection_view, water.reflection_projection, surface, direction, FOLLOWED_STEPS);
  vec3 place = transform_point(water.reflection_view, surface + found.way * direction);
  float fogged = is_orthographic(water.reflection_projection) ? -place.z : length(place);
#  ifdef HITS
  reflected_hit = hit_of(found, found.known, surface, direction);
#  endif
  float cleared = min(exp(water.optics.x * (fogged - path - found.way)), MOST_CLEARED);
  vec3 color = texture(reflection_color, found.uv).rgb;
  return mix(water.color.rgb, color, found.known > 0.5 ? cleared : 1.0);
}
#else
// The texture is fogged already, over the whole way from the mirrored camera.
vec3 radiance_from_below(vec3 surface, vec3 direction, float path)
{
  vec3 w = transform_point(water.reflection_view, surface + RAY_LENGTH * direction);
  vec2 uv = to_texture(water.reflection_projection, w);
#  ifdef HITS
  reflected_hit = shown_point(
      reflection_depth, water.reflection_view, water.reflection_projection, uv, inside_texture(uv));
#  endif
  return mix(water.color.rgb, texture(reflection_color, uv).rgb, inside_texture(uv));
}
#endif

// path: m through the water from the surface to the eye.
vec3 water_radiance_from_below(vec3 surface, vec3 normal, vec3 to_eye, float path)
{
  float cosine = -dot(to_eye, normal);
#ifdef EXACT
  vec3 bent = refract_direction(-to_eye, -normal, 1.0 / water.optics.w);
  // Which of the two sees the critical angle first is rounding.
  float fresnel = bent == vec3(0.0) ? 1.0 : fresnel_dielectric(cosine, 1.0 / water.optics.w);
#else
  float fresnel = schlick(cosine, water.fresnel.x, water.optics.y);
  vec3 bent = refraction_without_hole(normal, to_eye);
#endif
  vec3 refracted = vec3(0.0);
  if (fresnel < 1.0) {
    float a = attenuation(water.optics.x, path);
    refracted = through_water(radiance_from_above(surface, bent), water.color.rgb, a);
  }
  vec3 reflected = radiance_from_below(surface, reflect_direction(-to_eye, normal), path);
  return mix_fresnel(refracted, reflected, fresnel);
}
