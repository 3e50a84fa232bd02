# SPDX-License-Identifier: GPL-3.0-or-later
"""The water surface as a sum of sine waves: the float64 twin of `gpu_shaders/waves_lib.glsl`.

The surface is a height field over the water frame (see `snapshot.WaterBody`):

    h(x, y, t) = sum_i a_i sin(kx_i x + ky_i y - omega_i t + phase_i)

with the dispersion relation of gravity waves over a bottom at depth D,
omega^2 = g |k| tanh(|k| D) (Airy's linear theory). It is a pure function of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81  # m/s^2

MAX_WAVES = 32
"""Waves that a surface can have: the length of the array in `gpu_shaders/uniforms_lib.glsl`."""


@dataclass(frozen=True)
class SineWave:
    """One component. amplitude, wavelength: m; direction: from the water frame's +X, and phase: radians."""

    amplitude: float
    wavelength: float
    direction: float = 0.0
    phase: float = 0.0

    @property
    def wave_vector(self) -> tuple[float, float]:
        """(kx, ky) in rad/m."""
        k = 2.0 * np.pi / self.wavelength
        return float(k * np.cos(self.direction)), float(k * np.sin(self.direction))


def angular_frequency(wave_number: float, depth: float) -> float:
    """omega in rad/s from the wave number k in rad/m and the depth in m: sqrt(g k tanh(k depth))."""
    return float(np.sqrt(GRAVITY * wave_number * np.tanh(wave_number * depth)))


def phase_at(wave: SineWave, time: float, depth: float) -> float:
    """The wave's phase at the water frame's origin, reduced to [0, 2 pi) in float64.

    Reduced here because sin() of a large float32 argument loses every digit after hours of scene time.
    """
    omega = angular_frequency(2.0 * np.pi / wave.wavelength, depth)
    return float(np.mod(wave.phase - omega * time, 2.0 * np.pi))


def pack(waves: Sequence[SineWave], time: float, depth: float, heading: float = 0.0) -> np.ndarray:
    """(n, 4) float64 rows (kx, ky, amplitude, phase) at `time`: what the shader sums.

    The wave vectors are turned by `heading`, so that they act on world x, y relative to the body's origin.
    """
    rows = np.empty((len(waves), 4))
    cos_h, sin_h = np.cos(heading), np.sin(heading)
    for i, wave in enumerate(waves):
        kx, ky = wave.wave_vector
        rows[i] = (
            cos_h * kx - sin_h * ky,
            sin_h * kx + cos_h * ky,
            wave.amplitude,
            phase_at(wave, time, depth),
        )
    return rows


def height(packed: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Height in m over the water plane at points xy (..., 2), from `pack`'s rows."""
    xy = np.asarray(xy, dtype=np.float64)
    angle = xy @ packed[:, :2].T + packed[:, 3]
    return np.sin(angle) @ packed[:, 2]


def slope(packed: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(dh/dx, dh/dy) at points xy (..., 2)."""
    xy = np.asarray(xy, dtype=np.float64)
    angle = xy @ packed[:, :2].T + packed[:, 3]
    return (np.cos(angle) * packed[:, 2]) @ packed[:, :2]


def normal(packed: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Unit normals (..., 3), pointing from the water to the air."""
    gradient = slope(packed, xy)
    n = np.concatenate([-gradient, np.ones((*gradient.shape[:-1], 1))], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def max_height(waves: Sequence[SineWave]) -> float:
    """An upper bound of |h|: the sum of the amplitudes, in m."""
    return float(sum(abs(w.amplitude) for w in waves))


def met_slope(packed: np.ndarray) -> float:
    """The mean slope, towards it, of the waves that a ray meets which skims them: sqrt(pi / 2) s.

    s: the standard deviation of the slopes, taken as normal and as all along the ray; each counts by the area
    that it turns to the ray.
    """
    variance = 0.5 * float(np.sum(packed[:, 2] ** 2 * np.sum(packed[:, :2] ** 2, axis=1)))
    return float(np.sqrt(0.5 * np.pi * variance))


def max_slope(packed: np.ndarray) -> float:
    """The least upper bound of |grad h| that holds at any time, from `pack`'s rows.

    Whatever their phases, the waves add vectors +-a k at most: the farthest corner of a zonotope. Its
    corners are the sums over those of the vectors that point to one side of a line.
    """
    steps = packed[:, :2] * packed[:, 2:3]
    # Directions across each vector, a little turned to both sides: each corner's signs are among them.
    across = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
    corners = [
        np.where((across + turn * steps) @ steps.T >= 0.0, 1.0, -1.0) @ steps for turn in (-1e-9, 1e-9)
    ]
    return float(np.linalg.norm(np.concatenate(corners), axis=1).max(initial=0.0))
