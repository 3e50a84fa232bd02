# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture with other settings than those of its scene, without a change of the scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from .parameters import OWN, SCENE, WATER
from .settings import FrameSettings
from .snapshot import SceneSnapshot, WaterBody
from .techniques import TECHNIQUES


def lay_over(
    frame: FrameSettings, snapshot: SceneSnapshot, settings: Mapping[str, object]
) -> tuple[FrameSettings, SceneSnapshot]:
    """Settings of a picture and a snapshot of a scene, with some of them in place of what they have.

    settings: by the names of `core.parameters`; others, such as `samples`, have no place here and are left
    out. What belongs to a water is laid over all of them. The snapshot itself where none does.
    """
    frame = replace(frame, **{name: value for name, value in settings.items() if name in SCENE})
    if not any(name in WATER or name in OWN for name in settings):
        return frame, snapshot
    return frame, replace(snapshot, waters=tuple(_body(body, settings) for body in snapshot.waters))


def _body(body: WaterBody, settings: Mapping[str, object]) -> WaterBody:
    water = replace(body.settings, **{name: value for name, value in settings.items() if name in WATER})
    for technique in {OWN[name].technique for name in settings if name in OWN}:
        kind = TECHNIQUES[technique].settings
        names = [name for name in settings if name in OWN and OWN[name].technique == technique]
        own = {OWN[name].field: settings[name] for name in names}
        others = tuple(other for other in water.own if type(other) is not kind)
        water = replace(water, own=(*others, replace(water.of(kind), **own)))
    return replace(body, settings=water)
