# SPDX-License-Identifier: GPL-3.0-or-later
"""The depth textures of the cameras along sunlight: for shadows, and for the photons' search."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gpu
from gpu.types import GPUUniformBuf

from ...core.plan import CASCADES, WaterLight
from ..targets import Target, Targets
from .geometry import GeometryPainter

NOTHING = 1e5
"""m: the distance where nothing was drawn."""


def shadow_target(targets: Targets, size: int) -> Target:
    """colors: distance along the sun's light in m; the windows one above the other."""
    return targets.get(("shadow",), (size, CASCADES * size), ("R32F",))


def light_depth_target(targets: Targets, body: int, size: int) -> Target:
    """colors: distance along the light in the water in m."""
    return targets.get(("light depth", body), (size, size), ("R32F",))


def free_targets(targets: Targets, body: int) -> None:
    """Free the texture of a water body that is gone."""
    targets.discard(("light depth", body))


def draw_shadow(painter: GeometryPainter, target: Target, window: int, view: GPUUniformBuf) -> None:
    """All that there is: the ground under the water keeps off a sun that is down, and a valley beside the
    water may lie lower than that."""
    with _window(target, window):
        painter.draw_depths(view)


def draw_light_depth(
    painter: GeometryPainter, light: WaterLight, target: Target, view: GPUUniformBuf
) -> None:
    """What lies below the surface, cut off above the highest wave: a tree on the shore hides no bottom."""
    with _window(target, 0):
        painter.draw_depths(view, keep=+1, height=light.clip_height)


@contextmanager
def _window(target: Target, i: int) -> Iterator[None]:
    """Draw into one of the square windows that lie one above the other in a target, emptied before."""
    size = target.size[0]
    with target.framebuffer.bind():
        gpu.state.scissor_test_set(True)
        gpu.state.scissor_set(0, i * size, size, size)
        gpu.state.viewport_set(0, i * size, size, size)
        try:
            target.framebuffer.clear(color=(NOTHING, 0.0, 0.0, 0.0), depth=1.0)
            yield
        finally:
            gpu.state.scissor_test_set(False)
            gpu.state.viewport_set(0, 0, *target.size)
