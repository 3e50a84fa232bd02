# SPDX-License-Identifier: GPL-3.0-or-later
"""Where rays really go, and the error of given places."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core.hits import hit_errors, texture_places
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from scripts.reference.tracer import Reference
from scripts.reference.truth import hidden_from, true_hits
from tests.gpu import scenes

SIZE = (32, 24)
LEVEL = 2.0


@pytest.fixture(scope="module")
def calm():
    """Calm water 3 m over a level bottom, with a wall of 10 m behind it, somewhere in the world."""
    bed = scenes.grid_mesh("bed", 2, 60.0, -3.0)
    wall = scenes.box_mesh("wall", (30.0, 1.0, 10.0))
    sand = scenes.Material("sand", np.ones(3))
    at = scenes.translation(100.0, 50.0, LEVEL)
    scene = scenes.snapshot(
        (bed, wall),
        (sand,),
        (("bed", "sand", [at]), ("wall", "sand", [at @ scenes.translation(0.0, 20.0)])),
        (scenes.water((100.0, 50.0, LEVEL), half_size=18.0),),
    )
    camera = scenes.look_at((100.0, 35.0, 5.0), (100.0, 50.0, LEVEL), SIZE)
    return Reference(scene), camera


def test_places_on_calm_water(calm):
    reference, camera = calm
    hits = true_hits(reference, camera, SIZE)
    water = hits.water
    assert 0.3 < water.mean() < 0.9
    assert hits.from_air.all()
    np.testing.assert_allclose(
        hits.surface[water][:, 2], 0.0, atol=1e-8
    )  # render space: from the water's origin
    np.testing.assert_allclose(hits.normal[water], np.tile([0.0, 0.0, 1.0], (water.sum(), 1)))
    eye = np.array([0.0, -15.0, 3.0])
    incident = hits.surface[water] - eye
    incident /= np.linalg.norm(incident, axis=1, keepdims=True)
    level = hits.refracted.direction[water][:, :2]
    np.testing.assert_allclose(level, incident[:, :2] / 1.333, atol=1e-9)  # Snell
    met_bed = water & np.isclose(hits.refracted.point[..., 2], -3.0)
    assert met_bed[water].mean() > 0.9
    drop = -hits.refracted.direction[met_bed][:, 2]
    np.testing.assert_allclose(hits.refracted.distance[met_bed], 3.0 / drop, rtol=1e-9)
    mirrored = incident * (1.0, 1.0, -1.0)
    np.testing.assert_allclose(hits.reflected.direction[water], mirrored, atol=1e-9)
    to_wall = (19.0 - hits.surface[water][:, 1]) / mirrored[:, 1]
    reaches = mirrored[:, 2] * to_wall < 9.9
    np.testing.assert_allclose(hits.reflected.distance[water][reaches], to_wall[reaches], rtol=1e-9)
    above = mirrored[:, 2] * to_wall > 10.1
    assert above.any()
    assert np.isinf(hits.reflected.distance[water][above]).all()
    assert np.isnan(hits.reflected.point[water][above]).all()


def test_nothing_beyond_total_reflection(calm):
    reference, _ = calm
    camera = scenes.look_at((100.0, 50.0, 0.0), (101.0, 50.0, 0.3), SIZE, ortho=0.5, near=0.0)
    hits = true_hits(reference, camera, SIZE)
    assert hits.water.all()
    assert not hits.from_air.any()
    assert np.isnan(hits.refracted.direction).all()
    assert np.isinf(hits.refracted.distance).all()
    np.testing.assert_allclose(hits.reflected.point[..., 2], -3.0)


def test_errors_of_given_places():
    true = np.full((2, 3, 3), np.nan)
    given = np.full((2, 3, 3), np.nan)
    true[0] = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
    true[1, 0] = (0, 5, 0)  # not found
    given[0] = [(0, 0, 0), (1, 0.3, 0.4), (2, 0, 4.0)]
    given[1, 1] = (0, 0, 0)  # nothing there
    given[1, 2] = (9, 9, 9)  # not asked
    mask = np.array([[True] * 3, [True, True, False]])
    errors = hit_errors(
        true,
        given,
        mask,
        lambda points: points[:, 1:] * 10.0,
        lambda points: points[:, ::2] * 20.0,
        3.0,
        21.0,
    )
    np.testing.assert_allclose(errors.distance, [[0.0, 0.5, 4.0], [np.nan] * 3])
    np.testing.assert_allclose(errors.texels, [[0.0, 5.0, 40.0], [np.nan] * 3])
    np.testing.assert_allclose(errors.pixels, [[1.5, 9.5, 21.0], [np.nan] * 3])
    assert (errors.missed, errors.false) == (0.25, 1.0)
    assert errors.beyond == pytest.approx(2.0 / 3.0)


def test_places_in_a_texture():
    camera = scenes.look_at((0.0, -10.0, 0.0), (0.0, 0.0, 0.0), (1, 1), fov=np.pi / 2.0)
    places = texture_places(camera.view, camera.projection, (100, 50))
    found = places(np.array([[0.0, 0.0, 0.0], [5.0, 0.0, -10.0]]))
    np.testing.assert_allclose(found, [[50.0, 25.0], [75.0, 0.0]], atol=1e-9)


def test_what_hides_a_point_from_a_texture_camera():
    """A box in the water hides what is behind it; what stands in the air does not."""
    bed, box = scenes.grid_mesh("bed", 2, 60.0, -3.0), scenes.box_mesh("box", (1.0, 0.1, 0.5))
    sand = scenes.Material("sand", np.ones(3))
    sunken, dry = scenes.translation(0.0, 0.0, -1.0), scenes.translation(10.0, 0.0, 1.0)
    scene = scenes.snapshot(
        (bed, box),
        (sand,),
        (("bed", "sand", [np.eye(4)]), ("box", "sand", [sunken, dry])),
        (scenes.water(half_size=30.0),),
    )
    camera = scenes.look_at((5.0, -10.0, 9.0), (5.0, 0.0, -1.0), SIZE)
    refraction = plan_frame(scene, camera, FrameSettings(technique="SIMPLE_LAKE")).bodies[0].refraction
    eye = np.array([5.0, -10.0, 9.0])

    def on_bed(through):
        sight = np.subtract(through, eye)
        return eye + sight * (-12.0 / sight[2])

    # Through the sunken box, beside it, and through the one in the air; then on the box's front.
    points = [on_bed((0.0, 0.0, -1.0)), on_bed((2.0, 0.0, -1.0)), on_bed((10.0, 0.0, 1.0)), (0.0, -0.1, -1.0)]
    found = hidden_from(refraction, np.array(points), Reference(scene).geometry)
    np.testing.assert_array_equal(found, [True, False, False, False])
