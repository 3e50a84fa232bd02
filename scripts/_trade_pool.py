# SPDX-License-Identifier: GPL-3.0-or-later
"""A tiled pool in a walled garden: straight lines to see refraction by, and three depths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector

from lake_water_addon.scenes import plants, sky, textures
from lake_water_addon.scenes.geometry import (
    Geometry,
    box,
    build_mesh,
    geodesic_sphere,
    join,
    tube,
)
from lake_water_addon.scenes.materials import attribute_material, image_material
from lake_water_addon.water_objects import create_water, default_waves, set_waves

HALF = (5.0, 2.5)  # m, of the basin
SHALLOW, DEEP = 0.95, 2.3  # m
SLOPE = (-1.6, 1.4)  # m along the pool: between them the floor falls
RIM = 0.16  # m, the deck above the water
THICK = 0.4  # m, of the basin's walls and floor
GARDEN = (13.0, 9.0)  # m, half size of what the walls enclose
SUN = (math.radians(52.0), math.radians(236.0))  # elevation, azimuth
SKY_WIDTH = 512  # pixels


def _block(
    low: Sequence[float], high: Sequence[float], uv_scale: float = 0.5, long_axis: int = 0
) -> Geometry:
    """A box between two corners; an image of tiles covers 1 / uv_scale m."""
    low, high = np.asarray(low), np.asarray(high)
    return box(high - low, uv_scale=uv_scale, long_axis=long_axis).moved(np.eye(3), 0.5 * (low + high))


def _floor() -> Geometry:
    """The basin's floor, shallow, sloping and deep, as a closed prism along Y; uv along its slope."""
    (x0, x1), (hx, hy) = SLOPE, HALF
    top = np.array([[-hx, -SHALLOW], [x0, -SHALLOW], [x1, -DEEP], [hx, -DEEP]])
    bottom = -DEEP - THICK
    outline = np.concatenate([top[::-1], [[-hx, bottom], [hx, bottom]]])
    n = len(outline)
    positions = np.concatenate([np.insert(outline, 1, y, axis=1) for y in (-hy, hy)])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    sides, uvs = [], []
    for i in range(n):
        j = (i + 1) % n
        sides.append([n + i, n + j, j, i])
        ends = along[i], along[i] + np.linalg.norm(outline[j] - outline[i])
        uvs += [(ends[0], hy), (ends[1], hy), (ends[1], -hy), (ends[0], -hy)]
    caps = [list(range(n)), list(range(n, 2 * n))[::-1]]
    uvs += [tuple(outline[i % n]) for cap in caps for i in cap]
    faces = sides + caps
    return Geometry(
        positions,
        np.concatenate(faces),
        np.array([len(face) for face in faces]),
        uvs=0.5 * np.array(uvs),
        smooth=np.zeros(len(faces), dtype=bool),
    )


def _basin() -> tuple[Geometry, Geometry]:
    """(tiled, stone): floor, walls, a stair in a corner; and the coping around them."""
    hx, hy = HALF
    bottom = -DEEP - THICK
    tiled = [_floor()]
    for side in (-1.0, 1.0):
        y = sorted((side * hy, side * (hy + THICK)))
        tiled.append(_block((-hx - THICK, y[0], bottom), (hx + THICK, y[1], RIM - 0.05), long_axis=0))
        x = sorted((side * hx, side * (hx + THICK)))
        tiled.append(_block((x[0], -hy, bottom), (x[1], hy, RIM - 0.05), long_axis=1))
    for n in range(3):
        height = -0.18 - 0.26 * n
        tiled.append(_block((-hx, 0.4, -SHALLOW - 0.1), (-hx + 0.40 * (n + 1), hy, height), long_axis=1))
    stone = []
    lip, width = 0.04, 0.55
    for side in (-1.0, 1.0):
        y = sorted((side * (hy - lip), side * (hy + width)))
        stone.append(_block((-hx - width, y[0], RIM - 0.05), (hx + width, y[1], RIM + 0.03), 0.55))
        x = sorted((side * (hx - lip), side * (hx + width)))
        stone.append(_block((x[0], -hy + lip, RIM - 0.05), (x[1], hy - lip, RIM + 0.03), 0.55, 1))
    return join(tiled), join(stone)


