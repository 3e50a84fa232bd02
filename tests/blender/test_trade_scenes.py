# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of `scripts/benchmark.py trade`: what they must hold to be worth measuring; and engines."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lake_water_addon.extract import camera_from_object
from lake_water_addon.host import Host
from scripts.reference.images import read_images
from scripts.reference.tracer import Reference
from scripts.reference.truth import true_hits

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SIZE = (48, 36)
DETAIL = 0.1
NAMES = (
    "lake_near",
    "lake_far",
    "shallow_shore",
    "deep_water",
    "steep_waves",
    "grazing",
    "under_water",
    "tiled_pool",
)


@pytest.fixture(scope="module", autouse=True)
def _scripts() -> Iterator[None]:
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


def test_the_scenes_are_those(blender) -> None:
    from _trade_scenes import TRADE_SCENES

    assert tuple(TRADE_SCENES) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_there_is_something_to_refract_and_to_reflect(blender, name: str) -> None:
    from _trade_scenes import FRAME, open_scene

    built = open_scene(name, SIZE, DETAIL)
    scene = blender.context.scene
    snapshot = Host().extractor.snapshot(blender.context.evaluated_depsgraph_get())
    hits = true_hits(
        Reference(snapshot, read_images(snapshot)), camera_from_object(built.camera, scene, *SIZE), SIZE
    )
    assert scene.frame_current == FRAME
    assert not scene.lake_water.use_glow
    assert snapshot.sun.direction[2] > math.sin(math.radians(25.0)), "caustics need a high sun"
    assert hits.water.mean() > 0.3
    assert hits.from_air.all() == (name != "under_water")
    for ends, least in ((hits.refracted, 0.02), (hits.reflected, 0.1)):
        assert np.isfinite(ends.distance[hits.water]).mean() > least


def test_the_deep_water_hides_its_bottom_in_part(blender) -> None:
    """By absorption alone."""
    from _trade_scenes import open_scene

    built = open_scene("deep_water", SIZE, DETAIL)
    snapshot = Host().extractor.snapshot(blender.context.evaluated_depsgraph_get())
    camera = camera_from_object(built.camera, blender.context.scene, *SIZE)
    hits = true_hits(Reference(snapshot, read_images(snapshot)), camera, SIZE)
    left = np.exp(-built.water.lake_water.k * hits.refracted.distance[hits.water])
    assert (left < 0.05).mean() > 0.15
    assert (left > 0.2).mean() > 0.15


def test_the_steep_waves_are_steep(blender) -> None:
    from _trade_scenes import open_scene

    waves = open_scene("steep_waves", SIZE, DETAIL).water.lake_water.waves
    assert max(wave.amplitude / wave.wavelength for wave in waves) == pytest.approx(1.0 / 12.0, rel=0.05)


def test_an_engine_renders_and_what_it_made_is_kept(blender, tmp_path: Path) -> None:
    from _trade_engines import Engine, engine_points

    engine = Engine("Cycles", "CYCLES", 1, {"use_denoising": False})

    def points(**options: float) -> list:
        wanted = {"size": (16, 12), "folder": tmp_path, "engines": (engine,), "quiet": True}
        return list(engine_points("tiled_pool", **wanted, **options))

    (first,) = points()
    assert first.settings == {"engine": "CYCLES", "samples": 1, "use_denoising": False}
    assert first.picture.shape == (12, 16, 3)
    assert np.isfinite(first.picture).all()
    # Upright: sky over the pool.
    assert first.picture[-2:].mean() > first.picture[:6].mean()
    assert first.seconds > 0.0
    (kept,) = points()
    assert kept.seconds == first.seconds
    np.testing.assert_array_equal(kept.picture, first.picture)
    (again,) = points(others_at_most=-1.0)
    assert again.seconds != first.seconds
    np.testing.assert_allclose(again.picture, first.picture, rtol=1e-4)
