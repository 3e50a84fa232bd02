# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes made without Blender: snapshots as the extraction would make them, and cameras."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from lake_water_addon.core import sky as sky_math
from lake_water_addon.core.snapshot import (
    Camera,
    Draw,
    Material,
    Mesh,
    MeshPart,
    SceneSnapshot,
    Sky,
    Sun,
    WaterBody,
    WaterSettings,
)
from lake_water_addon.core.waves import SineWave

_versions = itertools.count(1)
"""Whatever is made gets a version of its own: a renderer may be used for one scene after another."""

SKY_RADIANCE = np.array([0.5, 0.6, 0.8])
LAKE_WAVES = (
    SineWave(0.08, 4.0, 0.2, 0.0),
    SineWave(0.06, 2.7, -0.4, 1.0),
    SineWave(0.03, 1.5, 0.9, 2.0),
    SineWave(0.015, 0.8, -1.0, 3.0),
)
STEEP_WAVES = (SineWave(1.0, 1.0, 0.3, 0.5),)


def translation(x: float, y: float, z: float = 0.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def grid_mesh(key, resolution, half_size, height=0.0, color=None) -> Mesh:
    """A height field over the square of `half_size`; height and color are functions of (x, y) arrays."""
    line = np.linspace(-half_size, half_size, resolution)
    x, y = np.meshgrid(line, line)
    z = height(x, y) if callable(height) else np.full_like(x, height)
    slope_y, slope_x = np.gradient(z, line, line)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(z)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    corner = (np.arange(resolution - 1)[:, None] * resolution + np.arange(resolution - 1)).ravel()
    n = resolution
    triangles = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + n + 1], 1),
            np.stack([corner, corner + n + 1, corner + n], 1),
        ]
    )
    colors = None
    if color is not None:
        colors = np.ones((n * n, 4), np.float32)
        colors[:, :3] = color(x, y).reshape(-1, 3)
    return Mesh(
        key,
        next(_versions),
        np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        None,
        colors,
        (MeshPart(0, triangles.astype(np.int32)),),
        False,
    )


