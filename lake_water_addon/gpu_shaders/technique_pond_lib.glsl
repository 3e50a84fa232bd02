// SPDX-License-Identifier: GPL-3.0-or-later
// The Pond technique (Luna, 2006; MODEL section 3). The refraction texture holds the whole scene without the
// water, seen by the main camera. Twin: core/technique_pond.py, which explains it.

#include "screen_lookup_lib.glsl"
#include "wave_maps_lib.glsl"
#include "lighting_lib.glsl"

#define POND_TILE_SIZE_0 technique.values[0].x
#define POND_TILE_SIZE_1 technique.values[2].x
#define POND_RIPPLE_SCALE technique.values[4].xy
#define POND_BIAS technique.values[5].x
#define POND_BIAS_MAP_STRENGTH technique.values[6].x
#define POND_BIAS_DEPTH_STRENGTH technique.values[7].x
#define POND_BIAS_DEPTH_RANGE technique.values[8].xy
#define POND_BIAS_DISTANCE_STRENGTH technique.values[9].x
#define POND_BIAS_DISTANCE_RANGE technique.values[10].xy
#define POND_POWER technique.values[11].x
#define POND_AMBIENT technique.values[12].rgb
#define POND_DIFFUSE technique.values[13].rgb
#define POND_SPECULAR technique.values[14].rgb
#define POND_SHININESS technique.values[15].x
#define POND_IMPURITY technique.values[16].x
#define POND_IMPURITY_MAP_STRENGTH technique.values[17].x
#define POND_IMPURITY_TILE_SIZE technique.values[18].x
#define POND_MOVED technique.values[20]

// pow(0, 0) is undefined in GLSL.
#define MIN_BASE 1e-30
#define MIN_EXTENT 1e-6

// The mean of both maps, in the water frame; p: m in it.
vec3 pond_ripple_normal(vec2 p)
{
  vec3 n0 = decode_normal(texture(normal_map_0, p / POND_TILE_SIZE_0 - POND_MOVED.xy));
  vec3 n1 = decode_normal(texture(normal_map_1, p / POND_TILE_SIZE_1 - POND_MOVED.zw));
  return normalize(0.5 * (n0 + n1));
}

// Slopes add.
vec3 pond_on_waves(vec3 normal, vec3 ripple)
{
  vec2 turned = from_water_frame(ripple.xy);
  return normalize(vec3(normal.xy * ripple.z + turned * normal.z, normal.z * ripple.z));
}

// Luna's v runs down: no shift at the bottom edge of the picture.
vec2 pond_lookup_shift(vec3 ripple, vec2 own)
{
  float v = clamp(1.0 - own.y, 0.0, 1.0);
  float v2 = v * v;
  float v8 = v2 * v2 * v2 * v2;
  return ripple.xy * POND_RIPPLE_SCALE * vec2(1.0, 1.0 - v8 * v2);
}

// 0 to 1 over the rectangle around the water.
vec2 pond_over_the_water(vec2 p)
{
  return 0.5 * (p - water.grid.zw) / max(water.grid.xy, vec2(MIN_EXTENT)) + 0.5;
}

float pond_refraction_bias(float depth, float from_eye, float grey)
{
  float bias = POND_BIAS + POND_BIAS_MAP_STRENGTH * grey;
  bias += POND_BIAS_DEPTH_STRENGTH * (1.0 - ramp(depth, POND_BIAS_DEPTH_RANGE));
  return bias + POND_BIAS_DISTANCE_STRENGTH * (1.0 - ramp(from_eye, POND_BIAS_DISTANCE_RANGE));
}

float pond_refraction_weight(float cosine, float bias)
{
  return clamp(bias + pow(max(cosine, MIN_BASE), POND_POWER), 0.0, 1.0);
}

// What the material makes of the weighted colour. Without a sun the light comes from above.
vec3 pond_light_on_material(vec3 normal)
{
  vec3 sun = lights.sun_direction.xyz;
  vec3 towards = dot(sun, sun) > 0.5 ? sun : vec3(0.0, 0.0, 1.0);
  return POND_AMBIENT + POND_DIFFUSE * max(dot(normal, towards), 0.0);
}

vec3 pond_highlight(vec3 normal, vec3 to_eye)
{
  vec3 sun = lights.sun_direction.xyz;
  if (dot(normal, sun) <= 0.0) {
    return vec3(0.0);
  }
  float cosine = dot(reflect_direction(-sun, normal), to_eye);
  float shine = pow(max(cosine, MIN_BASE), POND_SHININESS);
  return shine * POND_SPECULAR * lights.sun_irradiance.rgb * INVERSE_PI;
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec2 p = in_water_frame(surface);
  vec3 ripple = pond_ripple_normal(p);
  float grey = texture(bias_map, pond_over_the_water(p)).r;
  vec4 layer = texture(impurity_map, p / POND_IMPURITY_TILE_SIZE);
  vec3 n = pond_on_waves(normal, ripple);

  vec2 own = screen_coordinate(surface);
  vec2 at = own + pond_lookup_shift(ripple, own);
  vec3 refracted = radiance_near(refraction_color, at, own, water.color.rgb);
#ifdef HITS
  refracted_hit = shown_point(
      refraction_depth, water.refraction_view, water.refraction_projection, looked_up.xy, looked_up.z);
#endif
  refracted = mix(refracted, water.color.rgb, POND_IMPURITY);
  vec3 mirrored_sky = sky_radiance(reflect_upwards(-to_eye, n));
  vec3 reflected = radiance_near(reflection_color, under_horizon(at), own, mirrored_sky);
#ifdef HITS
  reflected_hit = shown_point(
      reflection_depth, water.reflection_view, water.reflection_projection, looked_up.xy, looked_up.z);
#endif

  float bias = pond_refraction_bias(water_below(surface).x, viewing_distance(surface), grey);
  float w = pond_refraction_weight(dot(n, to_eye), bias);
  vec3 color = pond_light_on_material(n) * mix(reflected, refracted, w);
  vec3 floating = layer.rgb * (sun_in_air(n) * INVERSE_PI + sky_irradiance(n));
  color = mix(color, floating, POND_IMPURITY_MAP_STRENGTH * layer.a);
  return color + pond_highlight(n, to_eye);
}
