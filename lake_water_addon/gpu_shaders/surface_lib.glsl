// SPDX-License-Identifier: GPL-3.0-or-later
// The surface between the vertices of its mesh. Twin: core/surface.py, which explains it.
// The includer includes waves_lib.glsl.

#define SURFACE_STEPS 6
#define LEAST_APPROACH 0.25
#define NEARER 0.9
#define ENDLESS 1e30

struct SurfacePoint {
  vec3 position;
  vec2 slope;
};

// m along the axes of the water frame, from its origin.
vec2 in_water_frame(vec3 surface)
{
  vec2 d = surface.xy - water.plane.xy;
  vec2 axis = water.grid_axis.xy;
  return vec2(axis.x * d.x + axis.y * d.y, axis.x * d.y - axis.y * d.x);
}

bool is_in_body(vec3 surface)
{
  vec2 apart = abs(in_water_frame(surface) - water.grid.zw);
  return apart.x <= water.grid.x && apart.y <= water.grid.y;
}

// m from a point of the mesh that the surface may be nearer to the eye, as in struct View.
float most_towards_eye(vec4 eye, vec3 point)
{
  return eye.w > 0.5 ? ENDLESS : NEARER * distance(eye.xyz, point);
}

// Where the line of sight through a point of the mesh meets the surface. wave: height of the waves there, mesh_slope:
// slope without them, both as interpolated; most: m towards the eye that it may be away; up: 1 seen from the air, -1
// from below.
SurfacePoint surface_in_sight(vec3 point, float wave, vec2 mesh_slope, vec3 to_eye, float most, float up)
{
  float over_mesh = to_eye.z - dot(mesh_slope, to_eye.xy);
  float least_approach = LEAST_APPROACH * abs(to_eye.z) + 1e-3;
  vec3 at = wave_slope_and_height(point.xy - water.plane.xy);
  float above = wave - at.z;
  float facing = up * (over_mesh - dot(at.xy, to_eye.xy));
  float way = 0.0;
  float best = abs(above);
  SurfacePoint found = SurfacePoint(point, mesh_slope + at.xy);
  for (int i = 0; i < SURFACE_STEPS; i++) {
    way = min(way - up * above / max(facing, least_approach), most);
    vec3 position = point + way * to_eye;
    at = wave_slope_and_height(position.xy - water.plane.xy);
    float height = wave + way * over_mesh;
    above = height - at.z;
    facing = up * (over_mesh - dot(at.xy, to_eye.xy));
    if (abs(above) < best && facing > 0.0 && abs(height) <= water.fresnel.y && is_in_body(position)) {
      best = abs(above);
      found = SurfacePoint(position, mesh_slope + at.xy);
    }
  }
  return found;
}