def box_mesh(key, half_extents) -> Mesh:
    """A closed box about its origin, with flat normals that point outwards."""
    positions, normals, triangles = [], [], []
    for axis in range(3):
        for side in (-1, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = []
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = [0, 0, 0]
                corner[axis], corner[u], corner[v] = side, a, b
                corners.append(corner)
            normal = [0, 0, 0]
            normal[axis] = side
            first = len(positions)
            positions += corners if side > 0 else corners[::-1]
            normals += [normal] * 4
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return Mesh(
        key,
        next(_versions),
        (np.array(positions) * half_extents).astype(np.float32),
        np.array(normals, np.float32),
        None,
        None,
        (MeshPart(0, np.array(triangles, np.int32)),),
        True,
    )


def constant_sky(radiance=SKY_RADIANCE) -> Sky:
    radiance = np.asarray(radiance, dtype=np.float64)
    return Sky(radiance, sky_math.constant_irradiance_sh(radiance))


def water(location=(0.0, 0.0, 0.0), half_size=30.0, resolution=129, **settings) -> WaterBody:
    return WaterBody(
        "water",
        "Water",
        translation(*location),
        WaterSettings(**settings),
        (resolution, half_size, half_size, 0.0, 0.0),
    )


def snapshot(meshes, materials, draws, waters=(), sky=None, sun=None, time=1.0) -> SceneSnapshot:
    """draws: (mesh, material, matrices) each."""
    return SceneSnapshot(
        next(_versions),
        time,
        {m.key: m for m in meshes},
        {m.key: m for m in materials},
        tuple(
            Draw(mesh, 0, material, np.stack(matrices), next(_versions)) for mesh, material, matrices in draws
        ),
        sky or constant_sky(),
        sun,
        tuple(waters),
    )


def look_at(position, target, size=(160, 120), fov=0.9, near=0.1, far=1000.0, ortho=None) -> Camera:
    """Perspective camera with horizontal field of view `fov`, or orthographic of width `ortho` m."""
    back = np.subtract(position, target).astype(float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back) if abs(back[2]) < 0.9999 else np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([right, np.cross(back, right), back])
    to_world[:3, 3] = position
    aspect = size[1] / size[0]
    projection = np.zeros((4, 4))
    if ortho is not None:
        projection[0, 0], projection[1, 1] = 2.0 / ortho, 2.0 / (ortho * aspect)
        projection[2, 2], projection[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
        projection[3, 3] = 1.0
    else:
        tangent = np.tan(fov / 2.0)
        projection[0, 0], projection[1, 1] = 1.0 / tangent, 1.0 / (tangent * aspect)
        projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
        projection[3, 2] = -1.0
    return Camera(np.linalg.inv(to_world), projection)


def moved(scene: SceneSnapshot, camera: Camera, offset) -> tuple[SceneSnapshot, Camera]:
    """The scene and its camera somewhere else in the world."""
    shift = translation(*offset)
    draws = tuple(replace(d, matrices=shift @ d.matrices, version=next(_versions)) for d in scene.draws)
    waters = tuple(replace(w, matrix=shift @ w.matrix) for w in scene.waters)
    return (
        replace(scene, version=next(_versions), draws=draws, waters=waters),
        replace(camera, view=camera.view @ np.linalg.inv(shift)),
    )


def with_water(scene: SceneSnapshot, **settings) -> SceneSnapshot:
    """The scene with other settings of its water bodies."""
    waters = tuple(replace(w, settings=replace(w.settings, **settings)) for w in scene.waters)
    return replace(scene, version=next(_versions), waters=waters)


def changed(mesh: Mesh, **parts) -> Mesh:
    """The mesh with other arrays, as a new version of it."""
    return replace(mesh, version=next(_versions), **parts)


def position_coded(mesh: Mesh) -> Mesh:
    """The mesh with its positions, up to 8 m from the origin, as vertex colours: a texel tells its place."""
    colors = np.ones((len(mesh.positions), 4), np.float32)
    colors[:, :3] = mesh.positions / 16.0 + 0.5
    return changed(mesh, colors=colors)


def decoded_positions(colors: np.ndarray) -> np.ndarray:
    """Positions in m (..., 3) of `position_coded` colours under a sky of radiance 1; half floats: to 8 mm."""
    return (colors[..., :3] - 0.5) * 16.0


def checkered(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., 3) albedo of 1 m squares."""
    odd = (np.floor(x) + np.floor(y)) % 2 == 1
    return np.where(odd[..., None], [0.6, 0.5, 0.3], [0.25, 0.2, 0.12])


def pond(**settings) -> SceneSnapshot:
    """A checkered basin, 4 m deep in the middle, with half-sunken red posts and a floating box; low sun."""
    bed = grid_mesh("bed", 161, 40.0, lambda x, y: -4.0 + (x * x + y * y) / 60.0, checkered)
    post, crate = box_mesh("post", (0.5, 0.5, 3.0)), box_mesh("crate", (1.2, 0.8, 0.4))
    red, wood = Material("red", np.array([0.6, 0.1, 0.05])), Material("wood", np.array([0.5, 0.35, 0.2]))
    sand = Material("sand", np.array([0.5, 0.4, 0.3]), use_color_attribute=True)
    direction = np.array([0.5, -0.3, 0.8])
    options = {"k": 0.3, "water_color": (0.01, 0.08, 0.06), "waves": LAKE_WAVES, **settings}
    return snapshot(
        (bed, post, crate),
        (sand, red, wood),
        (
            ("bed", "sand", [np.eye(4)]),
            ("post", "red", [translation(0, 0), translation(3, -4), translation(-4, -6, -1)]),
            ("crate", "wood", [translation(5, 0.5)]),
        ),
        (water(**options),),
        sun=Sun(direction / np.linalg.norm(direction), np.array([3.0, 2.9, 2.6])),
    )
