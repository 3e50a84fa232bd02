// SPDX-License-Identifier: GPL-3.0-or-later
// The side of the surface on which a pixel begins. Twin: core/under_water.py. The includer has the block
// `near_plane` and the map `surface_heights`, fog_lib.glsl before it.

// Height of the surface above or below a point of the near plane, far below everything where there is none.
float surface_height(vec2 p)
{
  ivec2 last = textureSize(surface_heights, 0) - 1;
  vec2 at = clamp((p - near_plane.map.xy) * near_plane.map.zw - 0.5, vec2(0.0), vec2(last));
  ivec2 low = min(ivec2(at), last - 1);
  vec2 part = at - vec2(low);
  float lower = mix(texelFetch(surface_heights, low, 0).r, texelFetch(surface_heights, low + ivec2(1, 0), 0).r, part.x);
  float upper =
      mix(texelFetch(surface_heights, low + ivec2(0, 1), 0).r, texelFetch(surface_heights, low + 1, 0).r, part.x);
  return mix(lower, upper, part.y);
}

// Of the pixel's point of the near plane over the surface: below 0, the pixel is under water.
float height_over_surface(vec2 ndc)
{
  vec3 begin = near_plane.origin.xyz + near_offset(ndc);
  return begin.z - surface_height(begin.xy);
}
