# SPDX-License-Identifier: GPL-3.0-or-later
"""The calibration: what it measures against closed forms, what it keeps, and what it says where it cannot."""

from __future__ import annotations

import json
import math

import bpy
import numpy as np
import pytest

from lake_water_addon import bench, calibration, calibration_plot, handlers, water_objects
from lake_water_addon.core import cameras, candidates, optics, waves
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.extract import camera_from_object
from lake_water_addon.host import Host, frame_settings

pytestmark = pytest.mark.usefixtures("gpu")

SIZE = (96, 72)
DEPTH = 1.5
IOR = 1.333


def look_at(eye: tuple[float, float, float], target: tuple[float, float, float]) -> bpy.types.Object:
    from mathutils import Vector

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.collection.objects.link(camera)
    camera.location = eye
    camera.rotation_euler = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = camera
    return camera


def pool(*, calm: bool = False) -> bpy.types.Object:
    """Water over a level bottom with some posts, a sun, and a camera that sees it. Returns the water."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60.0, location=(0.0, 0.0, -DEPTH))
    for x in () if calm else (-2.0, 0.0, 2.0):
        bpy.ops.mesh.primitive_cube_add(size=0.6, location=(x, 1.0, -0.2), scale=(1.0, 1.0, 4.0))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (0.5, 0.2, 0.0)
    bpy.context.collection.objects.link(sun)
    water = water_objects.create_water("Water", 20.0, 20.0, bpy.context.collection, (0.0, 0.0, 0.0))
    water.lake_water.k, water.lake_water.ior = 0.2, IOR
    if calm:
        water_objects.set_waves(water, [])
    look_at((0.0, -7.0, 4.0), (0.0, 0.0, 0.0))
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.lake_water.samples = 2
    bpy.context.view_layer.update()
    return water


def new_bench(**settings) -> bench.Bench:
    scene = bpy.context.scene
    for name, value in settings.items():
        setattr(scene.lake_water, name, value)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    host = Host()
    camera = camera_from_object(scene.camera.evaluated_get(depsgraph), scene, *SIZE)
    made = bench.Bench(host.snapshot(depsgraph), frame_settings(scene), camera, SIZE, host)
    assert list(made.look())[-1] == 1.0
    return made


def flip_of(found: bench.Bench, settings: dict, samples: int) -> float:
    assert [done for done, _ in found.draw(settings, samples)] == list(range(1, samples + 1))
    return found.flip(samples)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few candidates, so that a test takes seconds."""
    values = {"intersection_steps": (1, 4), "traced_march_steps": (4, 32)}
    geometry = {name: tuple({name: value} for value in of) for name, of in values.items()}
    monkeypatch.setattr(candidates, "GEOMETRY", geometry)
    monkeypatch.setattr(candidates, "RATIOS", (0.7, 2.7))
    monkeypatch.setattr(candidates, "GRIDS", (2,))
    monkeypatch.setattr(candidates, "LIGHT", {"caustics": candidates.LIGHT["caustics"][:2]})
    small = {"caustics_size": 256, "photon_size": 128, "light_depth_size": 512, "least_grid_resolution": 64}
    monkeypatch.setattr(candidates, "BEST", candidates.BEST | small | {"reflection_steps": 16})
    monkeypatch.setattr(bench, "FRAMES_SECONDS", 0.05)
    monkeypatch.setattr(calibration, "QUALITIES", {"DRAFT": calibration.QUALITIES["DRAFT"]})
    monkeypatch.setattr(calibration, "REFERENCE_SAMPLES", (4, 2))
    monkeypatch.setattr(calibration, "COMBINATIONS", 2)
    monkeypatch.setattr(calibration, "SAMPLES", {3: 1})
    monkeypatch.setattr(bench, "PIXELS", 100)


# Rays


