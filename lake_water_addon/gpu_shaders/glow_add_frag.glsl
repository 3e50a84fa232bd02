// SPDX-License-Identifier: GPL-3.0-or-later
// The star, enlarged: what is added to the picture.

#ifdef DISPLAY_REFERRED
#  include "view_transform_lib.glsl"
// Middle grey, in units of the table's toe.
#  define GREY (0.18 * 64.0)
#endif

// place: scale and offset from device coordinates to the texture. glow: radiance where the star is 1.
void main()
{
  vec3 radiance = glow * texture(star, v_ndc * place.xy + place.zw).r;
#ifdef DISPLAY_REFERRED
  // The picture's own radiance is not known here: as much brighter as the glow would make middle grey.
  vec3 grey = vec3(GREY * view_transform_range.x);
  radiance = max(view_transform(grey + radiance) - view_transform(grey), vec3(0.0));
#endif
  out_color = vec4(radiance, 0.0);
}
