# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference against path tracing: the same scene in Cycles.

Sky light only. Sunlight under water from a small sun takes Cycles hours to converge; from one of 8 degrees,
the mean over the reference's suns within it agrees to 1 % in calm water and 1.5 % under waves.
"""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core.snapshot import Material
from lake_water_addon.core.waves import SineWave
from scripts.reference.optics import physical_optics
from scripts.reference.tracer import Reference
from tests.gpu import scenes
from tests.reference.cycles_scene import cycles_picture

SIZE = (32, 24)
QUARTER = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
RIPPLES = (SineWave(0.03, 2.0, 0.2), SineWave(0.02, 1.3, -0.4, 1.0))


@pytest.mark.parametrize("waves, tolerance", [((), 0.005), (RIPPLES, 0.015)])
def test_sky_light_through_water(blender, waves, tolerance):
    """Waves let in a little more of the sky's light than calm water, by which the reference counts it."""
    bed = scenes.grid_mesh("bed", 31, 15.0, -2.0, scenes.checkered)
    # What leaves the water sideways would see the sky.
    wall = scenes.box_mesh("wall", (0.2, 14.5, 1.2))
    sand = Material("sand", np.ones(3), use_color_attribute=True)
    black = Material("black", np.zeros(3))
    walls = [
        scenes.translation(x, y, -1.0) @ turn
        for x, y, turn in (
            (14.5, 0, np.eye(4)),
            (-14.5, 0, np.eye(4)),
            (0, 14.5, QUARTER),
            (0, -14.5, QUARTER),
        )
    ]
    scene = scenes.snapshot(
        (bed, wall),
        (sand, black),
        (("bed", "sand", [np.eye(4)]), ("wall", "black", walls)),
        (scenes.water(half_size=15.0, k=0.0, water_color=(0.0, 0.0, 0.0), waves=waves),),
    )
    camera = scenes.look_at((0.0, -7.0, 4.0), (0.0, 0.0, -0.5), SIZE)
    reference = Reference(scene, water_optics=physical_optics)
    ours = reference.picture(camera, SIZE, samples=64)
    theirs = cycles_picture(blender, scene, camera, SIZE, samples=512)
    water = ours.water > 0.99
    assert water.mean() > 0.5
    np.testing.assert_allclose(ours.radiance[water].mean(axis=0), theirs[water].mean(axis=0), rtol=tolerance)
    assert np.corrcoef(ours.radiance[water].ravel(), theirs[water].ravel())[0, 1] > 0.98
