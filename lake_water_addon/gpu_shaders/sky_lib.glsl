// SPDX-License-Identifier: GPL-3.0-or-later
// The world's light. Twin: core/sky.py.

// Texture coordinates of a unit world direction in Blender's equirectangular images.
vec2 equirectangular(vec3 direction, float rotation)
{
  float azimuth = -atan(direction.y, direction.x) + rotation;
  return vec2(azimuth / 6.283185307179586 + 0.5, asin(clamp(direction.z, -1.0, 1.0)) / 3.141592653589793 + 0.5);
}

// Level 0 is asked for: the seam's derivative would pick the smallest level there. The poles stay
// half a texel away from the edge: the image repeats, and the zenith would mix with the ground.
vec3 sky_radiance(vec3 direction)
{
  if (lights.sky.w < 0.5) {
    return lights.sky.rgb;
  }
  vec2 uv = equirectangular(direction, lights.sky_image.y);
  float half_texel = 0.5 / float(textureSize(sky_image, 0).y);
  uv.y = clamp(uv.y, half_texel, 1.0 - half_texel);
  return textureLod(sky_image, uv, 0.0).rgb * lights.sky_image.x;
}

// Irradiance / pi on a surface with this normal, from spherical harmonics.
vec3 sky_irradiance(vec3 n)
{
  vec3 sum = lights.irradiance_sh[0].rgb * 0.282095;
  sum += lights.irradiance_sh[1].rgb * (0.488603 * n.y);
  sum += lights.irradiance_sh[2].rgb * (0.488603 * n.z);
  sum += lights.irradiance_sh[3].rgb * (0.488603 * n.x);
  sum += lights.irradiance_sh[4].rgb * (1.092548 * n.x * n.y);
  sum += lights.irradiance_sh[5].rgb * (1.092548 * n.y * n.z);
  sum += lights.irradiance_sh[6].rgb * (0.315392 * (3.0 * n.z * n.z - 1.0));
  sum += lights.irradiance_sh[7].rgb * (1.092548 * n.x * n.z);
  sum += lights.irradiance_sh[8].rgb * (0.546274 * (n.x * n.x - n.y * n.y));
  return max(sum, vec3(0.0));
}
