# SPDX-License-Identifier: GPL-3.0-or-later
"""From a coarse mesh to the waves themselves, against the definition of the surface."""

from types import SimpleNamespace

import numpy as np
import pytest

from lake_water_addon.core import surface, waves
from lake_water_addon.core.waves import SineWave

LAKE = (SineWave(0.08, 4.0, 0.2), SineWave(0.06, 2.7, -0.4, 1.0), SineWave(0.03, 1.5, 0.9, 2.0))
ORIGIN = np.array([3.0, -2.0, 7.0])
SLOPE = np.array([0.05, -0.02])
"""Of a mesh of the user's, without waves."""


def drawn(count=2000, elevation=(0.3, 1.5), up=1.0):
    """Points of a mesh without its waves, which is as coarse as it gets, and unit directions to the eye."""
    rng = np.random.default_rng(11)
    point = np.append(rng.uniform(-30.0, 30.0, (count, 2)), np.zeros((count, 1)), axis=1) + ORIGIN
    point[:, 2] += (point - ORIGIN)[:, :2] @ SLOPE
    angle, rise = rng.uniform(-np.pi, np.pi, count), rng.uniform(*elevation, count)
    to_eye = np.stack([np.cos(angle) * np.cos(rise), np.sin(angle) * np.cos(rise), up * np.sin(rise)], axis=1)
    return point, to_eye


def water_body(waves_of_case, extent=(90.0, 90.0, 0.0, 0.0)):
    """What of a planned body counts here."""
    packed = waves.pack(waves_of_case, 1.0, 4.0)
    of = SimpleNamespace(heading=0.4, settings=SimpleNamespace(waves=waves_of_case))
    return SimpleNamespace(origin=ORIGIN, packed_waves=packed, extent=extent, body=of)


def found(waves_of_case, point, to_eye, most=np.inf, up=1.0):
    body = water_body(waves_of_case)
    packed = body.packed_waves
    mesh_slope = np.broadcast_to(SLOPE, (len(point), 2))
    at = surface.surface_in_sight(point, np.zeros(len(point)), mesh_slope, to_eye, most, up, body)
    offset = at.position - ORIGIN
    above = offset[:, 2] - offset[:, :2] @ SLOPE - waves.height(packed, offset[:, :2])
    return at, above, packed


@pytest.mark.parametrize("up", [1.0, -1.0], ids=["from the air", "from below"])
def test_the_place_is_on_the_waves_and_on_the_line_of_sight(up):
    """From up to 0.17 m off: within 0.1 mm of the surface where sight is not far below 20 degrees."""
    point, to_eye = drawn(up=up)
    at, above, packed = found(LAKE, point, to_eye, up=up)
    before = np.abs(waves.height(packed, (point - ORIGIN)[:, :2]))
    assert before.max() > 0.1
    assert np.quantile(np.abs(above), 0.99) < 1e-4, np.quantile(np.abs(above), 0.99)
    along = np.sum((at.position - point) * to_eye, axis=1)
    np.testing.assert_allclose(at.position, point + along[:, None] * to_eye, atol=1e-12)
    np.testing.assert_allclose(
        at.slope, SLOPE + waves.slope(packed, (at.position - ORIGIN)[:, :2]), atol=1e-12
    )


@pytest.mark.parametrize("up", [1.0, -1.0], ids=["from the air", "from below"])
@pytest.mark.parametrize("steep", [LAKE, (SineWave(1.0, 1.0, 0.3, 0.5),)], ids=["lake", "steep"])
def test_nothing_is_farther_from_the_waves_than_its_mesh(steep, up):
    """Also where sight grazes the water, or waves are steeper than any real one."""
    point, to_eye = drawn(elevation=(1e-4, 0.3), up=up)
    at, above, packed = found(steep, point, to_eye, up=up)
    before = np.abs(waves.height(packed, (point - ORIGIN)[:, :2]))
    assert np.all(np.abs(above) <= before + 1e-12) and np.isfinite(at.position).all()


def test_a_mesh_that_is_on_the_waves_is_left_alone():
    point, to_eye = drawn()
    body = water_body(LAKE)
    wave = waves.height(body.packed_waves, (point - ORIGIN)[:, :2])
    raised = point + wave[:, None] * (0.0, 0.0, 1.0)
    mesh_slope = np.broadcast_to(SLOPE, (len(point), 2))
    at = surface.surface_in_sight(raised, wave, mesh_slope, to_eye, np.inf, 1.0, body)
    np.testing.assert_allclose(at.position, raised, atol=1e-12)


def test_the_eye_is_never_passed():
    """Water that would be nearer than the eye is taken to be at the nearest place that is allowed."""
    point, to_eye = drawn(elevation=(0.01, 0.1))
    most = np.full(len(point), 0.2)
    at, _, _ = found(LAKE, point, to_eye, most)
    assert np.all(np.sum((at.position - point) * to_eye, axis=1) <= most + 1e-12)


def test_places_stay_in_the_water_and_face_the_eye():
    """No texture is drawn for what is beyond its rectangle or over the highest wave; no back is seen."""
    point, to_eye = drawn(elevation=(0.01, 0.4))
    body = water_body(LAKE, extent=(20.0, 12.0, 1.0, -3.0))
    within = surface.is_in_body(point, body)
    assert 0.1 < within.mean() < 0.9
    mesh_slope = np.broadcast_to(SLOPE, (len(point), 2))
    at = surface.surface_in_sight(point, np.zeros(len(point)), mesh_slope, to_eye, np.inf, 1.0, body)
    moved = np.any(at.position != point, axis=1)
    assert np.mean(moved[within]) > 0.5
    assert surface.is_in_body(at.position, body)[moved].all()
    offset = at.position - ORIGIN
    height = offset[:, 2] - offset[:, :2] @ SLOPE
    assert np.abs(height[moved]).max() <= sum(wave.amplitude for wave in LAKE) + 1e-12
    facing = to_eye[:, 2] - np.sum(at.slope * to_eye[:, :2], axis=1)
    assert facing[moved].min() > 0.0
