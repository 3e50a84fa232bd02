# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's picture and caustics against the reference: two programs, one model."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core.waves import SineWave
from scripts.reference.measures import caustics_error, picture_error
from scripts.reference.tracer import Reference
from scripts.reference.truth import technique_errors, true_hits
from tests.gpu import pictures, scenes
from tests.gpu.glsl import read_texture

SIZE = (96, 72)
RIPPLES = (SineWave(0.03, 2.0, 0.2), SineWave(0.02, 1.3, -0.4, 1.0))
FINE = {"texture_size": 1024, "intersection_steps": 8, "use_shadows": True, "use_caustics": True}


@pytest.fixture(scope="module")
def camera():
    return scenes.look_at((0.0, -9.0, 5.0), (0.0, 0.0, -1.0), SIZE)


def test_picture_of_calm_water(renderer, camera):
    """What is left is Schlick's term, and the texels of shadows and edges."""
    scene = scenes.pond(waves=())
    given = pictures.draw(renderer, scene, camera, SIZE, **FINE)[..., :3]
    true = Reference(scene).picture(camera, SIZE, samples=1, photons=200_000)
    water = true.water > 0.5
    assert 0.3 < water.mean() < 0.95
    error = picture_error(true.radiance, given, water)
    assert given[water].mean() == pytest.approx(true.radiance[water].mean(), rel=0.02)
    assert error.flip < 0.05
    assert picture_error(true.radiance, given, ~water).flip < 0.03


def test_caustics(renderer, camera):
    scene = scenes.pond(waves=RIPPLES)
    plan = pictures.planned(scene, camera, **FINE, caustics_size=256, photon_size=256)
    pictures.draw_plan(renderer, plan, SIZE)
    texture = renderer._caustics.target(0, 256).colors[0]
    given = read_texture(texture)[..., 0].astype(np.float64)
    counted = Reference(scene).sunlight[0].count_texture(plan.bodies[0].light.camera, 256, 1_000_000)[..., 0]
    inside = np.zeros(given.shape, bool)
    inside[12:-12, 12:-12] = True  # at the window's border the extension drops light
    error = caustics_error(counted, given, inside)
    assert error.correlation > 0.95
    assert error.energy == pytest.approx(1.0, abs=0.05)
    assert error.contrast == pytest.approx(1.0, abs=0.05)
    # Away from edges, to which the extension gives what a calm surface would, the energy is the same but for
    # Schlick's term.
    around = np.lib.stride_tricks.sliding_window_view(np.pad(counted, 4), (9, 9))
    lit = inside & (around.min(axis=(2, 3)) > 0.02)
    assert lit.mean() > 0.3
    assert caustics_error(counted, given, lit).energy == pytest.approx(1.0, abs=5e-3)


def drawn_errors(renderer, reference, camera, **options):
    """What the hits pass gives, against the true hits."""
    plan = pictures.planned(reference.snapshot, camera, **options)
    hits = renderer.draw_hits(plan, SIZE)
    return technique_errors(plan, hits, true_hits(reference, camera, SIZE))


def test_more_steps_come_nearer_to_the_true_hits(renderer, camera):
    reference = Reference(scenes.pond(waves=RIPPLES))
    few, many = (
        drawn_errors(renderer, reference, camera, texture_size=512, intersection_steps=steps).refracted
        for steps in (1, 8)
    )
    assert np.nanmedian(many.distance) < 0.02
    assert np.nanmedian(many.distance) < 0.2 * np.nanmedian(few.distance)
    assert np.nanmedian(many.pixels) < np.nanmedian(few.pixels)
    assert many.beyond < few.beyond
    assert many.missed == 0.0


def test_three_steps_of_lake(renderer, camera):
    """Half of the pixels within 2 % of the water that their ray passes."""
    reference = Reference(scenes.pond(waves=RIPPLES))
    true = true_hits(reference, camera, SIZE)
    errors = drawn_errors(renderer, reference, camera, texture_size=1024)
    part = errors.refracted.distance / true.refracted.distance
    assert errors.mask.sum() > 3000
    assert np.nanmedian(part) < 0.02


def test_techniques_in_the_order_of_their_error(renderer, camera):
    """A ray that is followed finds its place; what is seen straight and shifted does not."""
    reference = Reference(scenes.pond(waves=RIPPLES))
    found = {
        technique: drawn_errors(renderer, reference, camera, technique=technique, texture_size=1024)
        for technique in ("TRACED", "LAKE", "SIMPLE_LAKE", "POND", "RIPPLE")
    }
    refracted = {name: np.nanmedian(errors.refracted.distance) for name, errors in found.items()}
    assert refracted["TRACED"] < refracted["LAKE"] < refracted["SIMPLE_LAKE"]
    assert refracted["SIMPLE_LAKE"] < min(refracted["POND"], refracted["RIPPLE"])
    assert found["TRACED"].refracted.beyond < 0.02
    reflected = {name: np.nanmedian(errors.reflected.distance) for name, errors in found.items()}
    assert reflected["TRACED"] < 0.1 * reflected["LAKE"]
    assert found["TRACED"].reflected.missed < 0.2
    assert found["TRACED"].reflected.false < 0.2


def test_reflections_that_are_followed(renderer, camera):
    reference = Reference(scenes.pond(waves=RIPPLES))
    fixed, followed = (
        drawn_errors(renderer, reference, camera, texture_size=1024, reflection_steps=steps).reflected
        for steps in (0, 64)
    )
    assert np.nanmedian(followed.distance) < 0.1 * np.nanmedian(fixed.distance)


def test_refractions_that_are_followed(renderer, camera):
    """They need no more steps to be nearer than the search with all that it may have."""
    reference = Reference(scenes.pond(waves=RIPPLES))
    searched, followed = (
        drawn_errors(renderer, reference, camera, texture_size=1024, **steps).refracted
        for steps in ({"intersection_steps": 16}, {"refraction_steps": 16})
    )
    assert np.nanmedian(followed.pixels) <= np.nanmedian(searched.pixels)
    assert followed.beyond < 0.5 * searched.beyond


@pytest.mark.parametrize(
    ("kind", "eye", "target"),
    [("refracted", (0.5, -2, -0.8), (0, 0, 0.6)), ("reflected", (0.5, -4, -0.8), (0, 0, 0.3))],
)
def test_rays_that_are_followed_from_below(renderer, kind, eye, target):
    """Up to what stands in the pond, and down to its bowl."""
    camera = scenes.look_at(eye, target, SIZE)
    reference = Reference(scenes.pond(waves=RIPPLES))
    looked_up, followed = (
        getattr(drawn_errors(renderer, reference, camera, texture_size=1024, reflection_steps=steps), kind)
        for steps in (0, 64)
    )
    assert np.isfinite(followed.distance).sum() > 1000
    assert np.nanmedian(followed.distance) < 0.2 * np.nanmedian(looked_up.distance)
    assert followed.missed < 0.02


def test_coarse_settings_are_worse(renderer, camera):
    scene = scenes.pond(waves=RIPPLES)
    true = Reference(scene).picture(camera, SIZE, samples=1, photons=200_000)
    best = picture_error(
        true.radiance, pictures.draw(renderer, scene, camera, SIZE, **FINE)[..., :3], true.water
    )
    coarse = pictures.draw(
        renderer, scene, camera, SIZE, **{**FINE, "texture_size": 128, "intersection_steps": 1}
    )
    worse = picture_error(true.radiance, coarse[..., :3], true.water)
    assert best.flip < worse.flip
    assert best.rmse < worse.rmse
