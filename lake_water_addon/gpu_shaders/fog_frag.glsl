// SPDX-License-Identifier: GPL-3.0-or-later
// The water between the eye and what is drawn, over it: water_color + a (C - water_color), as premultiplied
// blending. With SPLIT only in the pixels that begin under water.

#include "optics_lib.glsl"
#include "fog_lib.glsl"
#ifdef SPLIT
#  include "near_side_lib.glsl"
#endif
#ifdef DISPLAY_REFERRED
#  include "view_transform_lib.glsl"
#endif

void main()
{
#ifdef SPLIT
  if (height_over_surface(v_ndc) > 0.0) {
    discard;
  }
#endif
  ivec2 size = textureSize(scene_depth, 0);
  ivec2 at = min(ivec2((0.5 * v_ndc + 0.5) * vec2(size)), size - 1);
  float a = fog_transmittance(water.optics.x, v_ndc, texelFetch(scene_depth, at, 0).r);
  vec3 color = water.color.rgb;
#ifdef DISPLAY_REFERRED
  color = view_transform(color);
#endif
  out_color = vec4(color, 1.0) * (1.0 - a);
}
