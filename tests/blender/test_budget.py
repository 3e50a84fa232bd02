# SPDX-License-Identifier: GPL-3.0-or-later
"""The budget of a scene: what it chooses from a calibration and says, and the pace of a playing viewport."""

from __future__ import annotations

import json
from types import SimpleNamespace

import bpy
import pytest

from lake_water_addon import budget, handlers, panels
from lake_water_addon.calibration_properties import UNKNOWN
from lake_water_addon.core import parameters
from tests.blender.test_operators import draw_panel

# seconds, pixels, FLIP by texture size and samples: four fast to exact ones, the last with more samples, and
# one that is beaten by another.
POINTS = (
    (128, 1, 0.005, 4.0, 0.20),
    (256, 1, 0.010, 2.0, 0.12),
    (512, 1, 0.020, 0.9, 0.08),
    (1024, 1, 0.050, 0.4, 0.06),
    (512, 4, 0.070, 0.9, 0.03),
    (640, 1, 0.060, 0.8, 0.07),
)


def calibrated(points: tuple = POINTS, **more: object) -> bpy.types.PropertyGroup:
    """The settings of a scene with water and a calibration. more: what all points have."""
    bpy.ops.lake_water.add_water()
    settings = bpy.context.scene.lake_water
    kept = settings.calibration
    kept.technique = settings.technique
    for size, samples, seconds, pixels, flip in points:
        point = kept.points.add()
        point.settings = json.dumps({"texture_size": size, "samples": samples, **more})
        point.seconds, point.pixels, point.flip = seconds, pixels, flip
    return settings


def said(panel: type = panels._Budget) -> str:
    return " ".join(draw_panel(panel).text())


@pytest.mark.parametrize(
    ("kind", "limit", "size", "fits"),
    [
        ("TIME", 21.0, 512, True),
        ("TIME", 5000.0, 1024, True),
        ("TIME", 1.0, 128, False),
        ("PIXELS", 2.5, 256, True),
        ("PIXELS", 0.1, 1024, False),
        ("FLIP", 0.125, 256, True),
        ("FLIP", 0.01, 512, False),
    ],
)
def test_it_chooses_and_says_what_it_chose(kind: str, limit: float, size: int, fits: bool) -> None:
    settings = calibrated()
    settings.budget = kind
    setattr(settings, f"budget_{kind.lower()}", limit)
    chosen = budget.choice(bpy.context.scene)
    assert (settings.texture_size, chosen.fits) == (size, fits)
    assert settings.calibration.chosen == chosen.number
    text = said()
    assert f"texture {size}" in text
    point = settings.calibration.points[chosen.number]
    assert f"{1000 * point.seconds:.3g} ms" in text and f"FLIP {point.flip:.2g}" in text
    assert ("Nothing measured is within" in text) == (not fits)
    assert "changed" not in text


def test_time_and_pixels_leave_samples_alone_and_flip_counts_them() -> None:
    settings = calibrated()
    settings.samples, settings.viewport_samples = 6, 7
    settings.budget = "TIME"
    settings.budget = "PIXELS"
    assert (settings.samples, settings.viewport_samples) == (6, 7)
    settings.budget_flip = 0.04
    settings.budget = "FLIP"
    assert (settings.texture_size, settings.samples, settings.viewport_samples) == (512, 4, 4)


def test_time_goes_by_the_error_of_the_calibration() -> None:
    """By FLIP 640 is no better than 1024 that takes less; the point of four samples is for no viewport."""
    settings = calibrated((*POINTS, (300, 1, 0.015, 5.0, 0.05)))
    settings.budget_time = 30.0
    settings.budget = "TIME"
    assert settings.texture_size == 512
    settings.calibration.measure = "FLIP"
    budget.apply(bpy.context.scene)
    assert settings.texture_size == 300


def test_settings_of_a_technique_reach_every_water() -> None:
    bpy.context.scene.lake_water.technique = "TRACED"
    settings = calibrated(traced_march_steps=77)
    bpy.ops.lake_water.add_water()
    settings.budget = "TIME"
    waters = handlers.waters(bpy.context.scene)
    assert [obj.lake_water.traced.march_steps for obj in waters] == [77, 77]
    waters[0].lake_water.traced.march_steps = 5
    assert not budget.is_applied(bpy.context.scene, budget.choice(bpy.context.scene))


def test_a_new_calibration_is_chosen_from_at_once() -> None:
    settings = calibrated()
    settings.budget_time = 21.0
    settings.budget = "TIME"
    settings.calibration.points.clear()
    for size, seconds in ((64, 0.01), (2048, 0.02)):
        point = settings.calibration.points.add()
        point.settings = json.dumps({"texture_size": size})
        point.seconds, point.pixels = seconds, 1.0 / size
    handlers.notify_calibrated(bpy.context.scene)
    assert settings.texture_size == 2048


def test_changes_by_hand_are_told_and_can_be_taken_back() -> None:
    settings = calibrated()
    settings.budget = "TIME"
    settings.texture_size = 99
    assert "Settings were changed since" in said()
    assert "lake_water.apply_budget" in draw_panel(panels._Budget).buttons
    assert bpy.ops.lake_water.apply_budget() == {"FINISHED"}
    assert settings.texture_size == 512 and "changed" not in said()
    settings.budget = "OFF"
    with pytest.raises(RuntimeError, match="The scene has no budget"):
        bpy.ops.lake_water.apply_budget()
    assert said() == ""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda kept: kept.points.clear(), "calibrate first"),
        (lambda kept: setattr(kept, "technique", "POND"), "of the technique Pond: calibrate again"),
        (lambda kept: setattr(kept.points[2], "settings", "broken"), "cannot be read: calibrate again"),
    ],
)
def test_without_a_calibration_of_use_nothing_changes_and_the_remedy_is_told(change, message: str) -> None:
    settings = calibrated()
    change(settings.calibration)
    before = settings.texture_size
    settings.budget = "PIXELS"
    assert settings.texture_size == before
    assert message in said()
    assert draw_panel(panels._Budget).buttons == ["lake_water.calibrate"]
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.lake_water.apply_budget()


def test_an_error_that_could_not_be_measured_is_told() -> None:
    settings = calibrated(tuple((*point[:4], UNKNOWN) for point in POINTS))
    settings.budget = "FLIP"
    assert "could not measure FLIP" in said()
    settings.budget = "PIXELS"
    assert "FLIP" not in said() and " px" in said()


def test_reset_ends_it_and_keeps_the_calibration() -> None:
    settings = calibrated()
    settings.budget = "TIME"
    bpy.ops.lake_water.reset_parameters()
    assert settings.budget == "OFF"
    assert len(settings.calibration.points) == len(POINTS)


def test_it_is_no_part_of_a_preset() -> None:
    assert not any("budget" in name or "quality" in name for name in parameters.SCENE)


# While an animation plays


@pytest.fixture
def pacing() -> budget.Pacing:
    """Of a host without a GPU."""
    targets = SimpleNamespace(spares=0)
    targets.free_spares = lambda: setattr(targets, "spares", 0)
    return budget.Pacing(SimpleNamespace(renderer=SimpleNamespace(targets=targets)))


def region(number: int = 1) -> SimpleNamespace:
    return SimpleNamespace(as_pointer=lambda: number)


@pytest.fixture
def playing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "is_playing", lambda: True)


def test_only_a_playing_scene_with_a_time_budget_is_paced(
    pacing: budget.Pacing, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, scene = calibrated(), bpy.context.scene
    targets = pacing._host.renderer.targets
    for kind in ("OFF", "PIXELS", "TIME"):
        settings.budget = kind
        assert pacing.of(region(), scene) is None
        assert (targets.spares > 0) == (kind == "TIME")
    monkeypatch.setattr(budget, "is_playing", lambda: True)
    pace = pacing.of(region(), scene)
    assert pace.budget == pytest.approx(0.033)
    assert [point.settings for point in pace.front] == [{"texture_size": n} for n in (128, 256, 512, 1024)]
    assert pace.point.settings == {"texture_size": 512}
    settings.budget = "OFF"
    assert pacing.of(region(), scene) is None
    assert targets.spares == 0


def test_a_region_keeps_its_pace_until_something_changes(pacing: budget.Pacing, playing: None) -> None:
    settings, scene = calibrated(), bpy.context.scene
    settings.budget = "TIME"
    first, other = pacing.of(region(1), scene), pacing.of(region(2), scene)
    assert first is not other
    assert pacing.of(region(1), scene) is first and pacing.of(region(2), scene) is other
    settings.budget_time = 12.0
    second = pacing.of(region(1), scene)
    assert second is not first and second.point.settings == {"texture_size": 256}
    settings.calibration.points[1].seconds = 0.013
    assert pacing.of(region(1), scene).point.settings == {"texture_size": 128}
    settings.technique = "RIPPLE"
    assert pacing.of(region(1), scene) is None
    for number in range(3 * budget.REGIONS):
        pacing.of(region(number), scene)
    assert len(pacing._paces) == budget.REGIONS


def test_a_watch_waits_for_the_gpu_only_in_frames_that_are_measured(
    pacing: budget.Pacing, playing: None
) -> None:
    calibrated().budget = "TIME"
    pace = pacing.of(region(), bpy.context.scene)
    waits = []
    frames = 30
    for _ in range(frames):
        watch = budget.Watch(pace, lambda: waits.append(1))
        watch.stop()
    assert 2 * (frames // pace.EVERY) - 2 <= len(waits) <= 2 * (frames // pace.EVERY) + 2
    assert pace.seconds > 0.0
    budget.Watch(None, lambda: pytest.fail("waited")).stop()


def test_what_it_plays_with_is_told(pacing: budget.Pacing, playing: None) -> None:
    calibrated().budget = "TIME"
    pace = pacing.of(region(), bpy.context.scene)
    assert budget.describe(pace) == "point 3 of 4"
    pace.record(0.0125, 0.0)
    assert budget.describe(pace) == "point 3 of 4, 12.5 ms"
    budget.publish(budget.describe(pace))
    assert "Playing with point 3 of 4, 12.5 ms" in said()
