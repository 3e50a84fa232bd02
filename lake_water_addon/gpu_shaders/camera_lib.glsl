// SPDX-License-Identifier: GPL-3.0-or-later
// Twin: core/cameras.py.

#define MIN_W 1e-6

bool is_orthographic(mat4 projection)
{
  return projection[3][3] == 1.0;
}

// T: texture coordinates of a point in the camera space of the camera that drew the texture. A point
// beside or behind that camera gets coordinates far outside, on its own side.
vec2 to_texture(mat4 projection, vec3 point)
{
  vec4 clip = projection * vec4(point, 1.0);
  return 0.5 * clip.xy / max(clip.w, MIN_W) + 0.5;
}

vec3 transform_point(mat4 matrix, vec3 point)
{
  return (matrix * vec4(point, 1.0)).xyz;
}

vec3 transform_direction(mat4 matrix, vec3 direction)
{
  return mat3(matrix) * direction;
}
