# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows from the depth texture of a light camera: the float64 twin of `gpu_shaders/shadow_lib.glsl`.

A point is lit where the nearest thing on the light's way lies no nearer than the point itself. The
answers of 3x3 texels are weighted with a quadratic B-spline, which makes edges smooth over three
texels. Before that the point is moved along its normal, just so far that a flat surface does not
shade itself within those texels, whatever its slope.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import cameras
from .light import LightCamera

SHADOW_BIAS = 1e-3
"""m: nothing is shaded by what is nearer than this in front of it."""


def spline_weights(offset: np.ndarray) -> np.ndarray:
    """(..., 3) weights of three texels for a point that lies `offset` texels, -1/2 to 1/2, beyond the middle
    of the second."""
    offset = np.asarray(offset, dtype=np.float64)
    return np.stack([0.5 * (0.5 - offset) ** 2, 0.75 - offset**2, 0.5 * (0.5 + offset) ** 2], axis=-1)


def normal_offset(normal: np.ndarray, to_light: np.ndarray, texel: float) -> np.ndarray:
    """(...,) m by which points with unit normals (..., 3) are moved along them: 2 texels times the sine.

    Over the filter's 1.5 texels, a plane at an angle to the light is 1.5 texels times its tangent deep;
    moved along its normal by as many texels times the sine, it clears that.
    """
    cosine = np.clip(np.sum(normal * to_light, axis=-1), 0.0, 1.0)
    return 2.0 * texel * np.sqrt(1.0 - cosine * cosine) + SHADOW_BIAS


def in_window(projection: np.ndarray, size: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where points (n, 3) in a light camera's space lie in its window, (n, 2) in texels, and whether the
    filter around them is within it (n,)."""
    texel = cameras.to_texture(projection, at) * size
    return texel, np.all((texel >= 1.5) & (texel <= size - 1.5), axis=1)


def lit_part(depth: np.ndarray, texel: np.ndarray, along: np.ndarray) -> np.ndarray:
    """(n,) part of the 3x3 texels around places (n, 2), in texels, with nothing nearer than `along` (n,) m.

    depth: (h, w) distances along the light in m, first row at the bottom.
    """
    nearest = np.floor(texel)
    weights = spline_weights(texel - nearest - 0.5)
    column, row = nearest.astype(int).T
    lit = np.zeros(len(texel))
    for y in range(3):
        for x in range(3):
            clear = depth[row + y - 1, column + x - 1] >= along
            lit += np.where(clear, weights[:, 0, x] * weights[:, 1, y], 0.0)
    return lit


def visibility(
    position: np.ndarray, normal: np.ndarray, windows: Sequence[LightCamera], depths: Sequence[np.ndarray]
) -> np.ndarray:
    """(n,) part of the light that reaches points (n, 3) with unit normals (n, 3).

    windows: cameras along one light; the first that has a point decides. depths: their textures, as for
    `lit_part`. Outside of all, everything is lit.
    """
    lit = np.ones(len(position))
    open_points = np.ones(len(position), bool)
    for camera, depth in zip(windows, depths, strict=True):
        moved = position + normal_offset(normal, -camera.direction, camera.texel.max())[:, None] * normal
        at = moved @ camera.view[:3, :3].T + camera.view[:3, 3]
        texel, inside = in_window(camera.projection, camera.resolution, at)
        inside &= open_points
        lit[inside] = lit_part(depth, texel[inside], -at[inside, 2])
        open_points &= ~inside
    return lit
