# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's picture and caustics against the reference: two programs, one model."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core.intersection import intersect
from lake_water_addon.core.waves import SineWave
from scripts.reference.measures import caustics_error, picture_error
from scripts.reference.tracer import Reference
from scripts.reference.truth import hit_errors, texture_places, true_hits
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


def test_more_steps_come_nearer_to_the_true_hits(renderer, camera):
    """The intersection algorithm's answers, by its twin on the textures that the GPU drew."""
    scene = scenes.pond(waves=RIPPLES)
    hits = true_hits(Reference(scene), camera, SIZE)
    plan, _, depth, _ = pictures.draw_textures(renderer, scene, camera, texture_size=512)
    refraction = plan.bodies[0].refraction
    view, projection = refraction.view, refraction.projection
    water = hits.water & np.isfinite(hits.refracted.distance)
    surface = hits.surface[water] @ view[:3, :3].T + view[:3, 3]
    direction = hits.refracted.direction[water] @ view[:3, :3].T

    def look_up(uv):
        at = np.clip((uv * len(depth)).astype(int), 0, len(depth) - 1)
        return depth[at[:, 1], at[:, 0]]

    def errors(steps):
        found = intersect(surface, direction, look_up, projection, steps)
        given = np.full(hits.surface.shape, np.nan)
        given[water] = (found.hit - view[:3, 3]) @ view[:3, :3]
        return hit_errors(hits.refracted.point, given, water, texture_places(view, projection, len(depth)))

    few, many = errors(2), errors(8)
    assert np.nanmedian(many.distance) < 0.02
    assert np.nanmedian(many.distance) < 0.2 * np.nanmedian(few.distance)
    assert many.beyond < few.beyond
    assert many.missed == 0.0


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
