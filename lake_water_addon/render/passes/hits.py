# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a technique looks: points of the scene in place of colours, to measure its error.

The water is drawn by its own shader, which tells the points that it looked up. Nothing of this is made for a
picture.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.plan import FramePlan
from ..targets import Target, Targets

TEXTURES = ("reflection", "refraction from below", "reflection from below")
"""Those that have distances for this pass only."""


class Hits(NamedTuple):
    """(h, w, 4) float32, first row at the bottom, xyz in render space and zero where there is nothing.

    surface: U of the triangles that are drawn, and the number of the body, counted from 1; refracted,
    reflected: W, and 1. Of a search, W is where the ray is in the end; else the point that is shown.
    """

    surface: np.ndarray
    refracted: np.ndarray
    reflected: np.ndarray


def hits_target(targets: Targets, size: tuple[int, int]) -> Target:
    """colors: radiance, which is of no use; then as in `Hits`."""
    return targets.get(("hits",), size, ("RGBA16F", "RGBA32F", "RGBA32F", "RGBA32F"))


def texture_target(targets: Targets, name: str, body: int, size: int) -> Target:
    """The texture `name` of TEXTURES with distances, as that of the refraction has them."""
    return targets.get(("hits", name, body), (size, size), ("RGBA16F", "R32F"), filtered=(True, False))


def free_targets(targets: Targets, body: int) -> None:
    """Free the textures of a water body that is gone."""
    for name in TEXTURES:
        targets.discard(("hits", name, body))


def without_light(plan: FramePlan) -> FramePlan:
    """The plan without sunlight in the water and shadows, which no ray asks for."""
    return replace(plan, shadows=(), bodies=tuple(replace(body, light=None) for body in plan.bodies))


def read(target: Target) -> Hits:
    """What is drawn in a `hits_target`."""
    width, height = target.size
    return Hits(
        *(
            np.asarray(texture.read(), dtype=np.float32).reshape(height, width, 4)
            for texture in target.colors[1:]
        )
    )
