// SPDX-License-Identifier: GPL-3.0-or-later
// One triangle over the whole target, on the far plane.

void main()
{
  v_ndc = position;
  gl_Position = vec4(position, 1.0, 1.0);
}
