# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's ray casts against what is known of planes: holes, backs of faces, far origins, many trees."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from lake_water_addon import raycast
from lake_water_addon.core import waves
from lake_water_addon.core.snapshot import Draw, Material, Mesh, MeshPart, SceneSnapshot
from tests.gpu import scenes

DOWN = np.array([0.0, 0.0, -1.0])
HALF = np.zeros((4, 8), np.float32)
HALF[:, 4:] = 1.0


def sheet(key: str, height: float) -> Mesh:
    """The square 0..1 with its texture coordinates, seen from above."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    return Mesh(
        key,
        1,
        np.column_stack([corners, np.full(4, height)]).astype(np.float32),
        np.tile(np.float32([0, 0, 1]), (4, 1)),
        corners,
        None,
        (MeshPart(0, np.array([(0, 1, 2), (0, 2, 3)], np.int32)),),
        False,
    )


def scene(*layers: tuple[float, Material], at: np.ndarray | None = None) -> SceneSnapshot:
    """Sheets at heights, each of a material."""
    meshes = {f"sheet {i}": sheet(f"sheet {i}", z) for i, (z, _) in enumerate(layers)}
    matrix = scenes.translation(*(at if at is not None else (0.0, 0.0, 0.0)))
    draws = tuple(Draw(key, 0, m.key, matrix[None], 1) for key, (_, m) in zip(meshes, layers, strict=True))
    materials = {material.key: material for _, material in layers}
    return SceneSnapshot(1, 0.0, meshes, materials, draws, scenes.constant_sky())


GREY = Material("grey", np.ones(3))
LEAF = Material("leaf", np.ones(3), image="leaf", alpha_threshold=0.5)


def points(count: int = 200, height: float = 3.0) -> np.ndarray:
    xy = np.random.default_rng(3).uniform(0.01, 0.99, (count, 2))
    return np.column_stack([xy, np.full(count, height)])


def test_rays_pass_the_holes_of_leaves() -> None:
    caster = raycast.RayCaster(scene((1.0, LEAF), (0.0, GREY)), {"leaf": HALF})
    origin = points()
    sure = np.abs(origin[:, 0] - 0.5) > 0.07  # half a texel is mixed from both
    hits = caster.cast(origin, DOWN)
    opaque = origin[:, 0] > 0.5
    np.testing.assert_allclose(hits.distance[sure], np.where(opaque, 2.0, 3.0)[sure], atol=1e-5)
    assert np.array_equal(hits.material[sure], np.where(opaque, 0, 1)[sure])
    whole = raycast.RayCaster(scene((1.0, LEAF), (0.0, GREY))).cast(origin, DOWN)
    np.testing.assert_allclose(whole.distance, 2.0, atol=1e-5)


def test_rays_pass_the_backs_of_culled_faces_alone() -> None:
    culled = replace(GREY, key="culled", cull_back_faces=True)
    caster = raycast.RayCaster(scene((1.0, culled), (0.0, GREY)))
    from_above = caster.cast(points(), DOWN)
    np.testing.assert_allclose(from_above.distance, 2.0, atol=1e-5)
    from_between = caster.cast(points(height=0.5), -DOWN)
    assert not from_between.found.any()
    assert np.all(from_between.material == -1)


def test_far_from_the_world_s_origin_nothing_is_lost() -> None:
    far = np.array([4e6, -3e6, 500.0])
    caster = raycast.RayCaster(scene((0.001, GREY), at=far), origin=far)
    np.testing.assert_allclose(caster.cast(points(), DOWN).distance, 2.999, atol=1e-5)


def test_several_trees_are_as_good_as_one(monkeypatch) -> None:
    monkeypatch.setattr(raycast, "CHUNK", 1)
    caster = raycast.RayCaster(scene((0.5, GREY), (1.0, GREY), (0.0, GREY)))
    assert caster.progress == 0.0
    assert not caster.build()
    assert 0.0 < caster.progress < 1.0
    hits = caster.cast(points(), DOWN)
    assert caster.progress == 1.0
    np.testing.assert_allclose(hits.distance, 2.0, atol=1e-5)
    assert np.all(hits.material == 1)


def test_nothing_to_hit_is_no_error() -> None:
    hits = raycast.RayCaster(scene()).cast(points(), DOWN)
    assert not hits.found.any()


def test_a_mesh_of_water_has_the_slope_of_its_vertices_and_of_the_waves() -> None:
    """A swell that is modeled, turned and scaled, under a wave: the slopes of both add up."""
    from lake_water_addon import ray_truth  # needs Blender, which is imported by now

    mesh = scenes.grid_mesh("swell", 201, 4.0, lambda x, y: 0.2 * np.sin(x))
    turn = 0.7
    matrix = scenes.translation(3.0, -2.0, 1.0)
    cos, sin = np.cos(turn), np.sin(turn)
    matrix[:3, :3] = np.array([(cos, -sin, 0), (sin, cos, 0), (0, 0, 1)]) @ np.diag([2.0, 1.0, 1.5])
    origin = np.array([0.5, 0.25, 0.0])
    packed = waves.pack([waves.SineWave(0.1, 3.0, 0.4)], 0.0, 5.0)
    planned = SimpleNamespace(body=SimpleNamespace(matrix=matrix), origin=origin, packed_waves=packed)
    local = np.random.default_rng(2).uniform(-3.5, 3.5, (50, 2))
    at = np.column_stack([local, 0.2 * np.sin(local[:, 0])]) @ matrix[:3, :3].T + origin
    got = ray_truth._mesh_normals(planned, mesh, at)
    along = 1.5 * 0.2 * np.cos(local[:, 0]) / 2.0  # of the swell, in the direction it runs in the world
    slope = along[:, None] * (cos, sin) + waves.slope(packed, (at - origin)[:, :2])
    want = np.column_stack([-slope, np.ones(len(slope))])
    want /= np.linalg.norm(want, axis=1, keepdims=True)
    np.testing.assert_allclose(got, want, atol=2e-3)
