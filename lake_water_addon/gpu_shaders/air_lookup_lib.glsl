// SPDX-License-Identifier: GPL-3.0-or-later
// What the techniques that look from the air share: lookups in the refraction and reflection textures.
// Twin: core/air_lookup.py.

#include "lookup_lib.glsl"

// Alpha of a refraction lookup below which another place is tried.
#define LEAST_KNOWN 0.25

float bottom_depth(vec2 uv)
{
  ivec2 size = textureSize(refraction_depth, 0);
  // Clamped before the conversion: integers overflow far outside the texture.
  return texelFetch(refraction_depth, min(ivec2(clamp(uv, 0.0, 1.0) * vec2(size)), size - 1), 0).r;
}

#include "intersection_lib.glsl"

// A of a ray that is not bent, in the refraction camera's space, as u.
vec3 straight_bottom(vec3 u)
{
  mat4 projection = water.refraction_projection;
  return bottom_through(u, -bottom_depth(to_texture(projection, u)), is_orthographic(projection));
}

// What the texture shows at uv, through `path` m of water, to the point u of the surface.
vec3 radiance_through_water(vec3 u, vec2 uv, float path)
{
  vec4 texel = texture(refraction_color, uv);
  if (texel.a < LEAST_KNOWN) {
    // Nothing was drawn there, such as the dry part of a post: look straight through the surface.
    uv = to_texture(water.refraction_projection, u);
    texel = texture(refraction_color, uv);
    path = distance(straight_bottom(u), u);
  }
  vec4 color = known_color(texel, uv);
#ifdef HITS
  refracted_hit = shown_point(refraction_depth, water.refraction_view, water.refraction_projection, uv, color.a);
#endif
  float a = attenuation(water.optics.x, path);
  return through_water(color.rgb, water.color.rgb, color.a * a);
}

// A point in the mirrored camera's space, raised to its horizon: among the waves, a ray from a trough below
// it would be looked up in the sky's nadir.
vec3 over_horizon(vec3 point)
{
  vec3 up = water.reflection_view[2].xyz;
  bool orthographic = is_orthographic(water.reflection_projection);
  return orthographic ? point : point + max(MIN_RISE * length(point) - dot(up, point), 0.0) * up;
}

vec3 reflected_radiance(vec3 surface, vec3 direction)
{
  // Mirroring U + c R is one with the view of the reflection camera. A lookup that lands in the
  // inside of something that crosses the water line is drawn back along the ray towards U.
  float reach = water.optics.z;
  vec4 texel = vec4(0.0);
  vec2 uv = vec2(0.0);
  for (int i = 0; i < 4; i++) {
    vec3 w = transform_point(water.reflection_view, surface + reach * direction);
    uv = to_texture(water.reflection_projection, over_horizon(w));
    texel = texture(reflection_color, uv);
    if (texel.a > 0.5) {
      break;
    }
    reach = i < 2 ? 0.5 * reach : 0.0;
  }
  vec4 color = known_color(texel, uv);
#ifdef HITS
  reflected_hit = shown_point(reflection_depth, water.reflection_view, water.reflection_projection, uv, color.a);
#endif
  return color.a < 1.0 ? mix(sky_radiance(direction), color.rgb, color.a) : color.rgb;
}
