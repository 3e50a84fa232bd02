// SPDX-License-Identifier: GPL-3.0-or-later
// The water surface: a rectangle of the water frame (GRID), or a mesh of the user's (MESH), raised by the waves.
// With PHOTONS as the sun sees it: every point is moved along the sun's light to the water plane, where a texel of the
// light camera's picture has the same flux as any other.

#include "camera_lib.glsl"
#include "waves_lib.glsl"
#ifdef PHOTONS
#  include "sun_run_lib.glsl"
#endif

// m above and below the water plane in which the order of heights is known.
#define HEIGHT_RANGE 100.0

void main()
{
#ifdef GRID
  vec2 in_frame = water.grid.zw + (2.0 * cell - 1.0) * water.grid.xy;
  vec2 axis = water.grid_axis.xy;
  vec3 flat_point = vec3(axis.x * in_frame.x - axis.y * in_frame.y, axis.y * in_frame.x + axis.x * in_frame.y, 0.0) +
                    water.plane.xyz;
  v_slope = vec2(0.0);
#else
  vec3 flat_point = transform_point(object_matrix, position);
#  ifdef HEIGHTS_ONLY
  v_slope = vec2(0.0);
#  else
  vec3 up = mat3(normal_matrix) * normal;
  v_slope = -up.xy / max(abs(up.z), 1e-3) * sign(up.z);
#  endif
#endif
  float wave = wave_height(flat_point.xy - water.plane.xy);
  v_position = flat_point + vec3(0.0, 0.0, wave);
#ifndef HEIGHTS_ONLY
  v_wave = wave;
#endif
#ifdef PHOTONS
  float height = v_position.z - water.plane.z;
  vec3 launch = v_position - height * sun_run();
  v_launch = (water_light.projection * vec4(transform_point(water_light.view, launch), 1.0)).xy;
  // Of two points in one ray of the sun, the higher one takes its light.
  gl_Position = vec4(v_launch, clamp(-height / HEIGHT_RANGE, -1.0, 1.0), 1.0);
#else
  vec3 in_camera = transform_point(pass_view.view, v_position);
  gl_Position = pass_view.projection * vec4(in_camera, 1.0);
#endif
#ifdef SPLIT
  v_clip = gl_Position;
#endif
}
