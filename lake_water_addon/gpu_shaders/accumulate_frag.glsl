// SPDX-License-Identifier: GPL-3.0-or-later
// Adds one antialiasing sample to the mean.

void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy);
  out_color = texelFetch(picture, at, 0) * weight;
}
