// SPDX-License-Identifier: GPL-3.0-or-later
// Twin: core/cameras.py.

bool is_orthographic(mat4 projection)
{
  return projection[3][3] == 1.0;
}

// T: texture coordinates of a point in the camera space of the camera that drew the texture.
vec2 to_texture(mat4 projection, vec3 point)
{
  vec4 clip = projection * vec4(point, 1.0);
  return 0.5 * clip.xy / clip.w + 0.5;
}

vec3 transform_point(mat4 matrix, vec3 point)
{
  return (matrix * vec4(point, 1.0)).xyz;
}

vec3 transform_direction(mat4 matrix, vec3 direction)
{
  return mat3(matrix) * direction;
}
