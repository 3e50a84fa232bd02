// SPDX-License-Identifier: GPL-3.0-or-later
// The line along which the surface cuts the picture: water that climbs the lens, and is darker than both sides.

#include "optics_lib.glsl"
#include "fog_lib.glsl"
#include "near_side_lib.glsl"
#ifdef DISPLAY_REFERRED
#  include "view_transform_lib.glsl"
#endif

// Part of the water's colour that the line shows.
#define MENISCUS_BRIGHTNESS 0.5

// The steepest surface that the line follows, in m a pixel over m of the near plane a pixel: at an edge of the
// water, its height jumps.
#define STEEPEST 8.0

void main()
{
  float height = height_over_surface(v_ndc);
  float per_pixel = length(vec2(dFdx(height), dFdy(height)));
  float pixel = length(dFdx(v_ndc.x) * near_plane.right.xyz) + length(dFdy(v_ndc.y) * near_plane.up.xyz);
  float weight = meniscus_weight(height, min(per_pixel, STEEPEST * pixel), meniscus_width);
  vec3 color = MENISCUS_BRIGHTNESS * water.color.rgb;
#ifdef DISPLAY_REFERRED
  color = view_transform(color);
#endif
  out_color = vec4(color, 1.0) * weight;
}
