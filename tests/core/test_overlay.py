# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings laid over a scene: what they reach, and that the scene itself stays as it is."""

from dataclasses import replace

import numpy as np

from lake_water_addon.core.overlay import lay_over
from lake_water_addon.core.settings import DEFAULTS
from lake_water_addon.core.snapshot import SceneSnapshot, Sky, WaterBody, WaterSettings
from lake_water_addon.core.technique_pond import PondSettings
from lake_water_addon.core.technique_traced import TracedSettings

TRACED = TracedSettings(march_steps=40, thickness=0.7)
POND = PondSettings(bias=0.9)


def scene() -> SceneSnapshot:
    """Two waters, of which one has settings of two techniques."""
    sky = Sky(np.zeros(3), np.zeros((9, 3)))
    waters = tuple(
        WaterBody(name, name, np.eye(4), WaterSettings(c=c, own=own), (9, 1.0, 1.0, 0.0, 0.0))
        for name, c, own in (("one", 2.0, (TRACED, POND)), ("other", 3.0, ()))
    )
    return SceneSnapshot(1, 0.0, {}, {}, (), sky, None, waters)


def test_settings_of_the_picture_leave_the_snapshot_itself():
    before = scene()
    frame, after = lay_over(DEFAULTS, before, {"texture_size": 128, "fov_ext": 1.1, "samples": 4})
    assert frame == replace(DEFAULTS, texture_size=128, fov_ext=1.1)
    assert after is before


def test_settings_of_the_water_reach_every_body_and_nothing_else():
    before = scene()
    frame, after = lay_over(DEFAULTS, before, {"traced_march_steps": 9, "c": 1.5})
    assert frame == DEFAULTS
    assert [body.settings.c for body in after.waters] == [1.5, 1.5]
    one, other = (body.settings for body in after.waters)
    assert one.of(TracedSettings) == replace(TRACED, march_steps=9)
    assert one.of(PondSettings) == POND
    assert other.of(TracedSettings) == TracedSettings(march_steps=9)
    assert (after.version, after.draws) == (before.version, before.draws)
    assert [body.settings.c for body in before.waters] == [2.0, 3.0]