def _garden() -> tuple[Geometry, Geometry, Geometry]:
    """(deck, walls, lawn): rings around the basin, each of four blocks."""
    hx, hy = HALF[0] + THICK, HALF[1] + THICK
    gx, gy = GARDEN
    deck, walls, lawn = [], [], []
    for parts, inner, outer, top, scale in (
        (deck, (hx, hy), (hx + 3.0, hy + 2.4), RIM, 0.4),
        (lawn, (hx + 3.0, hy + 2.4), (gx, gy), RIM - 0.06, 0.5),
    ):
        for side in (-1.0, 1.0):
            y = sorted((side * inner[1], side * outer[1]))
            parts.append(_block((-outer[0], y[0], -0.5), (outer[0], y[1], top), scale))
            x = sorted((side * inner[0], side * outer[0]))
            parts.append(_block((x[0], -inner[1], -0.5), (x[1], inner[1], top), scale))
    for side in (-1.0, 1.0):
        y = sorted((side * gy, side * (gy + 0.4)))
        walls.append(_block((-gx - 0.4, y[0], -0.5), (gx + 0.4, y[1], 2.3), 0.4))
        x = sorted((side * gx, side * (gx + 0.4)))
        walls.append(_block((x[0], -gy, -0.5), (x[1], gy, 2.3), 0.4, 1))
    return join(deck), join(walls), join(lawn)


def _pergola() -> Geometry:
    """Six white posts and their beams along the far side."""
    parts = []
    for x in np.linspace(-3.6, 5.4, 4):
        for y in (4.1, 5.9):
            parts.append(_block((x - 0.11, y - 0.11, 0.0), (x + 0.11, y + 0.11, 2.7)))
        parts.append(_block((x - 0.08, 3.7, 2.7), (x + 0.08, 6.3, 2.86)))
    for y in (4.1, 5.9):
        parts.append(_block((-4.2, y - 0.09, 2.86), (6.0, y + 0.09, 3.04)))
    return join(parts).with_color((0.62, 0.60, 0.56))


def _ladder() -> Geometry:
    """Two rails over the rim and four rungs down the deep end's wall."""
    x, parts = 3.3, []
    t = np.linspace(0.0, math.pi, 9)
    bend = np.column_stack([0.28 * np.cos(t) + 0.08, 0.62 + 0.28 * np.sin(t)])
    path = np.concatenate([[[0.36, RIM - 0.04]], bend, [[-0.20, -1.15]]])
    for side in (-0.25, 0.25):
        rail = np.column_stack([np.full(len(path), x + side), HALF[1] + path[:, 0], path[:, 1]])
        parts.append(tube(rail, np.full(len(rail), 0.028), 8))
    for z in (-0.1, -0.4, -0.7, -1.0):
        rung = np.array([[x - 0.25, HALF[1] - 0.2, z], [x, HALF[1] - 0.2, z], [x + 0.25, HALF[1] - 0.2, z]])
        parts.append(tube(rung, np.full(3, 0.03), 8))
    return join(parts).with_color((0.55, 0.56, 0.58))


def _ball() -> Geometry:
    """A beach ball of unit radius in six coloured gores."""
    directions, triangles = geodesic_sphere(6)
    gore = np.floor((np.arctan2(directions[:, 1], directions[:, 2]) / (2.0 * np.pi) + 0.5) * 6.0).astype(int)
    paint = np.array([[0.60, 0.05, 0.03], [0.75, 0.72, 0.65], [0.75, 0.45, 0.03]])
    sphere = Geometry(directions, triangles.ravel(), np.full(len(triangles), 3))
    return sphere.with_color(paint[gore % 3])


