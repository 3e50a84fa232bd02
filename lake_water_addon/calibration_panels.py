# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel "Calibration": what was measured, what of it is worth choosing, and the buttons for it."""

import bpy

from .calibrate_operator import camera_size, running
from .calibration import differences, front_points, settings_of, words
from .calibration_plot import time_text
from .calibration_properties import UNKNOWN, LakeWaterCalibration
from .panel_parts import RenderSettings, SidebarOfScene, wrapped


def _front(kept: LakeWaterCalibration) -> list[int]:
    try:
        return front_points(kept)
    except ValueError:  # JSON that other hands have written
        return []


class LAKE_WATER_UL_calibration(bpy.types.UIList):
    """One line a point of the front: time and errors. A click takes its settings."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.label(text=time_text(item.seconds), translate=False)
        row.label(text=f"{item.pixels:.3g}" if item.pixels != UNKNOWN else "–", translate=False)
        row.label(text=f"{item.flip:.2g}" if item.flip != UNKNOWN else "–", translate=False)

    def draw_filter(self, context, layout):
        """Nothing to filter by: what is not worth choosing is left out as it is."""

    def filter_items(self, context, data, property):
        front = _front(data)
        shown = set(front)
        flags = [self.bitflag_filter_item if i in shown else 0 for i in range(len(data.points))]
        order = [*front, *(i for i in range(len(flags)) if i not in shown)]
        places = {number: place for place, number in enumerate(order)}
        return flags, [places[i] for i in range(len(flags))]


class _Calibration:
    bl_label = "Calibration"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        kept = context.scene.lake_water.calibration
        now = running()
        if now is not None:
            part, doing = now
            layout.progress(factor=part, text=f"{part:.0%}")
            wrapped(layout, f"{doing}. Esc cancels", "TIME")
        self.draw_buttons(layout)
        if not kept.points:
            wrapped(layout, "Measures time and error of the settings on this scene. Nothing is measured yet")
            return
        layout.row().prop(kept, "measure", expand=True)
        column = layout.column(align=True)
        header = column.row(align=True)
        for text in ("Time", "Pixels", "FLIP"):
            header.label(text=text)
        column.template_list(
            "LAKE_WATER_UL_calibration", "", kept, "points", kept, "chosen", rows=5, maxrows=9
        )
        front = _front(kept)
        if not front:
            wrapped(layout, "This error could not be measured, or the file's points cannot be read", "ERROR")
        elif kept.chosen in front:
            chosen = words(settings_of(kept.points[kept.chosen]))
            wrapped(layout, f"{chosen[:1].upper()}{chosen[1:]}", "CHECKMARK")
        else:
            wrapped(layout, "Click a line to take its settings", "INFO")
        lines = layout.column(align=True)
        wrapped(lines, f"{kept.view[:1].upper()}{kept.view[1:]}, {kept.date}")
        for text in differences(context.scene, self.size_now(context)):
            wrapped(lines, text, "ERROR")
        layout.operator("lake_water.show_calibration", icon="IMAGE_DATA")


class VIEW3D_PT_lake_water_calibration(_Calibration, SidebarOfScene, bpy.types.Panel):
    """Calibration in the sidebar."""

    bl_parent_id = "VIEW3D_PT_lake_water_rendering"

    @staticmethod
    def draw_buttons(layout: bpy.types.UILayout) -> None:
        """Both sources: a 3D view shows itself, or the camera."""
        row = layout.row(align=True)
        row.label(text="Calibrate")
        row.operator("lake_water.calibrate", text="View").source = "VIEW"
        row.operator("lake_water.calibrate", text="Camera").source = "CAMERA"

    @staticmethod
    def size_now(context: bpy.types.Context) -> tuple[int, int]:
        """Of what the calibration would be of now, pixels."""
        if context.scene.lake_water.calibration.view.startswith("camera"):
            return camera_size(context.scene)
        region = next(region for region in context.area.regions if region.type == "WINDOW")
        return region.width, region.height


class RENDER_PT_lake_water_calibration(_Calibration, RenderSettings, bpy.types.Panel):
    """Calibration in the properties editor, where there is no view but the camera's."""

    bl_parent_id = "RENDER_PT_lake_water"

    @staticmethod
    def draw_buttons(layout: bpy.types.UILayout) -> None:
        """The camera's picture alone."""
        layout.operator("lake_water.calibrate").source = "CAMERA"

    @staticmethod
    def size_now(context: bpy.types.Context) -> tuple[int, int] | None:
        """As in the sidebar; None for a calibration of a view."""
        is_camera = context.scene.lake_water.calibration.view.startswith("camera")
        return camera_size(context.scene) if is_camera else None
