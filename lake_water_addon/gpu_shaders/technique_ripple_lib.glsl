// SPDX-License-Identifier: GPL-3.0-or-later
// The Ripple technique (Chen; MODEL section 4), on a flat surface. Twin: core/technique_ripple.py.

#include "screen_lookup_lib.glsl"
#include "wave_maps_lib.glsl"

#define RIPPLE_TILE_SIZE technique.values[0].x
#define RIPPLE_REFLECTION_DISTORTION technique.values[3].x
#define RIPPLE_REFRACTION_DISTORTION technique.values[4].x
#define RIPPLE_NORMAL_STRENGTH technique.values[5].x
#define RIPPLE_DISTANCE_STRENGTH technique.values[6].x
#define RIPPLE_DISTANCE_RANGE technique.values[7].xy
#define RIPPLE_ANGLE_STRENGTH technique.values[8].x
#define RIPPLE_ANGLE_RANGE technique.values[9].xy
#define RIPPLE_DEPTH_STRENGTH technique.values[10].x
#define RIPPLE_DEPTH_RANGE technique.values[11].xy
#define RIPPLE_DEPTH_DARKENING technique.values[12].x
#define RIPPLE_DEPTH_DARKENING_RANGE technique.values[13].xy
#define RIPPLE_PATH_DARKENING technique.values[14].x
#define RIPPLE_PATH_DARKENING_RANGE technique.values[15].xy
#define RIPPLE_MOVED technique.values[16].xy

// What the map says, -1 to 1, along the axes of the water frame.
vec2 ripple_displacement(vec3 surface)
{
  return decode_dudv(texture(dudv_map, in_water_frame(surface) / RIPPLE_TILE_SIZE - RIPPLE_MOVED));
}

// Alpha, the part of the reflection.
float ripple_opacity(float from_eye, float cosine, float depth)
{
  float alpha = RIPPLE_DISTANCE_STRENGTH * ramp(from_eye, RIPPLE_DISTANCE_RANGE);
  alpha += RIPPLE_ANGLE_STRENGTH * ramp(acos(clamp(cosine, -1.0, 1.0)), RIPPLE_ANGLE_RANGE);
  alpha += RIPPLE_DEPTH_STRENGTH * ramp(depth, RIPPLE_DEPTH_RANGE);
  return clamp(alpha, 0.0, 1.0);
}

// What is left of the scene below; path: m of water on the line of sight.
float ripple_brightness(float depth, float path)
{
  float lost = RIPPLE_DEPTH_DARKENING * ramp(depth, RIPPLE_DEPTH_DARKENING_RANGE);
  lost += RIPPLE_PATH_DARKENING * ramp(path, RIPPLE_PATH_DARKENING_RANGE);
  return clamp(1.0 - lost, 0.0, 1.0);
}

vec3 water_radiance(vec3 surface, vec3 normal, vec3 to_eye)
{
  vec2 d = ripple_displacement(surface);
  vec3 tilted = normalize(vec3(from_water_frame(RIPPLE_NORMAL_STRENGTH * d), 1.0));
  vec2 below = water_below(surface);
  vec2 own = screen_coordinate(surface);
  vec3 refracted = radiance_near(refraction_color, own + RIPPLE_REFRACTION_DISTORTION * d, own, vec3(0.0));
#ifdef HITS
  refracted_hit = shown_point(
      refraction_depth, water.refraction_view, water.refraction_projection, looked_up.xy, looked_up.z);
#endif
  vec3 sky = sky_radiance(reflect_upwards(-to_eye, tilted));
  vec2 mirrored = under_horizon(own + RIPPLE_REFLECTION_DISTORTION * d);
  vec3 reflected = radiance_near(reflection_color, mirrored, own, sky);
#ifdef HITS
  reflected_hit = shown_point(
      reflection_depth, water.reflection_view, water.reflection_projection, looked_up.xy, looked_up.z);
#endif
  float alpha = ripple_opacity(viewing_distance(surface), dot(to_eye, tilted), below.x);
  return mix(ripple_brightness(below.x, below.y) * refracted, reflected, alpha);
}
