// SPDX-License-Identifier: GPL-3.0-or-later

#include "glow_star_lib.glsl"

// size: texels that are drawn.
void main()
{
  out_star = star_filter(ivec2((0.5 * v_ndc + 0.5) * size));
}
