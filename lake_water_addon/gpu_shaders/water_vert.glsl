// SPDX-License-Identifier: GPL-3.0-or-later
// The water surface: a rectangle of the water frame (GRID), or a mesh of the user's (MESH), raised by the waves.

#include "camera_lib.glsl"
#include "waves_lib.glsl"

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
  v_position = flat_point + vec3(0.0, 0.0, wave_height(flat_point.xy - water.plane.xy));
  vec3 in_camera = transform_point(pass_view.view, v_position);
  gl_Position = pass_view.projection * vec4(in_camera, 1.0);
#ifdef SPLIT
  v_clip = gl_Position;
#endif
}
