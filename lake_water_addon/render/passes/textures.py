# SPDX-License-Identifier: GPL-3.0-or-later
"""The two pictures that the water looks up: refraction (colour and linear depth) and reflection."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import gpu
from gpu.types import GPUUniformBuf

from ...core.plan import TexturePass
from ..targets import Target, Targets
from .geometry import NO_DEPTH, GeometryPainter, SceneLook

NO_BOTTOM = NO_DEPTH
"""m: the depth where nothing was drawn: water without a bottom."""


def refraction_target(targets: Targets, body: int, size: int) -> Target:
    """colors: premultiplied radiance, filtered; distance along the viewing axis in m, not filtered."""
    return _target(targets, ("refraction", body), size, True)


def reflection_target(targets: Targets, body: int, size: int, *, linear_depth: bool = False) -> Target:
    """colors: premultiplied radiance, filtered; with linear_depth as the refraction's."""
    return _target(targets, ("reflection", body), size, linear_depth)


def refraction_from_below_target(
    targets: Targets, body: int, size: int, *, linear_depth: bool = False
) -> Target:
    """colors: premultiplied radiance of what is above the water, filtered; with linear_depth as the
    refraction's."""
    return _target(targets, ("refraction from below", body), size, linear_depth)


def reflection_from_below_target(
    targets: Targets, body: int, size: int, *, linear_depth: bool = False
) -> Target:
    """colors: radiance of what is in the water, fogged, filtered; with linear_depth as the refraction's. Its
    depth is read for the fog."""
    return _target(targets, ("reflection from below", body), size, linear_depth)


def _target(targets: Targets, key: tuple, size: int, linear_depth: bool) -> Target:
    formats, filtered = (("RGBA16F", "R32F"), (True, False)) if linear_depth else (("RGBA16F",), (True,))
    return targets.get(key, (size, size), formats, filtered=filtered)


def free_targets(targets: Targets, body: int) -> None:
    """Free the textures of a water body that is gone."""
    for name in ("refraction", "reflection", "refraction from below", "reflection from below"):
        targets.discard((name, body))


def draw_refraction(
    painter: GeometryPainter,
    planned: TexturePass,
    target: Target,
    look: SceneLook,
    view: GPUUniformBuf,
    water: GPUUniformBuf,
) -> None:
    """What lies below the surface.

    Back faces of solids are culled before the clip, or the insides of what it cuts would show.
    """
    with target.framebuffer.bind():
        target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
        target.colors[1].clear(format="FLOAT", value=(NO_BOTTOM,))
        with drawn_region(planned.region, target.size):
            painter.draw_scene(look, view, side=planned, water=water, linear_depth=True)


def draw_reflection(
    painter: GeometryPainter,
    planned: TexturePass,
    target: Target,
    look: SceneLook,
    view: GPUUniformBuf,
    water: GPUUniformBuf,
) -> None:
    """What lies above the surface, and the sky: mirrored, or seen through it from below.

    Solids are not culled here: where the water line cuts one open, its inside is marked with
    alpha 0, so that the water does not look through it at the sky behind.
    """
    linear_depth = len(target.colors) > 1
    with target.framebuffer.bind():
        target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
        with drawn_region(planned.region, target.size):
            painter.draw_scene(
                look, view, side=planned, water=water, mark_insides=True, linear_depth=linear_depth
            )
            painter.draw_sky(look.lights, view, linear_depth=linear_depth)


def draw_reflection_from_below(
    painter: GeometryPainter,
    planned: TexturePass,
    target: Target,
    look: SceneLook,
    view: GPUUniformBuf,
    water: GPUUniformBuf,
) -> None:
    """What lies below the surface, from the mirrored camera, without the fog that is to come over it."""
    linear_depth = len(target.colors) > 1
    with target.framebuffer.bind():
        target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
        if linear_depth:
            target.colors[1].clear(format="FLOAT", value=(NO_BOTTOM,))
        with drawn_region(planned.region, target.size):
            painter.draw_scene(look, view, side=planned, water=water, linear_depth=linear_depth)


def draw_whole_refraction(
    painter: GeometryPainter,
    planned: TexturePass,
    target: Target,
    in_air: SceneLook,
    in_water: SceneLook,
    view: GPUUniformBuf,
) -> None:
    """All of the scene as it is without the water's surface, and the sky."""
    with target.framebuffer.bind():
        target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
        with drawn_region(planned.region, target.size):
            painter.draw_scene_in_water(
                in_air, in_water, view, planned.clear_height, planned.clip_height, linear_depth=True
            )
            painter.draw_sky(in_air.lights, view, linear_depth=True)


@contextmanager
def drawn_region(region: tuple[float, float, float, float], size: tuple[int, int]) -> Iterator[None]:
    """Draw only into a part of the target, in 0..1, and the texels that a filter takes along."""
    left, bottom = (max(0, math.floor(region[i] * size[i]) - 2) for i in (0, 1))
    right, top = (min(size[i], math.ceil(region[i + 2] * size[i]) + 2) for i in (0, 1))
    gpu.state.scissor_test_set(True)
    gpu.state.scissor_set(left, bottom, max(right - left, 0), max(top - bottom, 0))
    try:
        yield
    finally:
        gpu.state.scissor_test_set(False)
