// SPDX-License-Identifier: GPL-3.0-or-later
// The surface's heights, seen from above.

void main()
{
  out_height = v_position.z;
}
