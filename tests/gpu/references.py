# SPDX-License-Identifier: GPL-3.0-or-later
"""The views that are kept as pictures in `tests/references/`, drawn on Mesa's software OpenGL."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.gpu import scenes
from tests.gpu.pictures import draw, to_8_bit

FOLDER = Path(__file__).resolve().parents[1] / "references"
SIZE = (240, 180)

SHORE = scenes.look_at((11, -12, 5), (0, -1.5, -0.5), SIZE)
SUNLIGHT = {"use_caustics": True, "use_shadows": True, "use_glow": True}

VIEWS = {
    "from_the_shore": (SHORE, {}),
    "sunlight": (scenes.look_at((11, -12, 8), (0, -1.5, -0.5), SIZE), SUNLIGHT),
    "sunlight_under_water": (scenes.look_at((6, -9, -1.2), (2, -3.5, -2.2), SIZE, fov=1.2), SUNLIGHT),
    "simple_lake": (SHORE, {"technique": "SIMPLE_LAKE"}),
    "pond": (SHORE, {"technique": "POND"}),
    "ripple": (SHORE, {"technique": "RIPPLE"}),
    "traced": (SHORE, {"technique": "TRACED"}),
    "near_the_water": (scenes.look_at((2, -13, 0.6), (0, 0, 0.4), SIZE), {}),
    "under_water": (
        scenes.look_at((6, -9, -1.2), (2, -3.5, -0.9), SIZE, fov=1.2),
        {"use_exact_under_water": False},
    ),
    "snells_window": (
        scenes.look_at((6, -9, -1.2), (4, -6, 0.6), SIZE, fov=1.6),
        {"use_exact_under_water": True},
    ),
    "at_the_surface": (scenes.look_at((6, -9, 0.02), (0, 0, 0.3), SIZE), {"use_exact_under_water": True}),
    "orthographic": (
        scenes.look_at((10, -14, 14), (0.5, -2, 0), SIZE, ortho=18.0),
        {"intersection_steps": 6},
    ),
}


def picture(renderer, name: str) -> np.ndarray:
    """(h, w, 3) uint8 of the pond in one of the VIEWS."""
    camera, options = VIEWS[name]
    return to_8_bit(draw(renderer, scenes.pond(), camera, SIZE, **options))