def test_rays_of_calm_water_end_where_snell_has_them() -> None:
    pool(calm=True)
    found = new_bench(intersection_steps=1)
    for _, truth in found._truths:
        assert len(truth.rows) == bench.PIXELS
        eye = np.array(bpy.context.scene.camera.matrix_world.translation)
        assert np.abs(truth.surface[:, 2]).max() < 1e-6
        sight = truth.surface - eye
        level = sight[:, :2] / np.linalg.norm(sight[:, :2], axis=1, keepdims=True)
        sine = np.linalg.norm(sight[:, :2], axis=1) / np.linalg.norm(sight, axis=1)
        below = sine / IOR
        want = truth.surface[:, :2] + level * (DEPTH * below / np.sqrt(1.0 - below**2))[:, None]
        np.testing.assert_allclose(truth.refracted[:, :2], want, atol=1e-4)
        np.testing.assert_allclose(truth.refracted[:, 2], -DEPTH, atol=1e-5)
        assert not np.isfinite(truth.reflected).any()  # the sky
        fresnel = optics.fresnel_dielectric(np.sqrt(1.0 - sine**2), 1.0 / IOR)
        np.testing.assert_allclose(truth.fresnel, fresnel, atol=1e-6)


def test_one_step_is_off_by_what_it_takes_for_the_way() -> None:
    """W is U + |A1 - U| R, where A1 is the level bottom behind U as the turned camera sees it: off by the
    difference to the ray's own way through calm water. Eight steps find a level bottom."""
    pool(calm=True)
    found = new_bench(texture_size=1024)
    off = []
    for after, truth in found._truths:
        eye = cameras.eye_position(found.plan(found.frame, after=after).bodies[0].refraction.view)
        sight = truth.surface - eye
        straight = np.linalg.norm(sight, axis=1) * DEPTH / -sight[:, 2]
        off.append(np.abs(straight - np.linalg.norm(truth.refracted - truth.surface, axis=1)))
    one = found.ray_errors({"intersection_steps": 1})
    assert one.metres == pytest.approx(np.median(np.concatenate(off)), rel=0.02)  # some leave the texture
    eight = found.ray_errors({"intersection_steps": 8})
    assert eight.metres < 0.01
    assert eight.texels < 1.0
    assert eight.pixels < 0.3 * one.pixels


def test_the_surface_is_the_sum_of_sines_and_not_its_triangles() -> None:
    water = pool()
    water.lake_water.grid_resolution = 40
    found = new_bench()
    for after, truth in found._truths:
        body = found.plan(found.frame, after=after).bodies[0]
        height = waves.height(body.packed_waves, truth.surface[:, :2] - body.origin[:2])
        on_it = np.abs(truth.surface[:, 2] - body.origin[2] - height) < 1e-6
        assert on_it.mean() > 0.98


def test_a_mesh_has_the_normals_that_it_is_shaded_with() -> None:
    """A flat mesh and a grid of the same water have the same truth."""
    water = pool()
    found = {}
    for surface in ("GRID", "MESH"):
        water.lake_water.surface = surface
        bpy.context.view_layer.update()
        if surface == "MESH":
            with bpy.context.temp_override(object=water, active_object=water):
                modifier = water.modifiers.new("Fine", "SUBSURF")
                modifier.subdivision_type, modifier.levels = "SIMPLE", 6
            bpy.context.view_layer.update()
        truths = new_bench()._truths
        found[surface] = np.nanmedian(np.concatenate([t.refracted[:, 2] for _, t in truths]))
    assert found["MESH"] == pytest.approx(found["GRID"], abs=1e-3)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_errors_hold_for_other_pixels_and_times(technique: str) -> None:
    pool()
    found = new_bench(technique=technique, texture_size=256)
    here = found.ray_errors({})
    there = found.other_ray_errors({}, (5.1, 9.3, 17.7), seed=4)
    assert here.pixels > 0.0
    for name in ("metres", "texels", "pixels"):
        assert 1 / 1.5 < getattr(there, name) / getattr(here, name) < 1.5, name


def test_flip_is_none_against_itself_and_grows_with_coarseness() -> None:
    pool()
    found = new_bench()
    fine = {"texture_size": 256, "intersection_steps": 4}
    assert list(found.take_reference(fine, 3, 3, 1.0))[-1] == 1.0
    assert flip_of(found, fine, 3) < 1e-6
    coarse = flip_of(found, {"texture_size": 32, "intersection_steps": 1}, 3)
    assert 0.02 < coarse < 1.0


