# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's light: equirectangular images and diffuse irradiance in spherical harmonics.

Directions are unit vectors in world axes, Z up. Image rows run from the bottom (v = 0,
the nadir) to the top (v = 1, the zenith), as Blender stores them.
"""

from __future__ import annotations

import numpy as np

# Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001: the cosine
# lobe's coefficients A_l = pi, 2 pi / 3, pi / 4, here divided by pi, one for each (l, m).
COSINE_LOBE = np.array([1.0] + [2.0 / 3.0] * 3 + [1.0 / 4.0] * 5)

# The integration grid: a degree-2 projection gains nothing from more.
MAX_HEIGHT = 128
MIN_HEIGHT = 64


def equirectangular_uv(direction: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """Texture coordinates (..., 2) of directions (..., 3) in an equirectangular image.

    rotation: radians by which the image is turned about world +Z, counter-clockwise seen
    from above. Blender's convention: the image's middle column shows world +X, and
    u = 1/2 - azimuth / (2 pi), v = 1/2 + elevation / pi; u is in [0, 1).
    """
    d = np.asarray(direction, dtype=np.float64)
    azimuth = np.arctan2(d[..., 1], d[..., 0]) - rotation
    elevation = np.arctan2(d[..., 2], np.hypot(d[..., 0], d[..., 1]))
    return np.stack([np.mod(0.5 - azimuth / (2.0 * np.pi), 1.0), 0.5 + elevation / np.pi], axis=-1)


def equirectangular_direction(uv: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """Unit directions (..., 3) of texture coordinates (..., 2): the inverse of `equirectangular_uv`."""
    uv = np.asarray(uv, dtype=np.float64)
    azimuth = (0.5 - uv[..., 0]) * 2.0 * np.pi + rotation
    elevation = (uv[..., 1] - 0.5) * np.pi
    c = np.cos(elevation)
    return np.stack([c * np.cos(azimuth), c * np.sin(azimuth), np.sin(elevation)], axis=-1)


def sh_basis(direction: np.ndarray) -> np.ndarray:
    """Real spherical harmonics (..., 9) of unit directions (..., 3).

    Order l,m = 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22, orthonormal over the sphere.
    """
    d = np.asarray(direction, dtype=np.float64)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    c0 = 0.5 * np.sqrt(1.0 / np.pi)
    c1 = 0.5 * np.sqrt(3.0 / np.pi)
    c2 = 0.5 * np.sqrt(15.0 / np.pi)
    c20 = 0.25 * np.sqrt(5.0 / np.pi)
    c22 = 0.25 * np.sqrt(15.0 / np.pi)
    return np.stack(
        [
            np.full_like(x, c0),
            c1 * y,
            c1 * z,
            c1 * x,
            c2 * x * y,
            c2 * y * z,
            c20 * (3.0 * z * z - 1.0),
            c2 * x * z,
            c22 * (x * x - y * y),
        ],
        axis=-1,
    )


def row_solid_angles(height: int) -> np.ndarray:
    """(height,) solid angle in steradians of each full row of an equirectangular image; they sum to 4 pi."""
    edges = np.linspace(-0.5 * np.pi, 0.5 * np.pi, height + 1)
    return 2.0 * np.pi * np.diff(np.sin(edges))


def downsample(pixels: np.ndarray, max_height: int = MAX_HEIGHT) -> np.ndarray:
    """Average an equirectangular image (H, W, 3) to at most (max_height, 2 max_height, 3), float64.

    Pixels are weighted by their solid angle, so that the mean over the sphere is kept
    to rounding where blocks are of equal size. Never larger than before.
    """
    image = np.asarray(pixels)
    height, width = image.shape[:2]
    rows, columns = min(height, max_height), min(width, 2 * max_height)
    row_starts = np.arange(rows) * height // rows
    column_starts = np.arange(columns) * width // columns
    # Columns first: it is the large reduction.
    counts = np.diff(np.append(column_starts, width)).astype(np.float64)
    narrow = np.add.reduceat(image, column_starts, axis=1, dtype=np.float64) / counts[None, :, None]
    weights = row_solid_angles(height)
    block_weights = np.add.reduceat(weights, row_starts)
    return np.add.reduceat(narrow * weights[:, None, None], row_starts, axis=0) / block_weights[:, None, None]


def mean_radiance(pixels: np.ndarray) -> np.ndarray:
    """(3,) mean over the sphere of an equirectangular image (H, W, 3)."""
    weights = row_solid_angles(pixels.shape[0]) / (4.0 * np.pi)
    return weights @ np.mean(pixels, axis=1, dtype=np.float64)


def project(pixels: np.ndarray, rotation: float = 0.0) -> np.ndarray:
    """(9, 3) spherical-harmonics coefficients of the radiance of an equirectangular image (H, W, 3).

    Each pixel is a patch of constant radiance; small images are subdivided for the
    integration. rotation: see `equirectangular_uv`.
    """
    image = np.asarray(pixels, dtype=np.float64)
    repeat_v = max(1, -(-MIN_HEIGHT // image.shape[0]))
    repeat_u = max(1, -(-2 * MIN_HEIGHT // image.shape[1]))
    image = image.repeat(repeat_v, axis=0).repeat(repeat_u, axis=1)
    height, width = image.shape[:2]
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    basis = sh_basis(equirectangular_direction(np.stack([u, v], axis=-1), rotation))
    basis *= (row_solid_angles(height) / width)[:, None, None]
    return basis.reshape(-1, 9).T @ image.reshape(-1, 3)


def irradiance_sh(radiance_sh: np.ndarray) -> np.ndarray:
    """(9, 3) coefficients of the irradiance divided by pi from those of the radiance (9, 3)."""
    return COSINE_LOBE[:, None] * radiance_sh


def constant_irradiance_sh(radiance: np.ndarray) -> np.ndarray:
    """(9, 3) coefficients of the irradiance divided by pi under a sky of one radiance (3,)."""
    sh = np.zeros((9, 3))
    sh[0] = np.sqrt(4.0 * np.pi) * np.asarray(radiance, dtype=np.float64)
    return sh


def evaluate(sh: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(..., 3) value of an expansion (9, 3) in unit directions (..., 3).

    For `irradiance_sh` the irradiance divided by pi of a surface with that normal: times
    its albedo, the radiance that a diffuse surface sends back.
    """
    return sh_basis(direction) @ sh


def linear_from_srgb(value: np.ndarray) -> np.ndarray:
    """Scene-linear values from sRGB-encoded ones (IEC 61966-2-1)."""
    value = np.asarray(value)
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.0) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(value: np.ndarray) -> np.ndarray:
    """sRGB-encoded values from scene-linear ones of 0 and above (IEC 61966-2-1)."""
    value = np.asarray(value)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
