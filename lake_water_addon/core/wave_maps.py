# SPDX-License-Identifier: GPL-3.0-or-later
"""Tileable pictures of small waves: normal maps and dudv maps. Decoding: twin of `wave_maps_lib.glsl`.

A tile is the unit square, repeated. Its height is a sum of sines with whole numbers of waves along both
sides, so that it repeats exactly:

    h(x, y) = sum_i a_i sin(2 pi (m_i x + n_i y) + phase_i)

Arrays of texels are (size, size, ...), rows from the bottom (y = 0), texels at their centres, as in Blender.

A normal map holds 0.5 + 0.5 n, n the unit normal. A dudv map holds 0.5 + 0.5 d in red and green, d the
displacement of a lookup along x and y, -1 to 1, and 0 in blue: that tells the two apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

MapKind = Literal["NORMAL", "DUDV"]

STRENGTH: dict[MapKind, float] = {"NORMAL": 0.2, "DUDV": 0.25}
"""Root mean square slope of the maps made for a person; with it, no displacement of a dudv map is cut."""

MIN_Z = 1e-3
"""Least z of a decoded normal before it is made unit: grey has no direction at all."""


@dataclass(frozen=True)
class Spectrum:
    """Which sines a tile is made of.

    All whole wave vectors with lowest <= |k| <= highest (waves a tile), each once, of amplitude

        a(k) ~ |k|^-exponent |cos(angle of k - direction)|^spread.

    exponent 2 is the equilibrium range of wind waves (Phillips 1958, spectrum ~ k^-4), whose shortest waves
    look like noise in a mirror; more is smoother. spread: 0 sends waves everywhere, more along
    `direction` (radians from x) and back.
    """

    lowest: float = 5.0
    highest: float = 40.0
    exponent: float = 2.8
    direction: float = 0.0
    spread: float = 0.5


POND_RIPPLES = Spectrum()


def _hash(x: np.ndarray, y: np.ndarray, z: int) -> np.ndarray:
    """(n,) uint32 from integers: pcg3d of Jarzynski and Olano, "Hash Functions for GPU Rendering", 2020."""
    v = [np.asarray(a, dtype=np.int64).astype(np.uint32) for a in (x, y, np.full_like(x, z))]
    v = [a * np.uint32(1664525) + np.uint32(1013904223) for a in v]
    for last in (False, True):
        for i in range(3):
            v[i] = v[i] + v[(i + 1) % 3] * v[(i + 2) % 3]
        if not last:
            v = [a ^ (a >> np.uint32(16)) for a in v]
    return v[0]


def sines(seed: int, spectrum: Spectrum = POND_RIPPLES) -> np.ndarray:
    """(n, 4) float64 rows (m, n, amplitude, phase) of one tile; its root mean square slope is 1.

    The phase is a hash of the seed and the wave vector: the same on every machine, and for a wave that two
    spectra share. Raises ValueError for a spectrum without any wave.
    """
    reach = int(spectrum.highest)
    n, m = (a.ravel() for a in np.mgrid[-reach : reach + 1, 0 : reach + 1])
    length = np.hypot(m, n)
    # Half of all vectors: the others are the same waves once more.
    kept = ((m > 0) | (n > 0)) & (length >= spectrum.lowest) & (length <= spectrum.highest)
    m, n, length = m[kept], n[kept], length[kept]
    along = np.abs(np.cos(np.arctan2(n, m) - spectrum.direction))
    amplitude = length**-spectrum.exponent * along**spectrum.spread
    slope = np.sqrt(0.5 * np.sum((2.0 * np.pi * length * amplitude) ** 2))
    if not slope > 0.0:
        raise ValueError(
            f"no wave fits {spectrum.lowest:g} to {spectrum.highest:g} times into a tile: "
            "widen the band of the spectrum"
        )
    phase = _hash(m, n, seed) * (2.0 * np.pi / 2.0**32)
    return np.stack([m, n, amplitude / slope, phase], axis=1)


def _synthesise(coefficients: np.ndarray, m: np.ndarray, n: np.ndarray, size: int) -> np.ndarray:
    """(size, size) real part of sum c exp(2 pi i (m x + n y)) at the texels, by an inverse FFT."""
    centered = coefficients * np.exp(1j * np.pi * (m + n) / size)
    spectrum = np.zeros((size, size // 2 + 1), dtype=np.complex128)
    spectrum[n % size, m] = 0.5 * centered
    straight = m == 0  # a real transform holds both halves of this column
    spectrum[-n[straight] % size, 0] = 0.5 * centered[straight].conj()
    return np.fft.irfft2(spectrum, s=(size, size), norm="forward")


def _resolved(waves: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(coefficients, m, n) of the sines that `size` texels can hold: more than two texels a wave."""
    waves = waves[2.0 * np.abs(waves[:, :2]).max(axis=1, initial=0.0) < size]
    m, n = waves[:, :2].astype(int).T
    return -1j * waves[:, 2] * np.exp(1j * waves[:, 3]), m, n


