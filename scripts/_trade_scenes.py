# SPDX-License-Identifier: GPL-3.0-or-later
"""The eight scenes that the trade between time and error is measured on: fixed seeds, cameras and frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
from _blender_side import ENGINE
from _trade_pool import build_pool
from mathutils import Matrix, Vector

from lake_water_addon.core.waves import SineWave
from lake_water_addon.scenes import build_lake
from lake_water_addon.water_objects import set_waves

DETAIL = 0.3
"""Of the lake: a third of its triangles, so that references take minutes."""
FRAME = 13
"""The frame that pictures are compared at, half a second after the first."""
LENS = 26.0  # mm, of 36: the lake's own
GRID = 256
"""Vertices along a side of the lake, 0.18 m apart: at 0.94 m, the default, shorter waves have no height."""


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """What stands in the Blender scene."""

    camera: bpy.types.Object
    water: bpy.types.Object
    sun: bpy.types.Object


@dataclass(frozen=True)
class TradeScene:
    """label: a name to read; description: what is hard in it; build(scene, detail) fills an empty scene."""

    label: str
    description: str
    build: Callable[[bpy.types.Scene, float], BuiltScene]


def open_scene(name: str, size: tuple[int, int], detail: float = DETAIL) -> BuiltScene:
    """A file of its own for the scene, at FRAME, for pictures of `size` by Lake Water with no glow.

    The extension must be registered. KeyError for a name that is not in TRADE_SCENES.
    """
    trade = TRADE_SCENES[name]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    built = trade.build(scene, detail)
    scene.camera = built.camera
    render = scene.render
    render.engine = ENGINE
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    # The sun's mirror image is no part of the references.
    scene.lake_water.use_glow = False
    scene.frame_set(FRAME)
    return built


def _aim(camera: bpy.types.Object, place: Sequence[float], target: Sequence[float]) -> None:
    place = Vector(place)
    turned = (Vector(target) - place).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    camera.matrix_world = Matrix.Translation(place) @ turned


def _in_lake(
    place: Sequence[float],
    target: Sequence[float],
    change: Callable[[bpy.types.Object], None] | None = None,
) -> Callable[[bpy.types.Scene, float], BuiltScene]:
    """The demonstration lake from `place`, (x, y, height over the water) from its middle."""

    def build(scene: bpy.types.Scene, detail: float) -> BuiltScene:
        lake = build_lake(scene, seed=1, detail=detail)
        _aim(lake.camera, place, target)
        lake.water.lake_water.grid_resolution = GRID
        if change is not None:
            change(lake.water)
        return BuiltScene(lake.camera, lake.water, lake.sun)

    return build


def _deepen(water: bpy.types.Object) -> None:
    """Water in which nothing is seen from 5 m on."""
    water.lake_water.k = 0.8


def _steepen(water: bpy.types.Object) -> None:
    """A wave as high as a twelfth of its length, nearly as steep as breaks, and lesser ones across it."""
    directions = (30.0, 75.0, -20.0, 140.0)
    sizes = ((0.30, 3.6), (0.06, 2.1), (0.03, 1.2), (0.015, 0.8))
    set_waves(
        water,
        [
            SineWave(amplitude, wavelength, math.radians(direction), 1.7 * number)
            for number, ((amplitude, wavelength), direction) in enumerate(zip(sizes, directions, strict=True))
        ],
    )


def _pool(scene: bpy.types.Scene, detail: float) -> BuiltScene:
    """As small as it is, it looks the same at every detail."""
    water, sun = build_pool(scene)
    data = bpy.data.cameras.new("Pool Camera")
    data.lens, data.sensor_width = LENS, 36.0
    camera = bpy.data.objects.new("Pool Camera", data)
    scene.collection.objects.link(camera)
    _aim(camera, (-6.5, -0.5, 2.0), (0.0, 0.2, -0.7))
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - High Contrast"
    scene.eevee.use_raytracing = True
    return BuiltScene(camera, water, sun)


TRADE_SCENES: dict[str, TradeScene] = {
    "lake_near": TradeScene(
        "Lake, near",
        "From the bank over steps and a tiled floor: near things seen through waves",
        _in_lake((7.5, -15.5, 2.3), (3.0, -12.0, -0.9)),
    ),
    "lake_far": TradeScene(
        "Lake, far",
        "The whole lake as a turntable shows it: long reflections, the bottom in a narrow strip",
        _in_lake((0.0, -24.0, 5.0), (0.0, 0.0, 1.4)),
    ),
    "shallow_shore": TradeScene(
        "Shallow shore",
        "Water over sand, stones and a log that stand out of it",
        _in_lake((-4.0, -17.5, 1.6), (-4.5, -13.5, -0.3)),
    ),
    "deep_water": TradeScene(
        "Deep water",
        "From the shelf down the drop beside a jetty: what absorption leaves of the bottom",
        _in_lake((-15.0, -4.0, 2.6), (-8.0, -2.5, -1.8), _deepen),
    ),
    "steep_waves": TradeScene(
        "Steep waves",
        "Waves as steep as they get: rays that go far from where the texture's do",
        _in_lake((3.6, -18.6, 2.6), (3.4, -12.8, -0.6), _steepen),
    ),
    "grazing": TradeScene(
        "Grazing view",
        "Along the water, 0.4 m over it: reflections torn by waves, crests that hide troughs",
        _in_lake((4.0, -14.0, 0.4), (-4.0, 9.0, 0.35)),
    ),
    "under_water": TradeScene(
        "Under water",
        "Along and up from 0.8 m below: Snell's window, and the bottom mirrored around it",
        _in_lake((1.2, -12.0, -0.8), (4.5, -14.2, 0.6)),
    ),
    "tiled_pool": TradeScene(
        "Tiled pool",
        "Straight lines under clear water of three depths, and caustics on them",
        _pool,
    ),
}
