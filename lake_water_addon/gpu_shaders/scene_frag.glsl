// SPDX-License-Identifier: GPL-3.0-or-later
// The look of the scene. With CLIPPED it draws one side of a water surface, for the refraction and
// reflection textures: premultiplied, with alpha 1 wherever a colour is known. UNDER_WATER lights it
// through the water; with WATER_LINE, too, only what lies below the waves.

#include "sky_lib.glsl"
#include "lighting_lib.glsl"
#ifdef SHADOWS
#  include "shadow_lib.glsl"
#endif
#ifdef UNDER_WATER
#  include "water_light_lib.glsl"
#endif
#ifdef CLIPPED
#  include "waves_lib.glsl"
#endif
#ifdef WATER_LINE
#  include "waves_lib.glsl"
#endif

void main()
{
  // The face's own normal, for shadows; here, as there are no derivatives in a branch.
  vec3 face = cross(dFdx(v_position), dFdy(v_position));
#ifdef CLIPPED
  // Height over the waves, on the side that is left out; waves are summed only where they reach, and
  // one texel further, for the derivative. (It is taken here because there is none in a branch.)
  vec3 from_origin = v_position - water.plane.xyz;
  float reach = abs(pass_view.clip.y - water.plane.z) + fwidth(v_position.z);
  float wave = abs(from_origin.z) <= reach ? wave_height(from_origin.xy) : 0.0;
  float beyond = pass_view.clip.x * (from_origin.z - wave);
  float one_texel = fwidth(beyond);
#endif
#ifdef TEXTURED
  vec4 texel = texture(base_image, v_uv, pass_view.clip.z);
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
  // One texel beyond the water line is kept, for the filter.
  if (beyond > one_texel) {
    discard;
  }
#endif

  // A face seen from behind is lit like its other side. By the face and not by the normal, which leaves
  // of grass have turned up on purpose.
  vec3 n = normalize(gl_FrontFacing ? v_normal : -v_normal);
  face = dot(face, face) > 1e-36 ? normalize(face) : n;
  bool in_air = true;
#ifdef UNDER_WATER
  in_air = false;
#endif
#ifdef WATER_LINE
  in_air = v_position.z - water.plane.z > wave_height(v_position.xy - water.plane.xy);
#endif
  vec3 sun = vec3(0.0);
  vec3 sky = vec3(1.0);
  if (in_air) {
    sun = sun_in_air(n);
#ifdef SHADOWS
    if (max(max(sun.r, sun.g), sun.b) > 0.0) {
      sun *= sun_visibility(v_position, face);
    }
#endif
  }
#ifdef UNDER_WATER
  else {
    sun = sun_in_water(v_position, n, face);
    sky = sky_in_water(v_position);
  }
#endif
  out_color = vec4(diffuse_radiance(albedo, n, sun, sky), 1.0);
#ifdef MARK_INSIDE
  // The inside of a solid that the water line cuts open: nothing can be seen there, so that a
  // lookup that lands here must be taken elsewhere.
  bool unknown = mark_inside != 0 && !gl_FrontFacing;
  if (unknown) {
    out_color = vec4(0.0);
  }
#endif
#ifdef LINEAR_DEPTH
  out_depth = v_depth;
#  ifdef MARK_INSIDE
  // A ray that is searched here is behind something, and hits nothing.
  if (unknown) {
    out_depth = 0.0;
  }
#  endif
#endif
}
