// SPDX-License-Identifier: GPL-3.0-or-later
// One photon a texel of the light camera's window: where it lands, its light, and whether it does.

#include "photon_lib.glsl"
#include "shadow_lib.glsl"

void main()
{
#ifdef GRID
  mat2 mesh_turn = mat2(0.0);
#else
  // The sign of a derivative is that of the target's rows, which not all graphics interfaces order alike.
  mat2 mesh_turn = mat2(dFdx(v_slope) * sign(dFdx(v_launch.x)), dFdy(v_slope) * sign(dFdy(v_launch.y)));
#endif
  out_photon = vec4(0.0);
  out_spread = vec2(0.0);
  if (!is_water(v_position)) {
    return;
  }
  float photons = water_light.caustics.x;
  vec2 launch = (floor((0.5 * v_launch + 0.5) * photons) + 0.5) / photons;
  WaterPoint point = on_waves(v_position, v_wave, v_slope);
  Photon found = photon(point, mesh_turn, launch);
#ifdef SHADOWS
  found.light *= sun_visibility(point.position, normalize(vec3(-point.slope, 1.0)));
#endif
  out_photon = vec4(found.landing, found.light, found.landed ? 1.0 : 0.0);
  out_spread = found.spread;
}
