// SPDX-License-Identifier: GPL-3.0-or-later

#include "sky_lib.glsl"

void main()
{
  vec3 direction = -pass_view.eye.xyz;
  if (pass_view.eye.w < 0.5) {
    direction = (pass_view.clip_to_direction * vec4(v_ndc, 1.0, 1.0)).xyz;
  }
  out_color = vec4(sky_radiance(normalize(direction)), 1.0);
#ifdef LINEAR_DEPTH
  out_depth = LINEAR_DEPTH;
#endif
}
