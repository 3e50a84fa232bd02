# SPDX-License-Identifier: GPL-3.0-or-later
"""Refraction, reflection, Fresnel and attenuation against the laws of optics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import optics

UP = np.array([0.0, 0.0, 1.0])
AIR_TO_WATER, WATER_TO_AIR = 1.0 / 1.333, 1.333
angles = st.floats(0.0, np.pi / 2 - 1e-3)


def unit_vectors(count, seed=1):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def rays_onto(normal, seed=2):
    """Random unit incident directions that arrive on the side the normals point to."""
    incident = unit_vectors(len(normal), seed)
    return np.where(np.sum(incident * normal, axis=1, keepdims=True) > 0.0, -incident, incident)


@pytest.mark.parametrize("n12", [AIR_TO_WATER, 0.25, 1.0, 1.05])
def test_refraction_obeys_snells_law(n12):
    """sin(out) = n12 sin(in), in the plane of incidence, on the other side of the surface, of unit length."""
    normal = unit_vectors(500)
    incident = rays_onto(normal)
    refracted, exists = optics.refract_direction(incident, normal, n12)
    sine_in = np.linalg.norm(np.cross(normal, incident), axis=1)
    np.testing.assert_array_equal(exists, n12 * sine_in <= 1.0)
    incident, normal, refracted = incident[exists], normal[exists], refracted[exists]
    sine_out = np.linalg.norm(np.cross(normal, refracted), axis=1)
    np.testing.assert_allclose(sine_out, n12 * sine_in[exists], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(refracted, axis=1), 1.0, atol=1e-12)
    assert np.all(np.sum(refracted * normal, axis=1) <= 0.0)
    out_of_plane = np.sum(np.cross(normal, incident) * refracted, axis=1)
    np.testing.assert_allclose(out_of_plane, 0.0, atol=1e-12)


@given(angle=angles)
def test_refraction_known_angles(angle):
    incident = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    refracted, _ = optics.refract_direction(incident, UP, AIR_TO_WATER)
    assert np.arcsin(refracted[0]) == pytest.approx(np.arcsin(np.sin(angle) / 1.333), abs=1e-9)


@given(angle=angles)
def test_refraction_is_reversible(angle):
    """Light takes the same path back out of the water."""
    incident = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    refracted, _ = optics.refract_direction(incident, UP, AIR_TO_WATER)
    back, exists = optics.refract_direction(-refracted, -UP, WATER_TO_AIR)
    assert exists
    np.testing.assert_allclose(back, -incident, atol=1e-7)


def test_total_reflection_begins_at_the_critical_angle():
    critical = np.arcsin(1.0 / 1.333)  # 48.6 degrees
    for angle, expected in ((critical - 1e-6, True), (critical + 1e-6, False), (np.pi / 2, False)):
        incident = np.array([np.sin(angle), 0.0, -np.cos(angle)])
        direction, exists = optics.refract_direction(incident, UP, WATER_TO_AIR)
        assert bool(exists) is expected
        if not expected:
            np.testing.assert_array_equal(direction, 0.0)


def test_equal_indices_do_not_bend_light():
    incident = rays_onto(np.broadcast_to(UP, (100, 3)))
    refracted, exists = optics.refract_direction(incident, UP, 1.0)
    assert exists.all()
    np.testing.assert_allclose(refracted, incident, atol=1e-12)


def test_mirroring_twice_is_the_identity():
    normal, incident = unit_vectors(200), unit_vectors(200, 2)
    once = optics.reflect_direction(incident, normal)
    np.testing.assert_allclose(np.sum(once * normal, axis=1), -np.sum(incident * normal, axis=1), atol=1e-14)
    np.testing.assert_allclose(optics.reflect_direction(once, normal), incident, atol=1e-14)


def test_reflected_directions_point_up_and_are_mirrored_where_they_already_do():
    normal = unit_vectors(500)
    normal[:, 2] = np.abs(normal[:, 2])
    incident = rays_onto(normal)
    mirrored = optics.reflect_direction(incident, normal)
    upwards = optics.reflect_upwards(incident, normal)
    np.testing.assert_allclose(np.linalg.norm(upwards, axis=1), 1.0, atol=1e-14)
    assert np.all(upwards[:, 2] > 0.99 * optics.MIN_RISE)
    good = mirrored[:, 2] > optics.MIN_RISE
    assert 50 < good.sum() < 450
    np.testing.assert_allclose(upwards[good], mirrored[good], atol=1e-14)
    downwards = mirrored[:, 2] < -optics.MIN_RISE
    np.testing.assert_allclose(upwards[downwards], mirrored[downwards] * [1.0, 1.0, -1.0], atol=1e-14)


def test_facing_normals_are_left_alone_and_others_turned_to_the_edge():
    normal, to_eye = unit_vectors(2000), unit_vectors(2000, 2)
    cosine = np.sum(normal * to_eye, axis=1)
    turned = optics.face_viewer(normal, to_eye)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-12)
    facing = cosine >= optics.MIN_COSINE
    np.testing.assert_allclose(turned[facing], normal[facing], atol=1e-14)
    after = np.sum(turned * to_eye, axis=1)
    assert np.all(after > 0.99 * optics.MIN_COSINE)
    # In the plane of both: nothing is turned sideways.
    np.testing.assert_allclose(np.sum(np.cross(normal, to_eye) * turned, axis=1), 0.0, atol=1e-12)


def test_reflectance_of_water_at_normal_incidence():
    assert optics.reflectance_at_normal(0.75) == pytest.approx(0.0204, abs=5e-5)
    assert optics.reflectance_at_normal(1.0) == 0.0
    from_below = optics.reflectance_at_normal(WATER_TO_AIR)
    assert from_below == pytest.approx(optics.reflectance_at_normal(AIR_TO_WATER))


@given(cosine=st.floats(-1.0, 2.0), f=st.floats(0.0, 1.0), q=st.floats(0.0, 100.0))
def test_schlick_stays_between_its_endpoints(cosine, f, q):
    value = float(optics.schlick(np.array(cosine), f, q))
    assert f <= value <= 1.0 + 1e-15
    assert float(optics.schlick(np.array(0.0), f, q)) == pytest.approx(1.0)
    if q > 0.0:
        assert float(optics.schlick(np.array(1.0), f, q)) == f


def test_schlick_follows_fresnels_equations():
    """The true unpolarised reflectance of water; MODEL's measured error is at most +0.059."""
    cosine = np.linspace(0.0, 1.0, 1001)
    cosine_t = np.sqrt(1.0 - (1.0 - cosine**2) / 1.333**2)
    rs = ((cosine - 1.333 * cosine_t) / (cosine + 1.333 * cosine_t)) ** 2
    rp = ((cosine_t - 1.333 * cosine) / (cosine_t + 1.333 * cosine)) ** 2
    error = optics.schlick(cosine, optics.reflectance_at_normal(AIR_TO_WATER), 5.0) - 0.5 * (rs + rp)
    assert np.max(np.abs(error)) == pytest.approx(0.059, abs=0.001)
    assert abs(error[0]) < 1e-12 and abs(error[-1]) < 1e-12


