// SPDX-License-Identifier: GPL-3.0-or-later
// A picture times a weight: one antialiasing sample's part of the mean, or the mean shown.

void main()
{
  vec2 size = vec2(textureSize(picture, 0));
  ivec2 at = ivec2((0.5 * v_ndc + 0.5) * size);
  out_color = texelFetch(picture, at, 0) * weight;
}
