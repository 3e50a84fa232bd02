# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's ray casts against what is known of planes: holes, backs of faces, far origins, many trees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lake_water_addon import raycast
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
