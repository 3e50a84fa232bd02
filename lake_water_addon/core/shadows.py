# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows from the depth texture of a light camera: the float64 twin of `gpu_shaders/shadow_lib.glsl`.

Each of the 3x3 texels around a point says whether something lies nearer to the light than the point's
own face, continued to that texel's middle: so a face does not shade itself, whatever its slope, and its
shadows begin at its foot. Their answers are weighted with a quadratic B-spline, which makes edges smooth
over two texels. For what is not flat, the point is moved a little along its face's normal before. That
has to be the face's own: one that is smoothed, or turned up as those of grass are, has another slope.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import cameras
from .light import LightCamera

SHADOW_BIAS = 1e-3
"""m: nothing is shaded by what is nearer than this in front of it."""

NORMAL_OFFSET = 0.5
"""Texels: how far along its normal a point is moved, for light that grazes its face."""

LEAST_FACING = 0.05
"""Least cosine between a face's normal and the light for which its slope is still taken as it is."""

FILTER_REACH = 1.5
"""Texels: how far from a place the filter reads."""

WINDOW_BLEND = 1.0 / 16.0
"""Width, as a part of a window, over which it gives way to the next, so that no line shows between them."""

LEAST_BLEND = 1e-3
"""Texels: the same of a window that is the last."""


def spline_weights(offset: np.ndarray) -> np.ndarray:
    """(..., 3) weights of three texels for a point that lies `offset` texels, -1/2 to 1/2, beyond the middle
    of the second."""
    offset = np.asarray(offset, dtype=np.float64)
    return np.stack([0.5 * (0.5 - offset) ** 2, 0.75 - offset**2, 0.5 * (0.5 + offset) ** 2], axis=-1)


def normal_offset(normal: np.ndarray, to_light: np.ndarray, texel: float) -> np.ndarray:
    """(...,) m by which points with unit normals (..., 3) are moved along them, in proportion to the sine.

    Negative where the normal points away from the light: both sides of a leaf are lit by what reaches it.
    """
    cosine = np.clip(np.sum(normal * to_light, axis=-1), -1.0, 1.0)
    clearance = NORMAL_OFFSET * texel * np.sqrt(1.0 - cosine * cosine) + SHADOW_BIAS
    return np.where(cosine < 0.0, -clearance, clearance)


def face_slope(normal: np.ndarray, projection: np.ndarray, size: int) -> np.ndarray:
    """(n, 2) m along the light for each texel across it; faces have normals (n, 3) in the camera's space."""
    z = normal[:, 2:]
    facing = np.where(z < 0.0, np.minimum(z, -LEAST_FACING), np.maximum(z, LEAST_FACING))
    return 2.0 * normal[:, :2] / (facing * size * projection[(0, 1), (0, 1)])


def in_window(projection: np.ndarray, size: int, at: np.ndarray) -> np.ndarray:
    """Where points (n, 3) in a light camera's space lie in its window, (n, 2) in texels."""
    return cameras.to_texture(projection, at) * size


def window_weight(size: int, texel: np.ndarray, blend: float) -> np.ndarray:
    """(n,) what a window counts at places (n, 2), in texels, in it.

    Nothing within the filter's reach of its border, and all of it from `blend` texels further in.
    """
    inside = np.minimum(texel, size - texel).min(axis=1) - FILTER_REACH
    return np.clip(inside / blend, 0.0, 1.0)


def lit_part(depth: np.ndarray, texel: np.ndarray, along: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """(n,) part of the 3x3 texels around places (n, 2), in texels, that have nothing in front of a face.

    along: (n,) m along the light to the face at the place; slope: (n, 2) as of `face_slope`. depth: (h, w)
    distances along the light in m, first row at the bottom.
    """
    nearest = np.floor(texel)
    offset = texel - nearest - 0.5
    weights = spline_weights(offset)
    column, row = nearest.astype(int).T
    lit = np.zeros(len(texel))
    for y in range(3):
        for x in range(3):
            face = along + np.sum(slope * (np.array([x, y]) - 1.0 - offset), axis=1)
            clear = depth[row + y - 1, column + x - 1] >= face
            lit += np.where(clear, weights[:, 0, x] * weights[:, 1, y], 0.0)
    return lit


def visibility(
    position: np.ndarray, normal: np.ndarray, windows: Sequence[LightCamera], depths: Sequence[np.ndarray]
) -> np.ndarray:
    """(n,) part of the light that reaches points (n, 3) of faces with unit normals (n, 3), either of the two.

    windows: cameras along one light; the first that has a point decides, and over a band along its border
    the next, too. depths: their textures, as for `lit_part`. Outside of all, everything is lit.
    """
    lit = np.zeros(len(position))
    unknown = np.ones(len(position))
    for i, (camera, depth) in enumerate(zip(windows, depths, strict=True)):
        size = camera.resolution
        moved = position + normal_offset(normal, -camera.direction, camera.texel.max())[:, None] * normal
        at = moved @ camera.view[:3, :3].T + camera.view[:3, 3]
        texel = in_window(camera.projection, size, at)
        blend = WINDOW_BLEND * size if i < len(windows) - 1 else LEAST_BLEND
        weight = unknown * window_weight(size, texel, blend)
        inside = weight > 0.0
        slope = face_slope(normal @ camera.view[:3, :3].T, camera.projection, size)
        lit[inside] += weight[inside] * lit_part(depth, texel[inside], -at[inside, 2], slope[inside])
        unknown -= weight
    return lit + unknown