def test_parts_of_a_large_picture_stand_for_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pool()
    values = []
    for whole in (bench.WHOLE_PICTURE, 0):
        monkeypatch.setattr(bench, "WHOLE_PICTURE", whole)
        monkeypatch.setattr(bench, "WINDOW", (24, 24))
        found = new_bench()
        list(found.take_reference({"texture_size": 256}, 2, 2, 1.0))
        values.append(flip_of(found, {"texture_size": 32}, 2))
    assert len(found._windows) == bench.WINDOWS
    assert values[1] == pytest.approx(values[0], rel=0.3)


# The operator


def test_it_measures_and_keeps(few: None) -> None:
    pool()
    scene = bpy.context.scene
    held = {name: getattr(scene.lake_water, name) for name in ("texture_size", "technique", "samples")}
    heard = []
    listener = handlers.Listener(calibrated=heard.append)
    handlers.subscribe(listener)
    blocks = len(bpy.data.images), len(bpy.data.objects), len(bpy.data.scenes)
    try:
        assert bpy.ops.lake_water.calibrate() == {"FINISHED"}
    finally:
        handlers.unsubscribe(listener)
    assert heard == [scene]
    assert blocks == (len(bpy.data.images) - 1, len(bpy.data.objects), len(bpy.data.scenes))
    assert held == {name: getattr(scene.lake_water, name) for name in held}
    kept = scene.lake_water.calibration
    assert (kept.technique, tuple(kept.resolution), kept.view) == ("LAKE", SIZE, 'camera "Camera"')
    assert kept.device and kept.date and kept.signature
    assert kept.chosen == -1
    settings = [calibration.settings_of(point) for point in kept.points]
    assert settings[0]["texture_size"] == scene.lake_water.texture_size
    assert settings[0]["samples"] == scene.lake_water.samples
    assert len({json.dumps(s, sort_keys=True) for s in settings}) == len(settings) >= 7
    for point in kept.points:
        assert 0.0 < point.seconds < 60.0
        assert min(point.metres, point.texels, point.pixels, point.flip) >= 0.0
    for measure in ("PIXELS", "FLIP"):
        front = calibration.front(scene, measure)
        assert len(front) >= 2
        assert [p.seconds for p in front] == sorted(p.seconds for p in front)
        assert [p.error for p in front] == sorted((p.error for p in front), reverse=True)
    lit = candidates.light_of(settings[0])
    assert all(candidates.light_of(p.settings) == lit for p in calibration.front(scene, "PIXELS"))
    assert any(s["samples"] == 3 for s in settings)
    more, one = (
        next(p for s, p in zip(settings, kept.points, strict=True) if s["samples"] == n) for n in (3, 1)
    )
    assert more.seconds > 0.0 < one.seconds
    image = bpy.data.images[calibration_plot.NAME]
    assert tuple(image.size) == calibration_plot.SIZE
    assert image.packed_file is not None


def test_a_click_takes_the_settings_of_a_point(few: None) -> None:
    water = pool()
    scene = bpy.context.scene
    scene.lake_water.technique = "TRACED"
    bpy.ops.lake_water.calibrate()
    kept = scene.lake_water.calibration
    for number in (1, len(kept.points) - 1):
        kept.chosen = number
        settings = calibration.settings_of(kept.points[number])
        assert water.lake_water.traced.march_steps == settings["traced_march_steps"]
        assert scene.lake_water.texture_size == settings["texture_size"]
        assert scene.lake_water.samples == scene.lake_water.viewport_samples == settings["samples"]
    bpy.ops.lake_water.reset_parameters()
    assert len(kept.points) > number


