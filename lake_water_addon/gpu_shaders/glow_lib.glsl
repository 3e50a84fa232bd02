// SPDX-License-Identifier: GPL-3.0-or-later
// The sun's mirror image. Twin: core/glow.py.

// Of the two unit vectors' directions; 0 where it is less than `cut`. pow(0, 0) is undefined in GLSL.
float highlight(vec3 reflected, vec3 sun, float exponent, float cut)
{
  float lobe = pow(clamp(dot(reflected, sun), 1e-30, 1.0), exponent);
  return lobe < cut ? 0.0 : lobe;
}
