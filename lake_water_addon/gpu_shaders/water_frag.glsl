// SPDX-License-Identifier: GPL-3.0-or-later
// The water seen from the air. TECHNIQUE names the file that turns a surface point into radiance.

#include "camera_lib.glsl"
#include "waves_lib.glsl"
#include "optics_lib.glsl"
#include "sky_lib.glsl"
#include TECHNIQUE
#ifdef DISPLAY_REFERRED
#  include "view_transform_lib.glsl"
#endif

void main()
{
  vec3 to_eye = pass_view.eye.w > 0.5 ? pass_view.eye.xyz : normalize(pass_view.eye.xyz - v_position);
  vec2 slope = v_slope + wave_slope(v_position.xy - water.plane.xy);
  vec3 normal = face_viewer(normalize(vec3(-slope, 1.0)), to_eye);
  vec3 radiance = water_radiance(v_position, normal, to_eye);
#ifdef DISPLAY_REFERRED
  radiance = view_transform(radiance);
#endif
  out_color = vec4(radiance, 1.0);
}
