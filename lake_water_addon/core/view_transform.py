# SPDX-License-Identifier: GPL-3.0-or-later
"""The lattice that Blender's own view transform is baked into: twin of `gpu_shaders/view_transform_lib.glsl`.

A table entry (i, j, k) holds the display colour of the scene-linear colour whose channels are
`lattice_values()[i], [j], [k]`. The spacing is logarithmic above a linear toe, and one entry lies
exactly where the Standard transform clips (1, before exposure), because that kink would be
smoothed away between two.
"""

from __future__ import annotations

import numpy as np

SIZE = 48
TOE = 1.0 / 64.0
_CLIP_INDEX = 28


def lattice_range(exposure: float = 0.0) -> tuple[float, float]:
    """(toe, highest) scene-linear values of the lattice, for a view exposure in stops."""
    stops = np.log2(1.0 / TOE + 1.0) * (SIZE - 1) / _CLIP_INDEX
    scale = 2.0**-exposure
    return float(TOE * scale), float(TOE * (2.0**stops - 1.0) * scale)


def to_lattice(linear: np.ndarray, lattice: tuple[float, float]) -> np.ndarray:
    """Position in the table, 0..1 from its first to its last entry, of scene-linear values."""
    toe, highest = lattice
    return np.log2(np.maximum(linear, 0.0) / toe + 1.0) / np.log2(highest / toe + 1.0)


def lattice_values(lattice: tuple[float, float]) -> np.ndarray:
    """(SIZE,) scene-linear values of the entries along one axis: the inverse of `to_lattice`."""
    toe, highest = lattice
    return toe * ((highest / toe + 1.0) ** np.linspace(0.0, 1.0, SIZE) - 1.0)


def lattice_colors(lattice: tuple[float, float]) -> np.ndarray:
    """(SIZE, SIZE, SIZE, 4) scene-linear RGBA of the entries, red along the last lattice axis."""
    values = lattice_values(lattice)
    colors = np.ones((SIZE, SIZE, SIZE, 4))
    colors[..., 2], colors[..., 1], colors[..., 0] = np.meshgrid(values, values, values, indexing="ij")
    return colors


def overlay_decoded(display: np.ndarray) -> np.ndarray:
    """What to write into Blender's viewport overlay for a display colour (0..1) to appear.

    Blender takes the overlay's values for linear ones and encodes them with a plain power of 2.2, not
    with the curve of sRGB, whatever view transform the scene has (measured in 5.2; up to 8 of 255 apart).
    """
    return np.maximum(np.asarray(display, dtype=np.float64), 0.0) ** 2.2
