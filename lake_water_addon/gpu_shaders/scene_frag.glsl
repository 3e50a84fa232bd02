// SPDX-License-Identifier: GPL-3.0-or-later
// The dry look of the scene. With CLIPPED it draws one side of a water surface, for the
// refraction and reflection textures: premultiplied, with alpha 1 wherever a colour is known.

#include "sky_lib.glsl"
#include "lighting_lib.glsl"
#ifdef CLIPPED
#  include "waves_lib.glsl"
#endif

void main()
{
#ifdef CLIPPED
  float footprint = fwidth(v_position.x) + fwidth(v_position.y) + fwidth(v_position.z);
#endif
#ifdef TEXTURED
  vec4 texel = texture(base_image, v_uv);
  if (texel.a < base_color.a) {
    discard;
  }
  vec3 albedo = texel.rgb;
#else
  vec3 albedo = use_vertex_color != 0 ? v_color.rgb : base_color.rgb;
#endif

#ifdef CLIPPED
  // The plane clips a little too far off, so that no wave cuts a hole. What still lies on the
  // wrong side of the waves themselves goes here: nothing above the water is seen through it.
  // One texel's footprint is kept, for the filter at the water line.
  if (abs(v_position.z - water.plane.z) <= abs(pass_view.clip.y - water.plane.z)) {
    float surface = water.plane.z + wave_height(v_position.xy - water.plane.xy);
    if (pass_view.clip.x * (surface - v_position.z) < -footprint) {
      discard;
    }
  }
#endif

  vec3 to_eye = pass_view.eye.w > 0.5 ? pass_view.eye.xyz : pass_view.eye.xyz - v_position;
  vec3 n = normalize(v_normal);
  if (dot(n, to_eye) < 0.0) {
    n = -n;
  }
  out_color = vec4(diffuse_radiance(albedo, n), 1.0);
#ifdef CLIPPED
  // The inside of a solid that the water line cuts open: nothing can be seen there, so that a
  // lookup that lands here must be taken elsewhere.
  if (solid != 0 && !gl_FrontFacing) {
    out_color = vec4(0.0);
  }
#endif
#ifdef LINEAR_DEPTH
  out_depth = v_depth;
#endif
}
