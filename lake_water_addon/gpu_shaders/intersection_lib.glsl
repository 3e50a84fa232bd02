// SPDX-License-Identifier: GPL-3.0-or-later
// The thesis's intersection algorithm. Twin: core/intersection.py, which explains it.
// The includer defines: float bottom_depth(vec2 uv), the distance of the bottom along the viewing
// axis of the camera that drew the depth texture.

#define PARALLEL 1e-10
#define BETWEEN_TOLERANCE 1.1

struct Intersection {
  vec3 hit;    // W
  vec3 bottom; // A
  float error; // |A - W|
};

vec3 bottom_through(vec3 point, float z, bool orthographic)
{
  return orthographic ? vec3(point.xy, z) : point * (z / min(point.z, -1e-6));
}

// Each step leads to one more place, and the last one is looked at, too.
Intersection intersect(vec3 surface, vec3 direction, mat4 projection, int steps)
{
  bool orthographic = is_orthographic(projection);
  Intersection best = Intersection(surface, surface, 1e30);
  vec3 w = surface;
  vec3 a = surface;
  for (int i = 0; i <= steps; i++) {
    vec3 a_next = bottom_through(w, -bottom_depth(to_texture(projection, w)), orthographic);
    float gap = distance(a_next, w);
    if (gap < best.error) {
      best = Intersection(w, a_next, gap);
    }
    if (i == steps) {
      break;
    }
    vec3 q = a_next - a;
    vec3 rq = cross(direction, q);
    float rq2 = dot(rq, rq);
    float q2 = dot(q, q);
    bool step_along = i == 0 || rq2 <= PARALLEL * q2;
    vec3 w_next = w;
    if (!step_along) {
      // Equation (3).
      w_next = surface + (dot(cross(a - surface, q), rq) / rq2) * direction;
      step_along = distance(w_next, a) + distance(a_next, w_next) > BETWEEN_TOLERANCE * sqrt(q2);
    }
    if (step_along) {
      w_next = w + (w.z < a_next.z ? -gap : gap) * direction;
    }
    w = w_next;
    a = a_next;
  }
  return best;
}
