// SPDX-License-Identifier: GPL-3.0-or-later
// The water surface as a sum of sine waves. Twin: core/waves.py.
// A wave is (kx, ky, amplitude, phase); p is relative to the water body's origin, in metres.

float wave_height(vec2 p)
{
  float h = 0.0;
  int count = int(water.plane.w);
  for (int i = 0; i < count; i++) {
    vec4 wave = water.waves[i];
    h += wave.z * sin(dot(wave.xy, p) + wave.w);
  }
  return h;
}

vec2 wave_slope(vec2 p)
{
  vec2 slope = vec2(0.0);
  int count = int(water.plane.w);
  for (int i = 0; i < count; i++) {
    vec4 wave = water.waves[i];
    slope += wave.xy * (wave.z * cos(dot(wave.xy, p) + wave.w));
  }
  return slope;
}