def test_it_is_saved_with_the_file(few: None, tmp_path) -> None:
    pool()
    bpy.ops.lake_water.calibrate()
    before = [(p.settings, p.seconds, p.pixels) for p in bpy.context.scene.lake_water.calibration.points]
    path = str(tmp_path / "pool.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    kept = bpy.context.scene.lake_water.calibration
    assert [(p.settings, p.seconds, p.pixels) for p in kept.points] == before
    assert bpy.ops.lake_water.show_calibration() == {"FINISHED"}  # the plot itself is drawn anew
    pixels = np.empty(4 * math.prod(calibration_plot.SIZE), np.float32)
    bpy.data.images[calibration_plot.NAME].pixels.foreach_get(pixels)
    assert np.ptp(pixels.reshape(-1, 4)[:, 0]) > 0.5


def test_what_changed_since_is_said(few: None) -> None:
    water = pool()
    scene = bpy.context.scene
    bpy.ops.lake_water.calibrate()
    assert calibration.differences(scene, SIZE) == []
    assert "640 x 480" in calibration.differences(scene, (640, 480))[0]
    water.lake_water.waves[0].amplitude *= 2.0
    assert "changed" in calibration.differences(scene, SIZE)[0]
    water.lake_water.waves[0].amplitude /= 2.0
    scene.lake_water.technique = "POND"
    assert "Pond" in calibration.differences(scene, SIZE)[0]
    scene.lake_water.calibration.device = "another"
    assert "another" in calibration.differences(scene, SIZE)[1]


def run_into_trouble() -> str:
    with pytest.raises(RuntimeError) as error:
        bpy.ops.lake_water.calibrate()
    return str(error.value)


def test_without_a_picture_of_water_it_says_so(few: None) -> None:
    water = pool()
    scene = bpy.context.scene
    bpy.ops.lake_water.calibrate()
    before = [p.settings for p in scene.lake_water.calibration.points]
    camera = scene.camera
    camera.location.z = -0.5
    bpy.context.view_layer.update()
    assert "in the water" in run_into_trouble()
    camera.location.z, camera.rotation_euler = 4.0, (math.pi, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert "out of the picture" in run_into_trouble()
    camera.rotation_euler = (0.0, 0.0, 0.0)
    bpy.ops.mesh.primitive_plane_add(size=60.0, location=(0.0, 0.0, 1.0))
    bpy.context.view_layer.update()
    assert "No pixel of the picture shows water" in run_into_trouble()
    camera.data.type = "PANO"
    assert "draws perspective and orthographic cameras only" in run_into_trouble()
    scene.camera = None
    assert "no camera" in run_into_trouble()
    scene.camera = camera
    camera.data.type = "PERSP"
    bpy.data.objects.remove(water)
    assert "no water" in run_into_trouble()
    assert [p.settings for p in scene.lake_water.calibration.points] == before


def test_points_by_other_hands_are_refused_in_words(few: None) -> None:
    pool()
    bpy.ops.lake_water.calibrate()
    kept = bpy.context.scene.lake_water.calibration
    for text in ("[]", "{"):
        kept.points[2].settings = text
        with pytest.raises(ValueError, match="calibrate anew"):
            calibration.front_points(kept, "FLIP")


# The plot


def test_the_plot_shows_front_and_choice() -> None:
    kept = bpy.context.scene.lake_water.calibration
    for seconds, pixels, flip in ((0.01, 4.0, 0.2), (0.02, 2.0, 0.1), (0.03, 3.0, 0.0), (0.3, 1.0, -1.0)):
        point = kept.points.add()
        point.settings = json.dumps({"texture_size": int(1000 * seconds)})
        point.seconds, point.pixels, point.flip = seconds, pixels, flip
    kept.technique, kept.resolution, kept.view = "LAKE", (640, 480), "3D view"
    pixels = calibration_plot.draw(kept)
    assert pixels.shape == (500, 800, 4)
    front = np.abs(pixels[..., :3] - calibration_plot.FRONT).max(axis=2) < 0.02
    left, right = front[60:, :430], front[60:, 430:]
    assert left.sum() > 200 < right.sum()
    white = np.abs(pixels[60:430, :, :3] - 1.0).max(axis=2) < 0.02
    assert white.sum() == 0
    kept.chosen = 1
    chosen = calibration_plot.draw(kept)
    white = np.abs(chosen[60:430, :, :3] - 1.0).max(axis=2) < 0.02
    assert white[:, :430].sum() > 20 < white[:, 430:].sum()
    assert calibration_plot.point_text(kept.points[3]) == "300 ms, 1 px"


def test_a_plot_of_one_point_or_none_is_drawn_too() -> None:
    kept = bpy.context.scene.lake_water.calibration
    assert calibration_plot.update_image(bpy.context.scene) is None
    point = kept.points.add()
    point.settings, point.seconds, point.pixels, point.flip = "{}", 0.01, 1.0, -1.0
    assert np.isfinite(calibration_plot.draw(kept)).all()
