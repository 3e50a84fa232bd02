// SPDX-License-Identifier: GPL-3.0-or-later
// Instances of a mesh. Three texels of `instances` an instance: the rows of object to render space.

#include "camera_lib.glsl"

void main()
{
  int index = 3 * (instance_base + gl_InstanceID);
  int width = textureSize(instances, 0).x;
  vec4 row_x = texelFetch(instances, ivec2(index % width, index / width), 0);
  vec4 row_y = texelFetch(instances, ivec2((index + 1) % width, (index + 1) / width), 0);
  vec4 row_z = texelFetch(instances, ivec2((index + 2) % width, (index + 2) / width), 0);

  vec4 local = vec4(position, 1.0);
  vec3 world = vec3(dot(row_x, local), dot(row_y, local), dot(row_z, local));
  // Normals go with the cofactors: right under any scale, and without a division.
  vec3 cofactor_x = cross(row_y.xyz, row_z.xyz);
  vec3 cofactor_y = cross(row_z.xyz, row_x.xyz);
  vec3 cofactor_z = cross(row_x.xyz, row_y.xyz);
  float handedness = dot(row_x.xyz, cofactor_x) < 0.0 ? -1.0 : 1.0;
  v_normal = handedness * vec3(dot(cofactor_x, normal), dot(cofactor_y, normal), dot(cofactor_z, normal));

  v_position = world;
  v_uv = uv;
  v_color = color;
  vec3 in_camera = transform_point(pass_view.view, world);
  v_depth = -in_camera.z;
  gl_Position = pass_view.projection * vec4(in_camera, 1.0);
#ifdef CLIPPED
  gl_ClipDistance[0] = pass_view.clip.x * (pass_view.clip.y - world.z);
#endif
}
