# SPDX-License-Identifier: GPL-3.0-or-later
"""Lookups in the pictures that the water sees: the float64 twin of `gpu_shaders/lookup_lib.glsl`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Lookup = Callable[[np.ndarray], np.ndarray]
"""A texture: coordinates (n, 2) -> what stands there."""


def inside_texture(uv: np.ndarray, fade: float) -> np.ndarray:
    """(n,) 1 inside the texture, falling to 0 over a band of width `fade` at its border (Hermite)."""
    edge = np.min(np.minimum(uv, 1.0 - uv), axis=-1)
    t = np.clip(edge / fade, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def known_color(texel: np.ndarray, uv: np.ndarray, fade: float) -> tuple[np.ndarray, np.ndarray]:
    """Of premultiplied texels (n, 4) at uv (n, 2): radiance (n, 3) without those that have no colour in the
    filter's mean, and (n, 1) how far it is known."""
    known = np.clip(4.0 * texel[:, 3], 0.0, 1.0) * inside_texture(uv, fade)
    return texel[:, :3] / np.maximum(texel[:, 3:], 1e-4), known[:, None]
