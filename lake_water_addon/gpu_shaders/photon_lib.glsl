// SPDX-License-Identifier: GPL-3.0-or-later
// Photons of sunlight through the waves. Twin: core/caustics.py, which explains it.

#include "camera_lib.glsl"
#include "optics_lib.glsl"
#include "waves_lib.glsl"
#include "sun_run_lib.glsl"

#define MAX_TURN 0.25
#define MAX_RAISE 2.0
#define MIN_FACING 0.1
#define DEPTH_JUMP 8.0
#define NOTHING 5e4
#define MIN_DESCENT 0.05

struct WavesAt {
  float height;
  vec2 slope;
  vec3 curvature; // xx, xy, yy
};

struct WaterPoint {
  vec3 position;
  vec2 slope;
  vec3 curvature; // of the waves
};

struct Photon {
  vec2 landing; // uv
  vec2 spread;  // uv
  float light;
  bool landed;
};

WavesAt waves_at(vec2 p)
{
  WavesAt at = WavesAt(0.0, vec2(0.0), vec3(0.0));
  int count = int(water.plane.w);
  for (int i = 0; i < count; i++) {
    vec4 wave = water.waves[i];
    vec2 turned = wave.z * sine_cosine(dot(wave.xy, p) + wave.w);
    at.height += turned.x;
    at.slope += wave.xy * turned.y;
    at.curvature -= wave.xxy * wave.xyy * turned.x;
  }
  return at;
}

// Change of the slope over a step.
vec2 bend(vec3 curvature, vec2 along)
{
  return vec2(dot(curvature.xy, along), dot(curvature.yz, along));
}

// The surface on the sun's ray through a point between the vertices of its mesh.
WaterPoint on_waves(vec3 point, float wave, vec2 mesh_slope)
{
  vec3 run = sun_run();
  float raised = (waves_at(point.xy - water.plane.xy).height - wave) / max(1.0, length(run.xy));
  point += raised * run;
  wave += raised;
  WavesAt at = waves_at(point.xy - water.plane.xy);
  float facing = 1.0 - dot(mesh_slope + at.slope, run.xy);
  raised = (at.height - wave) / max(facing, 1.0 / MAX_RAISE);
  vec2 turn = bend(at.curvature, raised * run.xy);
  float scale = min(1.0, MAX_TURN / max(length(turn), 1e-9));
  return WaterPoint(point + scale * raised * run, mesh_slope + at.slope + scale * turn, at.curvature);
}

// Distance of the bottom along the light. The intersection algorithm looks it up here.
float bottom_depth(vec2 uv)
{
  ivec2 size = textureSize(light_depth, 0);
  vec2 at = clamp(uv, 0.0, 1.0) * vec2(size) - 0.5;
  ivec2 low = clamp(ivec2(floor(at)), ivec2(0), size - 2);
  vec2 part = at - vec2(low);
  vec4 z = textureGather(light_depth, vec2(low + 1) / vec2(size)).wzxy;
  float jump = max(max(z.x, z.y), max(z.z, z.w)) - min(min(z.x, z.y), min(z.z, z.w));
  if (jump > DEPTH_JUMP * water_light.depth.y) {
    part = floor(clamp(part, 0.0, 1.0) + 0.5);
  }
  vec2 column = z.xz + part.x * (z.yw - z.xz);
  return column.x + part.y * (column.y - column.x);
}

#include "intersection_lib.glsl"

// Whether a point of the surface is water over a bottom, and not under dry ground.
bool is_water(vec3 point)
{
  vec3 at = transform_point(water_light.view, point);
  float below = bottom_depth(to_texture(water_light.projection, at));
  return below >= -at.z && below < NOTHING;
}

// From one launching place on the water plane to the next along the window's x (0) or y (1), in m.
vec3 launch_step(int axis)
{
  vec3 sideways = vec3(water_light.view[0][axis], water_light.view[1][axis], water_light.view[2][axis]);
  vec3 direction = water_light.direction.xyz;
  vec3 level = sideways - direction * (sideways.z / direction.z);
  return level * (2.0 / (water_light.projection[axis][axis] * water_light.caustics.x));
}

// How far apart two photons are after `way` m of water, launched a `step_between` apart, less that step.
vec3 ray_spread(WaterPoint point, vec2 mesh_turn, float way, vec3 step_between)
{
  vec3 run = sun_run();
  vec3 to_sun = lights.sun_direction.xyz;
  float n12 = water.optics.w;
  float steepness = sqrt(1.0 + dot(point.slope, point.slope));
  vec3 normal = vec3(-point.slope, 1.0) / steepness;
  float rise = dot(point.slope, step_between.xy) / max(1.0 - dot(point.slope, run.xy), MIN_FACING);
  vec3 tilt = vec3(-bend(point.curvature, step_between.xy + rise * run.xy) - mesh_turn, 0.0);
  tilt = (tilt - normal * dot(normal, tilt)) / steepness;
  float cosine = -dot(normal, to_sun);
  float root = sqrt(max(1.0 - n12 * n12 * (1.0 - cosine * cosine), 1e-6));
  float change = -n12 * dot(tilt, to_sun) * (1.0 + n12 * cosine / root);
  vec3 bent = -(change * normal + (n12 * cosine + root) * tilt);
  return rise * run + way * bent;
}

// The photon that meets the surface at a point. mesh_turn: columns, change of the mesh's own slope from one
// photon to the next along the window's x and y; launch: where it comes from, uv.
Photon photon(WaterPoint point, mat2 mesh_turn, vec2 launch)
{
  vec3 run = sun_run();
  vec3 to_sun = lights.sun_direction.xyz;
  vec3 normal = normalize(vec3(-point.slope, 1.0));
  vec3 at = transform_point(water_light.view, point.position);
  vec3 direction = transform_direction(water_light.view, refract_direction(-to_sun, normal, water.optics.w));

  Intersection found = intersect(at, direction, water_light.projection, int(water_light.caustics.z));
  float way = dot(found.hit - at, direction);
  vec2 scale = 0.5 * vec2(water_light.projection[0][0], water_light.projection[1][1]);
  float height = point.position.z - water.plane.z;
  vec2 moved = height * transform_direction(water_light.view, run).xy + way * direction.xy;

  vec2 squares = vec2(0.0);
  for (int axis = 0; axis < 2; axis++) {
    vec3 apart = ray_spread(point, mesh_turn[axis], way, launch_step(axis));
    vec2 in_window = scale * transform_direction(water_light.view, apart).xy;
    in_window[axis] += 1.0 / water_light.caustics.x;
    squares += in_window * in_window;
  }

  Photon result;
  result.landing = launch + scale * moved;
  result.spread = sqrt(squares);
  result.light = (1.0 - schlick(dot(normal, to_sun), water.fresnel.x, water.optics.y)) *
                 attenuation(water.optics.x, distance(found.bottom, at));
  result.landed = direction.z < -MIN_DESCENT && found.bottom.z > -NOTHING &&
                  min(result.landing.x, result.landing.y) >= 0.0 &&
                  max(result.landing.x, result.landing.y) < 1.0;
  return result;
}
