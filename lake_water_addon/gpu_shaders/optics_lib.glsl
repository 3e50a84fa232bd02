// SPDX-License-Identifier: GPL-3.0-or-later
// Refraction, reflection, Fresnel and attenuation. Twin: core/optics.py.

#define MIN_COSINE 1e-3
#define MIN_RISE 1e-3

// The normal, turned just as far towards the eye as makes E.N at least MIN_COSINE.
vec3 face_viewer(vec3 normal, vec3 to_eye)
{
  float cosine = dot(to_eye, normal);
  return normalize(normal + max(MIN_COSINE - cosine, 0.0) * to_eye);
}

// Equation (2); zero where there is total internal reflection.
vec3 refract_direction(vec3 incident, vec3 normal, float n12)
{
  float cosine = dot(normal, incident);
  float s = 1.0 - n12 * n12 * (1.0 - cosine * cosine);
  if (s < 0.0) {
    return vec3(0.0);
  }
  return n12 * incident - (n12 * cosine + sqrt(s)) * normal;
}

vec3 reflect_direction(vec3 incident, vec3 normal)
{
  return incident - 2.0 * dot(normal, incident) * normal;
}

// A ray reflected downwards meets the water again; the second reflection, on the flat
// surface, turns its z around.
vec3 reflect_upwards(vec3 incident, vec3 normal)
{
  vec3 r = reflect_direction(incident, normal);
  r.z = max(abs(r.z), MIN_RISE);
  return normalize(r);
}

// pow(0, 0) is undefined in GLSL, and q may be 0: the base stays just above it.
float schlick(float cosine, float f, float q)
{
  return f + (1.0 - f) * pow(max(1.0 - clamp(cosine, 0.0, 1.0), 1e-30), q);
}

// Fresnel's equations for unpolarised light; n12: index on the side that the light comes from over the other.
float fresnel_dielectric(float cosine, float n12)
{
  cosine = clamp(cosine, 0.0, 1.0);
  // 1 - n12^2 (1 - cosine^2) without its cancellation at n12 = 1.
  float s = (1.0 - n12) * (1.0 + n12) + n12 * n12 * cosine * cosine;
  if (s <= 0.0) {
    return 1.0;
  }
  float beyond = sqrt(s);
  float s_polarised = (n12 * cosine - beyond) / (n12 * cosine + beyond);
  float p_polarised = (n12 * beyond - cosine) / (n12 * beyond + cosine);
  return 0.5 * (s_polarised * s_polarised + p_polarised * p_polarised);
}

float attenuation(float k, float distance_in_water)
{
  return exp(-k * distance_in_water);
}

vec3 through_water(vec3 color, vec3 water_color, float a)
{
  return water_color + a * (color - water_color);
}

// Equation (9).
vec3 mix_fresnel(vec3 refracted, vec3 reflected, float fresnel)
{
  return refracted + fresnel * (reflected - refracted);
}
