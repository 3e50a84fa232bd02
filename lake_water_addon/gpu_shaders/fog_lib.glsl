// SPDX-License-Identifier: GPL-3.0-or-later
// A picture that begins under water: its fog, and the side of the surface on which each pixel begins.
// Twin: core/under_water.py. The includer has the block `near_plane`.

// From the eye to the pixel's point of the near plane.
vec3 near_offset(vec2 ndc)
{
  return near_plane.center.xyz + ndc.x * near_plane.right.xyz + ndc.y * near_plane.up.xyz;
}

// m from the eye to what a depth texture holds: the projection's inverse, without cancellation at any clip range.
float sight_distance(vec2 ndc, float depth)
{
  if (near_plane.up.w > 0.5) {
    return max(near_plane.center.w + depth * near_plane.right.w, 0.0);
  }
  return length(near_offset(ndc)) / ((1.0 - depth) + depth * near_plane.right.w);
}

// 0 where nothing was drawn.
float fog_transmittance(float k, vec2 ndc, float depth)
{
  return depth < 1.0 ? attenuation(k, sight_distance(ndc, depth)) : 0.0;
}

// 1 on the line where the surface cuts the picture, 0 from width / 2 pixels on.
float meniscus_weight(float height, float per_pixel, float width)
{
  return smoothstep(0.0, 1.0, 2.0 - 4.0 * abs(height) / (max(per_pixel, 1e-12) * width));
}
