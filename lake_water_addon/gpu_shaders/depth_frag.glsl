// SPDX-License-Identifier: GPL-3.0-or-later
// Distance along the viewing axis and nothing else.

void main()
{
#ifdef TEXTURED
  if (texture(base_image, v_uv).a < base_color.a) {
    discard;
  }
#endif
  out_depth = v_depth;
}
