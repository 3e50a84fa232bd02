// SPDX-License-Identifier: GPL-3.0-or-later

#include "caustics_lib.glsl"

void main()
{
  vec2 texel = floor(gl_FragCoord.xy);
  float amount = v_light * tent_part(texel.x, v_center.x, v_half_width.x) *
                 tent_part(texel.y, v_center.y, v_half_width.y);
  // What comes before belongs to another part.
  out_sum = all(greaterThan(texel, v_first - 0.5)) ? amount : 0.0;
}
