# SPDX-License-Identifier: GPL-3.0-or-later
"""The registry of techniques, and what a plan makes of each entry."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lake_water_addon.core import cameras
from lake_water_addon.core.plan import SCHLICK, plan_frame
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import WaterSettings
from lake_water_addon.core.technique_pond import PondSettings
from lake_water_addon.core.technique_settings import MAX_VALUES, pack
from lake_water_addon.core.technique_traced import TracedSettings
from lake_water_addon.core.techniques import DEFAULT_TECHNIQUE, TECHNIQUES, RefractionMap
from tests.gpu import scenes

SHADERS = Path(__file__).resolve().parents[2] / "lake_water_addon" / "gpu_shaders"
CAMERA = scenes.look_at((6, -9, 5), (0, 0, 0))
every_technique = pytest.mark.parametrize("key", TECHNIQUES)


def planned(key, **settings):
    return plan_frame(scenes.pond(**settings), CAMERA, FrameSettings(technique=key))


def test_stored_choices_keep_their_place():
    """A file stores a choice by its number."""
    assert DEFAULT_TECHNIQUE == "LAKE"
    assert list(TECHNIQUES) == ["LAKE", "SIMPLE_LAKE", "POND", "RIPPLE", "TRACED"]


@every_technique
def test_an_entry_names_what_there_is(key):
    technique = TECHNIQUES[key]
    assert (SHADERS / f"technique_{key.lower()}_lib.glsl").is_file()
    known = {f.name for f in dataclasses.fields(WaterSettings)}
    known |= {f.name for f in dataclasses.fields(FrameSettings)}
    assert technique.reads <= known
    if technique.settings is not None:
        own = technique.settings()
        assert len(pack(own, 1.0)) <= MAX_VALUES
        assert hash(own) == hash(technique.settings())
    assert not technique.spectral or hasattr(technique.settings(), "absorption")


@every_technique
def test_settings_have_texts_and_limits(key):
    for field in dataclasses.fields(TECHNIQUES[key].settings) if TECHNIQUES[key].settings else ():
        assert field.metadata["name"], field.name
        assert field.metadata["description"], field.name
        low, high = field.metadata.get("min", -np.inf), field.metadata.get("max", np.inf)
        assert np.all((np.array(field.default) >= low) & (np.array(field.default) <= high)), field.name


@every_technique
def test_refraction_is_seen_from_the_camera_of_its_map(key):
    plan = planned(key)
    body, wanted = plan.bodies[0], TECHNIQUES[key].refraction
    view, n12 = plan.camera.view, 1.0 / body.body.settings.ior
    if wanted is RefractionMap.TURNED:
        expected = cameras.refraction_view(view, plan.camera.projection, 0.0, n12)
        assert not np.allclose(expected, view)
    elif wanted is RefractionMap.APPARENT:
        scale = (np.linalg.inv(view) @ body.refraction.view)[2, 2]
        assert 0.2 < scale < n12
        expected = cameras.flattened_view(view, 0.0, scale)
    else:
        expected = view
    np.testing.assert_allclose(body.refraction.view, expected, atol=1e-12)
    assert body.refraction.keep == (0 if wanted is RefractionMap.WHOLE else 1)


def test_apparent_depth_does_not_flicker():
    """Neither jitter nor a border changes the camera; a small turn changes it a little."""
    scene, settings = scenes.pond(), FrameSettings(technique="TRACED")

    def scale(camera=CAMERA, **options):
        plan = plan_frame(scene, camera, settings, **options)
        return (np.linalg.inv(plan.camera.view) @ plan.bodies[0].refraction.view)[2, 2]

    whole = scale()
    assert scale(jitter=(0.01, 0.02)) == whole
    assert scale(window=(0.2, 0.1, 0.7, 0.9)) == whole
    assert scale(scenes.look_at((6.0, -9.0, 5.05), (0, 0, 0))) == pytest.approx(whole, abs=0.01)


def test_apparent_depth_of_parallel_rays_is_that_of_their_angle():
    camera = scenes.look_at((6, -9, 5), (0, 0, 0), ortho=8.0)
    plan = plan_frame(scenes.pond(), camera, FrameSettings(technique="TRACED"))
    scale = (np.linalg.inv(plan.camera.view) @ plan.bodies[0].refraction.view)[2, 2]
    cosine = plan.camera.view[2, 2]
    assert scale == pytest.approx(float(cameras.apparent_depth(cosine, 1.0 / 1.333)), rel=1e-9)


@pytest.mark.parametrize(
    ("key", "own", "waves"),
    [
        ("LAKE", (), True),
        ("RIPPLE", (), False),
        ("POND", (), False),
        ("POND", (PondSettings(geometric_waves=True),), True),
        ("POND", (TracedSettings(),), False),
    ],
)
def test_flat_techniques_have_no_waves(key, own, waves):
    body = planned(key, own=own).bodies[0]
    assert (len(body.packed_waves) > 0) == waves
    assert (len(body.body.settings.waves) > 0) == waves


@every_technique
def test_light_in_the_water(key):
    """By colour where the technique knows absorption; else white light and k, and the sky as in the air."""
    body = planned(key, k=0.7, q=3.0, own=(TracedSettings(absorption=(0.5, 0.1, 0.3)),)).bodies[0]
    spectrum, settings = body.spectrum, body.body.settings
    if TECHNIQUES[key].spectral:
        assert (settings.k, settings.q) == (pytest.approx(0.3), SCHLICK)
        np.testing.assert_allclose(spectrum.absorption, (0.5, 0.1, 0.3))
        assert spectrum.sky == pytest.approx(0.9336, abs=1e-4)
        np.testing.assert_allclose(spectrum.sky_absorption, 1.193 * spectrum.absorption, rtol=1e-3)
        assert 0.99 < spectrum.sun < 1.01
    else:
        assert (settings.k, settings.q) == (0.7, 3.0)
        np.testing.assert_array_equal(spectrum.absorption, 0.7)
        assert (spectrum.sun, spectrum.sky) == (1.0, 1.0)
        np.testing.assert_array_equal(spectrum.sky_absorption, 0.0)


def test_only_lookups_near_the_surface_point_bound_the_reflection():
    whole = (0.0, 0.0, 1.0, 1.0)
    for key, technique in TECHNIQUES.items():
        region = planned(key).bodies[0].reflection.region
        assert (region != whole) == ("c" in technique.reads), key


def test_lowest_thing_in_the_water():
    """The bed of the pond lies 4 m below its surface."""
    assert planned("TRACED").bodies[0].lowest == pytest.approx(-4.0, abs=1e-6)
