// SPDX-License-Identifier: GPL-3.0-or-later
// The water surface as a sum of sine waves. Twin: core/waves.py.
// A wave is (kx, ky, amplitude, phase); p is relative to the water body's origin, in metres.

// Sine and cosine of an angle, to 4e-7 and what the angle itself lost. Surfaces and photons spend much of their time on
// them, and software OpenGL ten times this in its own. Both are sin(2 pi u) with u in -1/4 to 1/4: minimax, degree 9.
vec2 sine_cosine(float angle)
{
  float turns = angle * 0.15915494309189535;
  vec2 u = vec2(turns - 0.25, turns);
  u = 0.25 - abs(u - floor(u + 0.5));
  vec2 s = u * u;
  return u * (6.28318516 + s * (-41.34165503 + s * (81.60100405 + s * (-76.54978177 + s * 39.53670193))));
}

// x, y: slope; z: height.
vec3 wave_slope_and_height(vec2 p)
{
  vec3 sum = vec3(0.0);
  int count = int(water.plane.w);
  for (int i = 0; i < count; i++) {
    vec4 wave = water.waves[i];
    vec2 turned = wave.z * sine_cosine(dot(wave.xy, p) + wave.w);
    sum += vec3(wave.xy * turned.y, turned.x);
  }
  return sum;
}

float wave_height(vec2 p)
{
  return wave_slope_and_height(p).z;
}