def test_a_q_of_zero_is_a_mirror():
    np.testing.assert_array_equal(optics.schlick(np.linspace(0.0, 1.0, 11), 0.0204, 0.0), 1.0)


def test_attenuation_multiplies_along_the_path():
    """Beer and Lambert: two stretches of water take what each takes; e-folding after 1 / k."""
    d = np.array([0.0, 1.0, 2.5, 40.0])
    np.testing.assert_allclose(
        optics.attenuation(0.5, d + 3.0), optics.attenuation(0.5, d) * optics.attenuation(0.5, np.array(3.0))
    )
    assert float(optics.attenuation(0.5, np.array(2.0))) == pytest.approx(np.exp(-1.0))
    np.testing.assert_array_equal(optics.attenuation(0.0, d), 1.0)
    assert float(optics.attenuation(1000.0, np.array(1e5))) == 0.0


def test_water_shows_the_bottom_when_clear_and_its_own_colour_when_deep():
    color, water = np.array([0.8, 0.4, 0.1]), np.array([0.0, 0.2, 0.1])
    np.testing.assert_allclose(optics.through_water(color, water, np.array([1.0])), color)
    np.testing.assert_allclose(optics.through_water(color, water, np.array([0.0])), water)
    np.testing.assert_allclose(optics.through_water(water, water, np.array([0.3])), water)


def test_fresnel_mix_keeps_energy():
    """F of one light and 1 - F of the other; a scene of one radiance keeps it."""
    one, other = np.array([1.0, 0.0, 2.0]), np.array([3.0, 5.0, 2.0])
    np.testing.assert_allclose(optics.mix_fresnel(one, other, np.array([0.25])), 0.75 * one + 0.25 * other)
