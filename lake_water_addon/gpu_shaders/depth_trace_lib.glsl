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
#define BEYOND 0.1

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
  vec4 z = textureGather(map, vec2(low + 1) / vec2(size));
  if (max(max(z.x, z.y), max(z.z, z.w)) - min(min(z.x, z.y), min(z.z, z.w)) > jump) {
    part = floor(part + 0.5);
  }
  vec2 row = mix(z.wx, z.zy, part.x);
  return mix(row.x, row.y, part.y);
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
  float now = 0.0;
  float low = 0.0;
  float high = 0.0;
  float ahead = 0.0;
  float after = 0.0;
  float least = 1e30;
  float found = 1.0;
  int step = 0;
  int halvings = 0; // that the last step still has to go through
  // One lookup each time, be it a step or a halving: rays beside each other, which graphics cards follow together, do
  // not wait for one another.
  for (int lookups = 0; lookups < steps * (1 + BISECTION_STEPS); lookups++) {
    bool halves = halvings > 0;
    step += halves ? 0 : 1;
    float place = halves ? 0.5 * (low + high) : float(step) / float(steps);
    float there = behind(map, ray, place);
    if (!halves) {
      low = float(step - 1) / float(steps);
      now = there;
      ahead = before;
      halvings = now > 0.0 && before <= 0.0 ? BISECTION_STEPS + 1 : 1;
    }
    halvings--;
    if (there > 0.0 || !halves) {
      high = place;
      after = there;
    }
    else {
      low = place;
      ahead = there;
    }
    if (halvings > 0) {
      continue;
    }
    if (now > 0.0) {
      float part = before <= 0.0 ? low + (high - low) * ahead / (ahead - after) : high;
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
        found = float(step) / float(steps);
      }
    }
    before = now;
    if (step == steps) {
      break;
    }
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
  float rise = max(water.rays.w - surface.z, 0.0) + BEYOND;
  float end = min(rise / max(direction.z, rise / FARTHEST), FARTHEST);
  TextureRay ray = texture_ray(origin, along, projection, end, size);
  return trace(depths, ray, size, HIDDEN_LAND, most_steps);
}

// A ray from the surface to what is in the water.
Trace trace_downwards(sampler2D depths, mat4 view, mat4 projection, vec3 surface, vec3 direction, int most_steps)
{
  float end = (max(surface.z - water.rays.z, 0.0) + BEYOND) / max(-direction.z, LEAST_DESCENT);
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
