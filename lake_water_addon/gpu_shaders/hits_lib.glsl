// SPDX-License-Identifier: GPL-3.0-or-later
// Where a technique looks, for the hits pass (render/passes/hits.py). Twin: core/hits.py.

#define HORIZON 5e4

// In render space; a: 1 where something is there, 0 where it is the sky, or water without a bottom.
vec4 refracted_hit = vec4(0.0);
vec4 reflected_hit = vec4(0.0);

// Of the last lookup: its coordinates, and how far its color is known.
vec3 looked_up = vec3(0.0);

// The point that a texture shows. depths: along the axis of its camera.
vec4 shown_point(sampler2D depths, mat4 view, mat4 projection, vec2 uv, float known)
{
  ivec2 size = textureSize(depths, 0);
  float depth = texelFetch(depths, min(ivec2(clamp(uv, 0.0, 1.0) * vec2(size)), size - 1), 0).r;
  if (known <= 0.5 || depth <= 0.0 || depth >= HORIZON) {
    return vec4(0.0);
  }
  vec2 ndc = 2.0 * uv - 1.0;
  vec2 scale = vec2(projection[0][0], projection[1][1]);
  vec2 at = is_orthographic(projection) ? ndc - projection[3].xy : depth * (ndc + projection[2].xy);
  return inverse(view) * vec4(at / scale, -depth, 1.0);
}
