// SPDX-License-Identifier: GPL-3.0-or-later
// The water's surface. TECHNIQUE names the file that turns a surface point into radiance, seen from the air or
// FROM_BELOW. With SPLIT only the pixels that begin on that side are drawn. With HITS it tells where it looked, too.

#include "camera_lib.glsl"
#include "waves_lib.glsl"
#include "optics_lib.glsl"
#include "sky_lib.glsl"
#include "surface_lib.glsl"
#ifdef SPLIT
#  include "fog_lib.glsl"
#  include "near_side_lib.glsl"
#endif
#ifdef HITS
#  include "hits_lib.glsl"
#endif
#include TECHNIQUE
#ifdef DISPLAY_REFERRED
#  include "view_transform_lib.glsl"
#endif

#ifdef FROM_BELOW
#  define UP -1.0
#else
#  define UP 1.0
#endif

void main()
{
#ifdef SPLIT
  bool under = height_over_surface(v_clip.xy / v_clip.w) <= 0.0;
#  ifdef FROM_BELOW
  under = !under;
#  endif
  if (under) {
    discard;
  }
#endif
  bool orthographic = pass_view.eye.w > 0.5;
  vec3 to_eye = orthographic ? pass_view.eye.xyz : normalize(pass_view.eye.xyz - v_position);
  float most = most_towards_eye(pass_view.eye, v_position);
  SurfacePoint surface = surface_in_sight(v_position, v_wave, v_slope, to_eye, most, UP);
  vec3 normal = normalize(vec3(-surface.slope, 1.0));
#ifdef FROM_BELOW
  float path = distance(pass_view.eye.xyz, surface.position);
  if (orthographic) {
    path = max(-transform_point(pass_view.view, surface.position).z, 0.0);
  }
  vec3 radiance = water_radiance_from_below(surface.position, -face_viewer(-normal, to_eye), to_eye, path);
#else
  vec3 radiance = water_radiance(surface.position, face_viewer(normal, to_eye), to_eye);
#endif
#ifdef DISPLAY_REFERRED
  radiance = view_transform(radiance);
#endif
  out_color = vec4(radiance, 1.0);
#ifdef HITS
  out_surface = vec4(surface.position, body_number);
  out_refracted = refracted_hit;
  out_reflected = reflected_hit;
#endif
}
