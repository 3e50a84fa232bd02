// SPDX-License-Identifier: GPL-3.0-or-later
// Rays followed through depth textures. Twin: core/depth_trace.py, which explains it.
// The includer defines: BISECTION_STEPS; THICKNESS, m.

#include "lookup_lib.glsl"

#define DEPTH_JUMP 16.0
#define CLOSES_IN 0.7
#define FARTHEST 5e4
#define HIDDEN_LAND 0.4
#define HIDDEN_BOTTOM 1.0
#define LEAST_DESCENT 0.05
#define BELOW_LOWEST 0.1

// A ray in the space of a texture's camera, and the straight line that it is in the texture.
struct TextureRay {
  vec3 origin;
  vec3 direction;
  float end; // m along the ray
  vec2 from; // texture coordinates of the origin
  vec2 to;   // of the end
  float w;   // clip w of the origin
  float dw;  // its change for each m
  float texel_width; // m, at clip w 1
};

// What a ray meets.
struct Trace {
  vec2 uv;
  float way;   // m along the ray
  float known; // 1 when there is anything
};

// As far as its end m away, or to where it leaves the texture.
TextureRay texture_ray(vec3 origin, vec3 direction, mat4 projection, float end, float size)
{
  vec4 start = projection * vec4(origin, 1.0);
  vec4 change = projection * vec4(direction, 0.0);
  // Distances from the texture's four borders, times w.
  vec4 inside = vec4(start.w + start.xy, start.w - start.xy);
  vec4 inwards = vec4(change.w + change.xy, change.w - change.xy);
  for (int i = 0; i < 4; i++) {
    if (inwards[i] < 0.0) {
      end = min(end, max(inside[i], 0.0) / -inwards[i]);
    }
  }
  if (change.w < 0.0) {
    end = min(end, 0.999 * start.w / -change.w);
  }
  vec2 from = to_texture(projection, origin);
  vec2 to = to_texture(projection, origin + end * direction);
  float texel_width = 2.0 / (min(projection[0][0], projection[1][1]) * size);
  return TextureRay(origin, direction, end, from, to, start.w, change.w, texel_width);
}

// m along the ray at a part of its way across the texture: 1 / w is linear there.
float way_at(TextureRay ray, float part)
{
  return part * ray.w * ray.end / (ray.w + (1.0 - part) * ray.dw * ray.end);
}

// m that a texel measures where the ray then is.
float texel_at(TextureRay ray, float way)
{
  return ray.texel_width * (ray.w + way * ray.dw);
}

// Bilinear, but for edges, across which `jump` m or more lie: there it is the nearest texel's.
float depth_between(sampler2D map, vec2 uv, float jump)
{
  ivec2 size = textureSize(map, 0);
  vec2 at = clamp(uv, 0.0, 1.0) * vec2(size) - 0.5;
  ivec2 low = clamp(ivec2(floor(at)), ivec2(0), size - 2);
  vec2 part = clamp(at - vec2(low), 0.0, 1.0);
  float a = texelFetch(map, low, 0).r;
  float b = texelFetch(map, low + ivec2(1, 0), 0).r;
  float c = texelFetch(map, low + ivec2(0, 1), 0).r;
  float d = texelFetch(map, low + ivec2(1, 1), 0).r;
  if (max(max(a, b), max(c, d)) - min(min(a, b), min(c, d)) > jump) {
    part = floor(part + 0.5);
  }
  return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}

// m that the ray is behind what the texture shows; negative before it.
float behind(sampler2D map, TextureRay ray, float part)
{
  float way = way_at(ray, part);
  float depth = depth_between(map, mix(ray.from, ray.to, part), DEPTH_JUMP * texel_at(ray, way));
  return -(ray.origin.z + way * ray.direction.z) - depth;
}

// hidden: how far behind what hides it a ray may meet something, as a part of its own depth.
Trace trace(sampler2D map, TextureRay ray, float size, float hidden, int most_steps)
{
  int steps = int(clamp(ceil(distance(ray.from, ray.to) * size), 1.0, float(most_steps)));
  float before = min(behind(map, ray, 0.0), 0.0);
  float least = 1e30;
  float found = 1.0;
  for (int i = 1; i <= steps; i++) {
    float low = float(i - 1) / float(steps);
    float high = float(i) / float(steps);
    float now = behind(map, ray, high);
    float after = now;
    if (now > 0.0) {
      float part = high;
      if (before <= 0.0) {
        float ahead = before;
        for (int j = 0; j < BISECTION_STEPS; j++) {
          float middle = 0.5 * (low + high);
          float there = behind(map, ray, middle);
          if (there > 0.0) {
            high = middle;
            after = there;
          }
          else {
            low = middle;
            ahead = there;
          }
        }
        part = low + (high - low) * ahead / (ahead - after);
      }
      float way = way_at(ray, part);
      if (after <= THICKNESS + 2.0 * texel_at(ray, way)) {
        return Trace(mix(ray.from, ray.to, part), way, 1.0);
      }
      float farthest_hidden = -hidden * (ray.origin.z + way * ray.direction.z);
      if (before > THICKNESS && now < CLOSES_IN * before && now < farthest_hidden) {
        return Trace(mix(ray.from, ray.to, high), way, 1.0);
      }
      if (now < least) {
        least = now;
        found = float(i) / float(steps);
      }
    }
    before = now;
  }
  // Behind something to the end: the place where it is least.
  if (before > 0.0) {
    float way = way_at(ray, found);
    if (least < -hidden * (ray.origin.z + way * ray.direction.z)) {
      return Trace(mix(ray.from, ray.to, found), way, 1.0);
    }
  }
  return Trace(ray.to, ray.end, 0.0);
}

// A ray from the surface to what is above the water.
Trace trace_upwards(sampler2D depths, mat4 view, mat4 projection, vec3 surface, vec3 direction, int most_steps)
{
  vec3 origin = transform_point(view, surface);
  vec3 along = transform_direction(view, direction);
  float size = water.fresnel.w;
  TextureRay ray = texture_ray(origin, along, projection, FARTHEST, size);
  return trace(depths, ray, size, HIDDEN_LAND, most_steps);
}

// A ray from the surface to what is in the water.
Trace trace_downwards(sampler2D depths, mat4 view, mat4 projection, vec3 surface, vec3 direction, int most_steps)
{
  float end = (max(surface.z - water.grid_axis.z, 0.0) + BELOW_LOWEST) / max(-direction.z, LEAST_DESCENT);
  vec3 origin = transform_point(view, surface);
  vec3 along = transform_direction(view, direction);
  float size = water.fresnel.w;
  TextureRay ray = texture_ray(origin, along, projection, end, size);
  return trace(depths, ray, size, HIDDEN_BOTTOM, most_steps);
}

// rgb: radiance of what a ray met, of a premultiplied texture; a: how far it is known.
vec4 color_and_known(sampler2D colors, Trace found)
{
  vec4 color = known_color(texture(colors, found.uv), found.uv);
  return vec4(color.rgb, found.known * color.a);
}

// What the hits pass is told of it.
vec4 hit_of(Trace found, float known, vec3 surface, vec3 direction)
{
  return vec4(surface + found.way * direction, 1.0) * step(0.5, known);
}
