# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeded noise for the scene generator: gradient noise at points, and tileable 1/f images."""

from __future__ import annotations

import numpy as np

_BLOCK = 8192  # points


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """Hermite step from 0 at `low` to 1 at `high`; `low > high` gives the falling step."""
    t = np.clip((np.asarray(x) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


class GradientNoise:
    """Perlin's gradient noise in two and three dimensions, made from one seed.

    Values lie roughly in -1..1 with mean 0. The permutation repeats after 256 units.
    Source: K. Perlin, "Improving Noise", SIGGRAPH 2002 (quintic fade; random unit gradients instead of
    twelve fixed ones).
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 0x9E37])
        self._permutation = rng.permutation(256).astype(np.int32)
        angle = rng.uniform(0.0, 2.0 * np.pi, 256)
        solid = rng.normal(size=(3, 256))
        self._gradients = {
            2: np.stack([np.cos(angle), np.sin(angle)]),
            3: solid / np.linalg.norm(solid, axis=0),
        }

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Noise at (..., 2) or (..., 3) points: (...) float64."""
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, points.shape[-1])
        if len(flat) <= _BLOCK:
            return self._evaluate(points)
        # Block by block the intermediate arrays stay in the processor's cache.
        blocks = [self._evaluate(flat[i : i + _BLOCK]) for i in range(0, len(flat), _BLOCK)]
        return np.concatenate(blocks).reshape(points.shape[:-1])

    def _evaluate(self, points: np.ndarray) -> np.ndarray:
        dimensions = points.shape[-1]
        cells, offsets, fades = [], [], []
        for axis in range(dimensions):
            x = points[..., axis]
            floor = np.floor(x)
            f = x - floor
            cells.append(floor.astype(np.int32))
            offsets.append(f)
            fades.append(f * f * f * (f * (f * 6.0 - 15.0) + 10.0))
        p, table = self._permutation, self._gradients[dimensions]
        # Corner values, the last axis varying fastest, are interpolated one axis after the other.
        values = []
        for corner in range(1 << dimensions):
            bits = [(corner >> (dimensions - 1 - axis)) & 1 for axis in range(dimensions)]
            index = p[(cells[0] + bits[0]) & 255]
            for axis in range(1, dimensions):
                index = p[(index + cells[axis] + bits[axis]) & 255]
            value = table[0][index] * (offsets[0] - bits[0])
            for axis in range(1, dimensions):
                value = value + table[axis][index] * (offsets[axis] - bits[axis])
            values.append(value)
        for axis in range(dimensions - 1, -1, -1):
            w = fades[axis]
            values = [low + w * (high - low) for low, high in zip(values[::2], values[1::2], strict=True)]
        return values[0] * 1.6

    def fbm(self, points: np.ndarray, octaves: int = 4, gain: float = 0.5) -> np.ndarray:
        """Fractal sum: each octave has twice the frequency and `gain` times the amplitude."""
        points = np.asarray(points, dtype=np.float64)
        total = np.zeros(points.shape[:-1])
        amplitude, scale = 1.0, 1.0
        for octave in range(octaves):
            # The shift keeps the lattice zeros of the octaves from falling on one another.
            total += amplitude * self(points * scale + 17.31 * octave)
            amplitude *= gain
            scale *= 2.03
        return total

    def ridged(self, points: np.ndarray, octaves: int = 4) -> np.ndarray:
        """Ridged fractal in about 0..1: sharp crests, for hills."""
        points = np.asarray(points, dtype=np.float64)
        total = np.zeros(points.shape[:-1])
        amplitude, scale, norm = 1.0, 1.0, 0.0
        for octave in range(octaves):
            total += amplitude * (1.0 - np.abs(self(points * scale + 11.7 * octave)))
            norm += amplitude
            amplitude *= 0.5
            scale *= 2.07
        return total / norm


def tile_noise(
    size: int, rng: np.random.Generator, *, exponent: float, low: float, high: float
) -> np.ndarray:
    """A tileable (size, size) image of band-limited 1/f noise: mean 0, standard deviation 1, float32.

    low, high: the band in cycles per tile. Made by filtering white noise in the frequency domain.
    """
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)).astype(np.float32))
    fy = np.fft.fftfreq(size)[:, None] * size
    fx = np.fft.rfftfreq(size)[None, :] * size
    f = np.hypot(fx, fy)
    with np.errstate(divide="ignore"):
        gain = np.where((f >= low) & (f <= high), f**-exponent, 0.0)
    image = np.fft.irfft2(spectrum * gain, s=(size, size)).astype(np.float32)
    return image / max(float(image.std()), 1e-12)


def tile_cells(size: int, cells: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tileable cellular noise on a (size, size) image with cells x cells feature points.

    Returns (nearest distance, second-nearest distance, id in 0..1 of the nearest cell); distances in cells.
    Source: S. Worley, "A Cellular Texture Basis Function", SIGGRAPH 1996.
    """
    jitter = rng.uniform(0.1, 0.9, size=(cells, cells, 2)).astype(np.float32)
    ids = rng.uniform(size=(cells, cells)).astype(np.float32)
    axis = (np.arange(size, dtype=np.float32) + 0.5) * (cells / size)
    y, x = np.meshgrid(axis, axis, indexing="ij")
    cy, cx = y.astype(np.int32), x.astype(np.int32)
    first = np.full((size, size), 9.0, dtype=np.float32)
    second = first.copy()
    owner = np.zeros((size, size), dtype=np.float32)
    for oy in (-1, 0, 1):
        for ox in (-1, 0, 1):
            jy, jx = (cy + oy) % cells, (cx + ox) % cells
            j = jitter[jy, jx]
            d = np.hypot(x - (cx + ox + j[..., 0]), y - (cy + oy + j[..., 1]))
            nearer = d < first
            second = np.where(nearer, first, np.minimum(second, d))
            owner = np.where(nearer, ids[jy, jx], owner)
            first = np.where(nearer, d, first)
    return first, second, owner
