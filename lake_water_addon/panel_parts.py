# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels are made of: their places, and texts of several lines."""

import textwrap

import bpy

from . import handlers
from .operators import ENGINE_ID, shown_water

LINE = 35  # characters that fit into the sidebar at its first width


class Sidebar:
    """A panel of the tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Lake Water"


class SidebarOfWater(Sidebar):
    """A sub-panel about the water object that is shown."""

    bl_parent_id = "VIEW3D_PT_lake_water"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_water(context) is not None


class SidebarOfScene(Sidebar):
    """A sub-panel about the scene, of use once it has water."""

    bl_parent_id = "VIEW3D_PT_lake_water"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(handlers.waters(context.scene))


def aligned(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """A column with names left and values right, as in Blender's own panels."""
    layout.use_property_split = True
    return layout.column()


def wrapped(layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """A text of several lines, the icon before the first."""
    lines = layout.column(align=True)
    for line in textwrap.wrap(text, LINE):
        lines.label(text=line, icon=icon, translate=False)
        icon = "NONE" if icon == "NONE" else "BLANK1"


class RenderSettings:
    """A panel of the engine's settings in the properties editor."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE_ID}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES
