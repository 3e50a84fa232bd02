# SPDX-License-Identifier: GPL-3.0-or-later
"""Which settings a calibration measures."""

from __future__ import annotations

import pytest

from lake_water_addon.core import candidates
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.core.trade import Point, pareto_front


def of(technique="LAKE", longer_side=800, sunlit=True, largest=16384, own=None, grid=None, **settings):
    frame = FrameSettings(technique=technique, **settings)
    if technique == "TRACED":
        own = {"traced_march_steps": 40, "traced_bisection_steps": 6, "traced_thickness": 0.5}
    return candidates.axes(frame, own or {}, longer_side, sunlit=sunlit, largest=largest, grid=grid)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_only_what_the_technique_reads_is_turned(technique):
    found = of(technique)
    assert ("intersection_steps" in found.current) == (technique == "LAKE")
    assert ("reflection_steps" in found.current) == ("reflection_steps" in TECHNIQUES[technique].reads)
    assert ("traced_march_steps" in found.current) == (technique == "TRACED")
    assert "traced_thickness" not in found.current  # a look of its own, no exactness
    assert {"texture_size", "fov_ext", "caustics_size", "light_depth_size"} <= set(found.current)
    for candidate in candidates.sweep(found):
        assert tuple(candidate) == found.names


def test_textures_follow_the_picture_and_the_device():
    sizes = [option["texture_size"] for option in of(longer_side=800).geometry["texture_size"]]
    assert sizes == [192, 384, 768, 1280, 1920, 3200]
    sizes = [option["texture_size"] for option in of(longer_side=3840).geometry["texture_size"]]
    assert sizes == [960, 1920, 3840, 4096]
    found = of(longer_side=3840, largest=2048)
    assert max(option["texture_size"] for option in found.geometry["texture_size"]) == 2048
    assert all(not isinstance(v, int) or v <= 2048 for v in found.best.values())


def test_grids_are_finer_than_the_water_s_own():
    options = [o["least_grid_resolution"] for o in of(grid=100).geometry["least_grid_resolution"]]
    assert options == [2, 128, 256]
    assert of(grid=100).base["least_grid_resolution"] == 128
    assert of(grid=1000).base["least_grid_resolution"] == 2
    assert "least_grid_resolution" not in of().current


def test_what_is_switched_off_stays_off():
    assert "caustics" not in of(use_caustics=False).light
    assert "caustics" not in of(sunlit=False).light
    assert "light_depth_size" in of(use_caustics=False).light
    assert "light_depth_size" not in of(use_caustics=False, use_shadows=False).light
    assert not any("use_caustics" in c for c in candidates.sweep(of(use_caustics=False)))


def test_the_sweep_turns_one_axis_at_a_time():
    found = of()
    swept = candidates.sweep(found)
    assert swept[0] == found.base
    axis_of = {
        name: axis for axis, options in {**found.geometry, **found.light}.items() for name in options[0]
    }
    axis_of |= {"caustics_size": "caustics", "photon_size": "caustics", "use_caustics": "caustics"}
    for candidate in swept[1:]:
        assert len({axis_of[n] for n in found.names if candidate[n] != found.base[n]}) == 1
    assert len(swept) == len({tuple(c.items()) for c in swept})


def test_the_base_lights_as_the_scene_does():
    found = of(caustics_size=333, photon_size=99, fov_ext=1.2000000476837158)
    assert found.current["fov_ext"] == 1.2
    assert candidates.light_of(found.base) == candidates.light_of(found.current)
    assert candidates.light_of({"use_caustics": False, "caustics_size": 1, "photon_size": 2}) == {
        "use_caustics": False
    }


def test_combinations_find_the_front_of_a_sum():
    """Where each option adds its own time and error, the combinations lie on the front of all."""
    found = of(use_caustics=False)
    cost = {"texture_size": 1e-3, "intersection_steps": 0.05, "reflection_steps": 0.01, "fov_ext": 0.1}

    def point(settings):
        seconds = sum(c * settings[name] for name, c in cost.items())
        return seconds, sum(0.01 / (c * settings[name] + 0.1) for name, c in cost.items())

    measured = [(settings, *point(settings)) for settings in candidates.sweep(found)]
    combined = candidates.combinations(found, found.geometry, measured, 6)
    assert 3 <= len(combined) <= 6
    every = [dict(found.base)]
    for options in found.geometry.values():
        every = [{**settings, **option} for settings in every for option in options]
    front = pareto_front([Point(s, *point(s)) for s in every])
    on_front = [p.settings for p in front]
    assert all(settings in on_front for settings in combined)
    assert combined[0] == on_front[0]
    assert combined[-1] == on_front[-1]
    assert all(candidates.light_of(s) == candidates.light_of(found.base) for s in combined)
