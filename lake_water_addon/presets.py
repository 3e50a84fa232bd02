# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: those that the extension brings, and those that a person saves, by Blender's own mechanism.

A preset is a Python file that sets `water` (`object.lake_water`) and `scene` (`scene.lake_water`), as Blender
writes it. Those of the extension are in `data/presets/lake_water`; a person's own in the folder of the
same name among Blender's presets.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.props import StringProperty

from .core import parameters
from .operators import shown_water, target_waters
from .registration import register_classes, unregister_classes
from .water_objects import WaterError

FOLDER = "lake_water"
DATA = Path(__file__).parent / "data"
SHIPPED = DATA / "presets" / FOLDER

# Of the machine, and not of the picture.
_LEFT_OUT = frozenset({"caustics_method"})


class PresetError(ValueError):
    """Why a preset cannot be used, in words for a person."""


def paths() -> dict[str, Path]:
    """The file of each preset, by the name that a person reads; in the order of the names."""
    found = {}
    for folder in bpy.utils.preset_paths(FOLDER):
        for path in Path(folder).glob("*.py"):
            found.setdefault(bpy.path.display_name(path.name, title_case=False), path)
    return dict(sorted(found.items()))


def find(name: str) -> Path:
    """The file of a preset; upper and lower case and underscores make no difference. Raises PresetError."""
    known = paths()
    for label, path in known.items():
        if label.replace("_", " ").casefold() == name.replace("_", " ").strip().casefold():
            return path
    raise PresetError(f"there is no preset {name!r}: choose one of {', '.join(known)}")


def apply(path: Path, context: bpy.types.Context, waters: Iterable[bpy.types.Object]) -> None:
    """Set the water objects and the scene of the context to what a preset says. Raises PresetError."""
    for obj in waters:
        try:
            with context.temp_override(object=obj, active_object=obj):
                bpy.utils.execfile(str(path))
        except Exception as error:  # a file that anyone may have written
            raise PresetError(f"The preset {path} fails: {error}. Remove it, or save it anew") from error
        obj.update_tag()  # an emptied list of waves tags nothing by itself


class LAKE_WATER_OT_preset_apply(bpy.types.Operator):
    """Set the selected water and the scene's settings of the picture to those of the preset"""

    bl_idname = "lake_water.preset_apply"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    filepath: StringProperty(subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            apply(Path(self.filepath), context, target_waters(context))
        except (WaterError, PresetError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class LAKE_WATER_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Save the water's settings and waves, and the scene's settings of the picture, as a preset.
    Images belong to the file and are not part of it"""

    bl_idname = "lake_water.preset_add"
    bl_label = "Add Lake Water Preset"
    preset_menu = "LAKE_WATER_PT_presets"
    preset_subdir = FOLDER
    preset_defines = ("water = bpy.context.object.lake_water", "scene = bpy.context.scene.lake_water")
    preset_values = (
        *(f"water.{name}" for name in parameters.WATER),
        "water.waves",
        "water.grid_resolution",
        *(f"water.{o.technique.lower()}.{o.field}" for o in parameters.OWN.values() if not o.is_image),
        *(f"scene.{name}" for name in parameters.SCENE if name not in _LEFT_OUT),
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.remove_name:
            if paths().get(self.name, SHIPPED).is_relative_to(SHIPPED):
                self.report({"WARNING"}, f'"{self.name}" comes with the extension and stays')
                return {"CANCELLED"}
            return super().execute(context)
        obj = shown_water(context)
        if obj is None:
            self.report({"ERROR"}, "Select the water whose settings are to be saved")
            return {"CANCELLED"}
        with context.temp_override(object=obj, active_object=obj):
            return super().execute(context)


class LAKE_WATER_PT_presets(PresetPanel, bpy.types.Panel):
    """The list of presets, one click each, with a line to save a new one."""

    bl_label = "Lake Water Presets"
    preset_subdir = FOLDER
    preset_operator = LAKE_WATER_OT_preset_apply.bl_idname
    preset_add_operator = LAKE_WATER_OT_preset_add.bl_idname


CLASSES = (LAKE_WATER_OT_preset_apply, LAKE_WATER_OT_preset_add, LAKE_WATER_PT_presets)


def register() -> None:
    """Add the presets."""
    register_classes(CLASSES)
    bpy.utils.register_preset_path(str(DATA))


def unregister() -> None:
    """Remove the presets; a person's own stay where they are."""
    bpy.utils.unregister_preset_path(str(DATA))
    unregister_classes(CLASSES)
