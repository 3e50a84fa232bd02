# SPDX-License-Identifier: GPL-3.0-or-later
"""A person's own defaults, kept in Blender's preferences: what a scene's first water starts with."""

from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, IntProperty


@dataclass(frozen=True)
class Defaults:
    """The preferences as plain data; these values hold where the extension runs from a checkout."""

    show_in_viewport: bool = True
    show_statistics: bool = False
    grid_resolution: int = 49


class LakeWaterPreferences(bpy.types.AddonPreferences):
    """Shown under Edit > Preferences > Add-ons > Lake Water."""

    bl_idname = __package__

    show_in_viewport: BoolProperty(
        name="Show Water in Viewport",
        description="Scenes that get their first water show it in every shading mode. Turn off on a slow "
        "graphics card",
        default=Defaults.show_in_viewport,
    )
    show_statistics: BoolProperty(
        name="Show Statistics",
        description="Scenes that get their first water show frames per second and the time of each pass",
        default=Defaults.show_statistics,
    )
    grid_resolution: IntProperty(
        name="Grid Resolution",
        description="Vertices along each side of the grid of new water",
        default=Defaults.grid_resolution,
        min=2,
        max=1024,
        soft_max=512,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the preferences."""
        layout = self.layout
        layout.use_property_split = True
        layout.label(text="For new water:")
        layout.prop(self, "show_in_viewport")
        layout.prop(self, "show_statistics")
        layout.prop(self, "grid_resolution")


def defaults(context: bpy.types.Context) -> Defaults:
    """The person's defaults, or the built-in ones where the extension is not an enabled add-on."""
    addon = context.preferences.addons.get(__package__)
    own = addon.preferences if addon is not None else None
    if own is None:
        return Defaults()
    return Defaults(
        show_in_viewport=own.show_in_viewport,
        show_statistics=own.show_statistics,
        grid_resolution=own.grid_resolution,
    )


def register() -> None:
    """Add the preferences."""
    bpy.utils.register_class(LakeWaterPreferences)


def unregister() -> None:
    """Remove the preferences; Blender keeps the values."""
    bpy.utils.unregister_class(LakeWaterPreferences)
