# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers from a water object's settings to inputs of nodes.

All are what Blender calls simple expressions or plain copies: no Python runs, so no permission to
run scripts is asked for, and they hold under animation, in every depsgraph and in every thread.
Blender evaluates them in float64; only the result is rounded to the input's float32.

Where the extension is not enabled, Blender does not know the settings: each variable then has the value
that it had when the file was saved, and the waves go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import bpy

from ..core.waves import GRAVITY

# omega from the dispersion relation (core.waves.angular_frequency); tanh(x) = 2 / (1 + exp(-2 x)) - 1
OMEGA = f"sqrt({GRAVITY}*2*pi/w*(2/(1+exp(-4*pi*d/w))-1))"
FRAME_RATE = {"fps": "render.fps", "base": "render.fps_base"}
"""Of the scene that is evaluated."""


@dataclass(frozen=True)
class Drive:
    """One driven number. variables: names in the expression and paths in `object.lake_water`."""

    expression: str
    variables: dict[str, str]
    scene: dict[str, str] = field(default_factory=dict)

    def apply(self, owner: bpy.types.ID, path: str, index: int, obj: bpy.types.Object) -> None:
        """Drive `owner`'s property at a data path. index: of the component, -1 for a scalar."""
        curve = owner.driver_add(path, index)
        driver = curve.driver
        for name, setting in self.variables.items():
            variable = driver.variables.new()
            variable.name = name
            target = variable.targets[0]
            target.id = obj
            target.data_path = f"lake_water.{setting}"
            target.use_fallback_value = True
            _note_value(target)
        for name, scene_path in self.scene.items():
            variable = driver.variables.new()
            variable.name = name
            variable.type = "CONTEXT_PROP"
            variable.targets[0].context_property = "ACTIVE_SCENE"
            variable.targets[0].data_path = scene_path
        driver.expression = self.expression


def _note_value(target: bpy.types.DriverTarget) -> None:
    """Keep the setting's value for when there is no setting."""
    value = target.id.path_resolve(target.data_path)
    if isinstance(value, str):
        value = (
            target.id.lake_water.bl_rna.properties[target.data_path.rpartition(".")[2]]
            .enum_items[value]
            .value
        )
    target.fallback_value = value


def note_values(owner: bpy.types.ID, prefix: str) -> None:
    """Keep the present values of the settings that drive these properties, before the file is saved."""
    for curve in drivers_on(owner, prefix):
        for variable in curve.driver.variables:
            if variable.type == "SINGLE_PROP" and variable.targets[0].id is not None:
                _note_value(variable.targets[0])


def copy(setting: str) -> Drive:
    """The value of a setting as it is."""
    return Drive("v", {"v": setting})


def wave_drives(index: int) -> Iterator[tuple[str, int, Drive]]:
    """What `core.waves.pack` computes, for one wave: ("Wave" or "Phase", component, drive)."""
    wave = f"waves[{index}]"
    length, direction = f"{wave}.wavelength", f"{wave}.direction"
    yield "Wave", 0, Drive("2*pi/w*cos(a)", {"w": length, "a": direction})
    yield "Wave", 1, Drive("2*pi/w*sin(a)", {"w": length, "a": direction})
    yield "Wave", 2, copy(f"{wave}.amplitude")
    yield (
        "Phase",
        -1,
        Drive(
            f"fmod(p-{OMEGA}*frame*base/fps,2*pi)",
            {"p": f"{wave}.phase", "w": length, "d": "depth"},
            FRAME_RATE,
        ),
    )


def drivers_on(owner: bpy.types.ID, prefix: str) -> list[bpy.types.FCurve]:
    """The drivers of properties whose data path begins with the prefix."""
    animation = owner.animation_data
    return [c for c in animation.drivers if c.data_path.startswith(prefix)] if animation is not None else []


def remove_drivers(owner: bpy.types.ID, prefix: str) -> None:
    """Remove these drivers, and animation data that is left with nothing in it."""
    curves = drivers_on(owner, prefix)
    for curve in curves:
        owner.animation_data.drivers.remove(curve)
    animation = owner.animation_data
    if curves and animation.action is None and not animation.nla_tracks and not animation.drivers:
        owner.animation_data_clear()


def target_of(owner: bpy.types.ID, prefix: str) -> bpy.types.Object | None:
    """The object whose settings drive the owner's properties; None if none does."""
    curves = drivers_on(owner, prefix)
    return curves[0].driver.variables[0].targets[0].id if curves else None


def retarget(owner: bpy.types.ID, prefix: str, obj: bpy.types.Object) -> None:
    """Let another object's settings drive the properties."""
    for curve in drivers_on(owner, prefix):
        for variable in curve.driver.variables:
            if variable.type == "SINGLE_PROP":
                variable.targets[0].id = obj
