# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration lake: a complete scene from a seed and a level of detail.

lake = build_lake(scene, seed=1, detail=1.0)
animate_turntable(scene, lake.camera, center=lake.center, radius=lake.orbit_radius,
                  height=lake.orbit_height, look_height=lake.look_height, frames=240)
place_obj(scene, "spot.obj", location=lake.stage, water_level=lake.water_level, collection=lake.collection)
"""

from __future__ import annotations

from .lake import THESIS_VERTICES, LakeScene, build_lake
from .placing import place_obj
from .turntable import animate_dive, animate_turntable

__all__ = ["THESIS_VERTICES", "LakeScene", "animate_dive", "animate_turntable", "build_lake", "place_obj"]