def height_field(waves: np.ndarray, size: int) -> np.ndarray:
    """(size, size) heights in tiles, from rows of `sines`. What is too short for the texels is left out."""
    return _synthesise(*_resolved(waves, size), size)


def slope_field(waves: np.ndarray, size: int) -> np.ndarray:
    """(size, size, 2) derivatives of the height along x and y: those of the sines, not differences."""
    coefficients, m, n = _resolved(waves, size)
    steps = (2j * np.pi * coefficients * axis for axis in (m, n))
    return np.stack([_synthesise(step, m, n, size) for step in steps], axis=-1)


def normal_map(slopes: np.ndarray, strength: float) -> np.ndarray:
    """(..., 3) encoded unit normals of slopes (..., 2) times `strength`, which is thus the slope's RMS."""
    n = np.concatenate([-strength * slopes, np.ones((*slopes.shape[:-1], 1))], axis=-1)
    return 0.5 + 0.5 * n / np.linalg.norm(n, axis=-1, keepdims=True)


def dudv_map(slopes: np.ndarray, strength: float) -> np.ndarray:
    """(..., 3) encoded displacements, down the slopes (..., 2) times `strength`, cut to -1..1."""
    d = np.clip(-strength * slopes, -1.0, 1.0)
    return np.concatenate([0.5 + 0.5 * d, np.zeros((*d.shape[:-1], 1))], axis=-1)


def make_map(
    kind: MapKind,
    seed: int,
    size: int,
    strength: float | None = None,
    spectrum: Spectrum = POND_RIPPLES,
) -> np.ndarray:
    """(size, size, 3) float64 in 0..1: a normal map or a dudv map of one tile of waves.

    strength: root mean square slope; None for that of `STRENGTH`.
    """
    slopes = slope_field(sines(seed, spectrum), size)
    encode = normal_map if kind == "NORMAL" else dudv_map
    return encode(slopes, STRENGTH[kind] if strength is None else strength)


def decode_normal(texels: np.ndarray) -> np.ndarray:
    """(..., 3) unit normals from texels (..., 3 or 4), always pointing out of the tile."""
    n = 2.0 * np.asarray(texels, dtype=np.float64)[..., :3] - 1.0
    n = np.concatenate([n[..., :2], np.maximum(n[..., 2:], MIN_Z)], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def decode_dudv(texels: np.ndarray) -> np.ndarray:
    """(..., 2) displacements from texels (..., 2 to 4)."""
    return 2.0 * np.asarray(texels, dtype=np.float64)[..., :2] - 1.0


# What an image's texels may be off, on average, to count as one kind: 8 bits, compression, and mipmaps
# that nobody made unit again.
_LENGTH_TOLERANCE = 0.1
_CENTER_TOLERANCE = 0.2
_BLUE_OF_DUDV = 0.25
_BLUE_SPREAD_OF_DUDV = 0.05


def classify(texels: np.ndarray) -> MapKind | None:
    """What an image's raw texels (..., 3 or 4) look like; None: neither.

    A normal map: vectors of length 1 that point out of the picture. A dudv map: red and green about one half,
    no blue.
    """
    rgb = np.asarray(texels, dtype=np.float64)[..., :3].reshape(-1, 3)
    vectors = 2.0 * rgb - 1.0
    off_unit = np.abs(np.linalg.norm(vectors, axis=1) - 1.0).mean()
    mean, spread = rgb.mean(axis=0), rgb.std(axis=0)
    if off_unit < _LENGTH_TOLERANCE and np.mean(vectors[:, 2] > 0.0) > 0.9:
        return "NORMAL"
    centered = np.all(np.abs(mean[:2] - 0.5) < _CENTER_TOLERANCE)
    if centered and mean[2] < _BLUE_OF_DUDV and spread[2] < _BLUE_SPREAD_OF_DUDV:
        return "DUDV"
    return None