class _Builder:
    def __init__(self, collection: bpy.types.Collection) -> None:
        self.collection = collection

    def put(
        self,
        name: str,
        geometry: Geometry,
        *materials: bpy.types.Material,
        place: Sequence[float] = (0.0, 0.0, 0.0),
        scale: float = 1.0,
        turn: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        obj = bpy.data.objects.new(f"Pool {name}", build_mesh(f"Pool {name}", geometry, materials))
        obj.location, obj.scale, obj.rotation_euler = place, (scale,) * 3, turn
        self.collection.objects.link(obj)


def build_pool(scene: bpy.types.Scene, *, seed: int = 1) -> tuple[bpy.types.Object, bpy.types.Object]:
    """Add the pool, its garden, sun and sky to the scene; (water, sun). Metres, water at z = 0."""
    collection = bpy.data.collections.new("Pool")
    scene.collection.children.link(collection)
    b = _Builder(collection)

    def painted(name: str, pixels: np.ndarray, **options: bool) -> bpy.types.Material:
        return image_material(f"Pool {name}", textures.make_image(f"Pool {name}", pixels), **options)

    tiles = painted("Tiles", textures.mosaic(256, seed), cull=True)
    stone = painted("Stone", textures.masonry(256, seed), cull=True)
    paint = attribute_material("Pool Paint", cull=True)
    tiled, coping = _basin()
    b.put("Basin", tiled, tiles)
    b.put("Coping", coping, stone)
    deck, walls, lawn = _garden()
    b.put("Deck", deck, painted("Planks", textures.wood(256, seed), cull=True))
    b.put("Walls", walls, stone)
    b.put("Lawn", lawn.with_color((0.085, 0.14, 0.03)), paint)
    b.put("Pergola", _pergola(), paint)
    b.put("Ladder", _ladder(), paint)
    b.put("Ball", _ball(), paint, place=(-0.3, -0.7, 0.12), scale=0.28, turn=(0.5, 0.4, 0.0))
    board = _block((3.2, -0.3, 0.62), (6.9, 0.3, 0.68)).with_color((0.10, 0.22, 0.42))
    foot = _block((5.7, -0.2, 0.0), (6.5, 0.2, 0.62)).with_color((0.5, 0.5, 0.5))
    b.put("Diving Board", join([board, foot]), paint)
    # Across the waterline, to see the bend by.
    pole = painted("Pole", textures.stripes(256, seed), cull=True)
    rod = tube(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.3], [0.0, 0.0, 1.5]]), np.full(3, 0.035), 10)
    b.put("Pole", rod, pole, place=(-2.6, 0.9, 0.0), turn=(-0.25, 0.3, 0.0))
    leaves = painted("Leaves", textures.leaf_atlas(256, seed, (0.105, 0.165, 0.032)), clip=True)
    for n, (x, y) in enumerate(((-6.4, 4.6), (7.4, 3.6), (8.0, -3.9), (-8.2, -6.4), (0.6, 7.6), (-3.2, 7.8))):
        shrub = plants.shrub(seed + n, radius=1.0, cards_count=24, card=0.55)
        b.put(f"Shrub {n}", shrub, leaves, place=(x, y, 0.1))

    water = create_water("Pool Water", 2.0 * HALF[0] + 0.1, 2.0 * HALF[1] + 0.1, collection)
    water.lake_water.k = 0.14
    water.lake_water.water_color = (0.010, 0.10, 0.13)
    water.lake_water.grid_resolution = 128
    spread = math.radians(250.0)
    set_waves(
        water,
        default_waves(count=8, spread=spread, height=0.055, longest=2.2, shortest=0.45, seed=seed + 2),
    )
    elevation, azimuth = SUN
    to_sun = np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )
    lamp = bpy.data.lights.new("Pool Sun", "SUN")
    lamp.energy, lamp.color, lamp.angle = 4.2, (1.0, 0.94, 0.85), math.radians(0.53)
    sun = bpy.data.objects.new("Pool Sun", lamp)
    sun.rotation_euler = Vector(to_sun).to_track_quat("Z", "Y").to_euler()
    collection.objects.link(sun)
    scene.world = sky.make_world("Pool Sky", sky.sky_image(to_sun, seed, width=SKY_WIDTH))
    return water, sun
