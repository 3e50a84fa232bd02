# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays against a snapshot's triangles."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core.snapshot import Material
from scripts.reference.geometry import Geometry
from scripts.reference.images import bilinear
from tests.gpu import scenes

DOWN = np.array([[0.0, 0.0, -1.0]])


def _scene(material: Material, matrices, **changes):
    square = scenes.grid_mesh("square", 2, 1.0, color=lambda x, y: np.stack([x, y, 0.0 * x], axis=-1))
    square = scenes.changed(square, uvs=(square.positions[:, :2] * 0.5 + 0.5).astype(np.float32), **changes)
    return scenes.snapshot((square,), (material,), (("square", material.key, matrices),))


def test_nearest_of_instances_in_float64():
    plain = Material("plain", np.array([0.1, 0.2, 0.3]))
    far = scenes.translation(1e6, 2e6, 0.0)
    scene = _scene(plain, [far, far @ scenes.translation(0.0, 0.0, 0.5)])
    geometry = Geometry(scene)
    origin = np.array([[1e6 + 0.25, 2e6 - 0.5, 3.0]])
    hits = geometry.first_hits(origin, DOWN)
    assert hits.distance[0] == pytest.approx(2.5, abs=1e-9)
    found = geometry.surface(hits, origin, DOWN)
    np.testing.assert_allclose(found.normal, [[0.0, 0.0, 1.0]], atol=1e-7)
    np.testing.assert_allclose(found.albedo, [plain.base_color])
    assert geometry.first_hits(origin + np.array([2.0, 0.0, 0.0]), DOWN).triangle[0] == -1


def test_colors_are_interpolated_and_normals_face_the_ray():
    geometry = Geometry(_scene(Material("colored", np.ones(3), use_color_attribute=True), [np.eye(4)]))
    origin = np.array([[0.3, -0.4, -2.0]])
    hits = geometry.first_hits(origin, -DOWN)
    found = geometry.surface(hits, origin, -DOWN)
    np.testing.assert_allclose(found.albedo, [[0.3, -0.4, 0.0]], atol=1e-6)
    np.testing.assert_allclose(found.normal, DOWN, atol=1e-7)


def test_mirrored_and_stretched_instances_keep_their_front():
    culled = Material("culled", np.ones(3), cull_back_faces=True)
    geometry = Geometry(_scene(culled, [np.diag([-2.0, 3.0, 1.0, 1.0])]))
    assert geometry.first_hits(np.array([[1.5, 2.5, 1.0]]), DOWN).triangle[0] >= 0
    assert geometry.first_hits(np.array([[1.5, 2.5, -1.0]]), -DOWN).triangle[0] == -1
    # What is not drawn from behind still casts a shadow.
    assert geometry.occluded(np.array([[1.5, 2.5, -1.0]]), -DOWN)[0]


def test_rays_pass_where_an_image_is_clear():
    image = np.ones((2, 2, 4), np.float32)
    image[:, 0, 3] = 0.0  # the left half
    leaf = Material("leaf", np.ones(3), image="leaf", alpha_threshold=0.5)
    scene = _scene(leaf, [np.eye(4), scenes.translation(0.0, 0.0, -1.0) @ np.diag([-1.0, 1.0, 1.0, 1.0])])
    geometry = Geometry(scene, {"leaf": image})
    origin = np.array([[-0.5, 0.1, 2.0], [0.5, 0.1, 2.0]])
    down = np.repeat(DOWN, 2, axis=0)
    np.testing.assert_allclose(geometry.first_hits(origin, down).distance, [3.0, 2.0])
    np.testing.assert_array_equal(geometry.occluded(origin, down, 2.5), [False, True])
    np.testing.assert_array_equal(geometry.occluded(origin, down), [True, True])


def test_a_missing_image_is_named():
    with pytest.raises(KeyError, match="bark"):
        Geometry(_scene(Material("wood", np.ones(3), image="bark"), [np.eye(4)]))


def test_bilinear_repeats():
    pixels = np.arange(6.0).reshape(2, 3, 1)
    at = np.array([[0.5 / 3, 0.25], [1.0 / 3, 0.25], [0.0, 0.25], [0.5 / 3, 0.5], [7.5 / 3, 0.75]])
    np.testing.assert_allclose(bilinear(pixels, at)[:, 0], [0.0, 0.5, 1.0, 1.5, 4.0])
