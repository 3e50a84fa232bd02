# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab "Lake Water" in the 3D viewport's sidebar, and the render settings of the engine LAKE_WATER."""

import math
import textwrap
from dataclasses import fields

import bpy

from . import budget, calibration, handlers
from .calibration_panels import (
    LAKE_WATER_UL_calibration,
    RENDER_PT_lake_water_calibration,
    VIEW3D_PT_lake_water_calibration,
)
from .calibration_plot import point_text
from .core import parameters
from .core.settings import CAUSTICS_METHODS
from .core.techniques import TECHNIQUES, Technique
from .extraction.materials import image_problem
from .map_images import LABELS, image_messages
from .operators import ENGINE_ID, shown_water
from .panel_parts import LINE, RenderSettings, Sidebar, SidebarOfScene, SidebarOfWater, aligned, wrapped
from .presets import LAKE_WATER_PT_presets
from .properties import LakeWaterSceneSettings
from .registration import register_classes, unregister_classes
from .render.passes.caustics import chosen_method
from .water_objects import is_water, own_settings

# Blender's own panels ask which engines they serve. These serve EEVEE only and suit this engine too.
EEVEE_PANELS = frozenset(
    {
        "DATA_PT_EEVEE_light",
        "EEVEE_MATERIAL_PT_context_material",
        "EEVEE_MATERIAL_PT_settings",
        "EEVEE_MATERIAL_PT_settings_surface",
        "EEVEE_MATERIAL_PT_surface",
        "EEVEE_WORLD_PT_surface",
    }
)
# These serve every engine in Blender, but show what this one does not draw.
UNSUITABLE = (
    "freestyle",
    "gpencil",
    "grease",
    "lightprobe",
    "stereo",
    "views",
    "DATA_PT_light",
    "DATA_PT_spot",
)
UNSUITABLE_PANELS = frozenset({"DATA_PT_preview", "EEVEE_MATERIAL_PT_viewport_settings", "OBJECT_PT_shading"})


def _has_effect(context: bpy.types.Context, name: str) -> bool:
    """Whether the technique of the scene reads a parameter."""
    return parameters.has_effect(name, context.scene.lake_water.technique)


class VIEW3D_PT_lake_water(Sidebar, bpy.types.Panel):
    """What there is, and the buttons that make more of it."""

    bl_label = "Lake Water"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        waters = handlers.waters(context.scene)
        if not waters:
            column = layout.column(align=True)
            column.label(text="No water in this scene yet.")
            column.separator()
            column.operator("lake_water.add_lake", icon="WORLD")
            column.label(text="A lake with shore, sun and camera")
            column.separator()
            column.operator("lake_water.add_water", icon="MOD_OCEAN")
            column.label(text="A surface at the 3D cursor")
            column.separator()
            column.operator("lake_water.make_water", icon="MESH_PLANE")
            column.label(text="Turns the active, flat mesh into it")
            return
        obj = shown_water(context)
        if obj is None:
            layout.label(text=f"{len(waters)} water objects: select one")
        else:
            layout.label(text=obj.name, icon="MOD_OCEAN", translate=False)
        row = layout.row(align=True)
        row.operator("lake_water.add_water")
        if is_water(context.object):
            row.operator("lake_water.remove_water", text="Turn Off")
        else:
            row.operator("lake_water.make_water")
        if obj is not None:
            row = layout.row(align=True)
            row.operator("lake_water.set_parameters")
            row.operator("lake_water.reset_parameters", text="Reset")
            LAKE_WATER_PT_presets.draw_menu(layout, text="Presets")
        aligned(layout).prop(context.scene.lake_water, "technique")


class VIEW3D_PT_lake_water_water(SidebarOfWater, bpy.types.Panel):
    """The water's optics."""

    bl_label = "Water"

    def draw(self, context: bpy.types.Context) -> None:
        settings = shown_water(context).lake_water
        column = aligned(self.layout)
        # The sidebar is narrow: short labels here, the full names are in the tooltips.
        for name, label in (("k", "Attenuation k"), ("water_color", "Color")):
            if _has_effect(context, name):
                column.prop(settings, name, text=label)
        column.separator()
        scene = context.scene.lake_water
        for name, label, replaced in (
            ("q", "Fresnel q", "use_exact_fresnel"),
            ("ior", "IOR", ""),
            ("c", "Mirror Offset c", "reflection_steps"),
        ):
            if _has_effect(context, name):
                row = column.row()
                # Dimmed, not locked, where another setting takes its place.
                row.active = not (replaced and _has_effect(context, replaced) and getattr(scene, replaced))
                row.prop(settings, name, text=label)
        if not _has_effect(context, "waves"):  # else it is with them
            column.separator()
            column.prop(settings, "surface")


class VIEW3D_PT_lake_water_own(SidebarOfWater, bpy.types.Panel):
    """What only the chosen technique reads, on the water object that is shown."""

    bl_label = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and _technique(context).settings is not None

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.label(text=_technique(context).label)

    def draw(self, context: bpy.types.Context) -> None:
        key = context.scene.lake_water.technique
        group = getattr(shown_water(context).lake_water, key.lower())
        column = aligned(self.layout)
        settings = _technique(context).settings
        for name, kind in settings.maps.items():
            self._draw_map(column, group, name, kind, f"{key.lower()}_{name}")
        for number, field in enumerate(fields(settings)):
            panel = field.metadata["panel"]
            if panel["section"] or (number == 0 and settings.maps):
                column.separator()
            column.prop(group, field.name, text=panel["label"])
            if _technique(context).spectral and field.name == "absorption":
                column.operator_menu_enum("lake_water.set_absorption", "water")

    @staticmethod
    def _draw_map(
        column: bpy.types.UILayout, group: bpy.types.PropertyGroup, name: str, kind: str, parameter: str
    ) -> None:
        image = getattr(group, name)
        row = column.row(align=True)
        row.template_ID(group, name, open="image.open", text=group.bl_rna.properties[name].name)
        if kind in LABELS:
            row.operator("lake_water.new_map", text="", icon="ADD").parameter = parameter
        for message in _messages.of(image, kind):
            wrapped(column, message, "ERROR")


def _technique(context: bpy.types.Context) -> Technique:
    return TECHNIQUES[context.scene.lake_water.technique]


class _MapMessages:
    """What is wrong with images that serve as maps, kept until they change: to find out reads every pixel."""

    def __init__(self) -> None:
        self._known: dict[tuple, tuple[str, ...]] = {}
        self.listener = handlers.Listener(
            loaded=self._known.clear, undone=self._known.clear, updated=self._forget_changed
        )

    def _forget_changed(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if depsgraph.id_type_updated("IMAGE"):
            self._known.clear()

    def of(self, image: bpy.types.Image | None, kind: str) -> tuple[str, ...]:
        """kind: as in `TechniqueSettings.maps`."""
        if image is None:
            return ()
        state = (image.session_uid, image.name, kind, image.colorspace_settings.name, *image.size)
        key = (*state, image.source, image.filepath, image.is_dirty)
        if key not in self._known:
            if kind in LABELS:
                self._known[key] = image_messages(image, kind)
            else:
                problem = image_problem(image)
                self._known[key] = (f"Image {problem}",) if problem is not None else ()
        return self._known[key]


_messages = _MapMessages()


class LAKE_WATER_UL_waves(bpy.types.UIList):
    """One line a wave: length, height, direction."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        system = context.scene.unit_settings.system
        row = layout.row(align=True)
        for length in (item.wavelength, item.amplitude):
            text = bpy.utils.units.to_string(system, "LENGTH", length, precision=2, compatible_unit=False)
            row.label(text=text, translate=False)
        row.label(text=f"{math.degrees(item.direction):.0f}°", translate=False)


class VIEW3D_PT_lake_water_waves(SidebarOfWater, bpy.types.Panel):
    """The shape of the surface."""

    bl_label = "Waves"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and _has_effect(context, "waves")

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        obj = shown_water(context)
        settings = obj.lake_water
        if _technique(context).settings is not None:
            # Dimmed, not locked, where the technique's own settings leave the surface flat.
            layout.active = own_settings(obj, context.scene.lake_water.technique).displaces
        row = layout.row()
        waves = row.column(align=True)
        header = waves.row(align=True)
        for text in ("Length", "Height", "Direction"):
            header.label(text=text)
        waves.template_list(
            "LAKE_WATER_UL_waves", "", settings, "waves", settings, "active_wave", rows=3, maxrows=6
        )
        buttons = row.column(align=True)
        buttons.label(icon="BLANK1")
        buttons.operator("lake_water.wave_add", icon="ADD", text="")
        buttons.operator("lake_water.wave_remove", icon="REMOVE", text="")
        column = aligned(layout)
        if settings.active_wave < len(settings.waves):
            wave = settings.waves[settings.active_wave]
            column.prop(wave, "amplitude")
            column.prop(wave, "wavelength")
            column.prop(wave, "direction")
            column.prop(wave, "phase")
            column.separator()
        column.prop(settings, "depth")
        column.prop(settings, "surface")
        if settings.surface == "GRID":
            column.prop(settings, "grid_resolution", text="Resolution")


def draw_render_settings(
    layout: bpy.types.UILayout, scene: bpy.types.Scene, *, with_technique: bool = True
) -> None:
    """The settings of the picture: in the sidebar and in the properties editor, both narrow."""
    settings = scene.lake_water
    column = aligned(layout)
    if with_technique:
        column.prop(settings, "technique")
        column.separator()
    column.prop(settings, "quality")
    column.separator()
    if parameters.has_effect("intersection_steps", settings.technique):
        row = column.row()
        # Dimmed, not locked, as its place is taken by the next.
        row.active = not settings.refraction_steps
        row.prop(settings, "intersection_steps", text="Steps")
    if parameters.has_effect("refraction_steps", settings.technique):
        column.prop(settings, "refraction_steps", text="Refraction")
    if parameters.has_effect("reflection_steps", settings.technique):
        column.prop(settings, "reflection_steps", text="Reflection")
    if parameters.has_effect("use_exact_fresnel", settings.technique):
        column.column(heading="Fresnel").prop(settings, "use_exact_fresnel", text="Exact")
    column.prop(settings, "texture_size")
    column.prop(settings, "least_grid_resolution", text="Least Grid")
    column.prop(settings, "fov_ext", text="FOV Factor")
    column.separator()
    under = column.column(heading="Under Water")
    under.prop(settings, "use_exact_under_water", text="Exact")
    column.separator()
    column.prop(settings, "samples", text="Samples")
    column.prop(settings, "viewport_samples", text="Viewport")


class VIEW3D_PT_lake_water_rendering(SidebarOfScene, bpy.types.Panel):
    """How the picture is computed. The technique is above, since it decides what all panels show."""

    bl_label = "Rendering"

    def draw(self, context: bpy.types.Context) -> None:
        draw_render_settings(self.layout, context.scene, with_technique=False)


class _Budget:
    """What a picture may take or how far off it may be, what was chosen for that, and what is expected."""

    bl_label = "Budget"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        scene = context.scene
        settings = scene.lake_water
        column = aligned(self.layout)
        column.prop(settings, "budget", text="Limit")
        if settings.budget == "OFF":
            return
        column.prop(settings, f"budget_{settings.budget.lower()}")
        problem = budget.problem(scene)
        chosen = budget.choice(scene)
        if chosen is None:
            wrapped(self.layout, problem, "ERROR")
            self.layout.operator("lake_water.calibrate")
            return
        if not chosen.fits:
            wrapped(self.layout, f"Nothing measured is within {chosen.limit}: the nearest is taken", "ERROR")
        point = settings.calibration.points[chosen.number]
        wrapped(self.layout, f"Chosen: {calibration.words(chosen.settings)}", "CHECKMARK")
        wrapped(self.layout, f"Expected: {point_text(point)}", "BLANK1")
        if not budget.is_applied(scene, chosen):
            wrapped(self.layout, "Settings were changed since", "INFO")
            self.layout.operator("lake_water.apply_budget", text="Apply Again")
        playing = budget.published()
        if playing:
            wrapped(self.layout, f"Playing with {playing}", "PLAY")


class _Effect:
    """A sub-panel of what the sun does, with its switch in the header.

    Values are dimmed, not locked, where they change nothing.
    """

    bl_options = {"DEFAULT_CLOSED"}
    switch: str

    def draw_header(self, context: bpy.types.Context) -> None:
        settings = context.scene.lake_water
        self.layout.active = handlers.has_sun(context.scene, context.view_layer)
        self.layout.prop(settings, self.switch, text="")

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.lake_water
        has_sun = handlers.has_sun(context.scene, context.view_layer)
        if not has_sun:
            self.layout.label(text="No sun light in this scene", icon="INFO")
        column = aligned(self.layout)
        column.active = has_sun and self.is_used(settings)
        self.draw_values(column, settings)

    def is_used(self, settings: LakeWaterSceneSettings) -> bool:
        """Whether the values change anything, given a sun."""
        return getattr(settings, self.switch)

    def draw_values(self, column: bpy.types.UILayout, settings: LakeWaterSceneSettings) -> None:
        """Draw all but the switch."""
        raise NotImplementedError


class _Caustics(_Effect):
    bl_label = "Caustics"
    switch = "use_caustics"

    def draw_values(self, column: bpy.types.UILayout, settings: LakeWaterSceneSettings) -> None:
        column.prop(settings, "caustics_method", text="Method")
        if not bpy.app.background:  # else Blender may have no GPU to ask
            self.draw_method(column, settings.caustics_method)
        column.prop(settings, "caustics_size", text="Texture Size")
        column.prop(settings, "photon_size", text="Photons")
        column.prop(settings, "caustics_steps", text="Steps")

    def draw_method(self, column: bpy.types.UILayout, wanted: str) -> None:
        """Say what the setting comes to on this machine, where it does not say that itself."""
        chosen = chosen_method(wanted)
        if wanted == "AUTO":
            split = column.split(factor=0.4)  # as the values of the column are
            name = split.row()
            name.alignment = "RIGHT"
            name.label(text="In Use")
            split.label(text=CAUSTICS_METHODS[chosen.name])
        elif chosen.name != wanted:
            wrapped(column, chosen.reason)


class _Shadows(_Effect):
    bl_label = "Sun Shadows"
    switch = "use_shadows"

    def is_used(self, settings: LakeWaterSceneSettings) -> bool:
        return settings.use_shadows or settings.use_caustics  # photons are traced in the same textures

    def draw_values(self, column: bpy.types.UILayout, settings: LakeWaterSceneSettings) -> None:
        column.prop(settings, "light_depth_size", text="Texture Size")


class _Glow(_Effect):
    bl_label = "Sun Glow"
    switch = "use_glow"

    def draw_values(self, column: bpy.types.UILayout, settings: LakeWaterSceneSettings) -> None:
        column.prop(settings, "glow_strength", text="Strength")
        column.prop(settings, "glow_exponent", text="Exponent")
        column.prop(settings, "glow_threshold", text="Threshold")


class VIEW3D_PT_lake_water_budget(_Budget, SidebarOfScene, bpy.types.Panel):
    """Budget in the sidebar."""

    bl_parent_id = "VIEW3D_PT_lake_water_rendering"


class VIEW3D_PT_lake_water_caustics(_Caustics, SidebarOfScene, bpy.types.Panel):
    """Caustics in the sidebar."""

    bl_parent_id = "VIEW3D_PT_lake_water_rendering"


class VIEW3D_PT_lake_water_shadows(_Shadows, SidebarOfScene, bpy.types.Panel):
    """Shadows in the sidebar."""

    bl_parent_id = "VIEW3D_PT_lake_water_rendering"


class VIEW3D_PT_lake_water_glow(_Glow, SidebarOfScene, bpy.types.Panel):
    """Glow in the sidebar."""

    bl_parent_id = "VIEW3D_PT_lake_water_rendering"


class VIEW3D_PT_lake_water_display(SidebarOfScene, bpy.types.Panel):
    """What the viewport shows."""

    bl_label = "Display"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.lake_water
        column = self.layout.column()
        column.prop(settings, "show_in_viewport")
        column.prop(settings, "show_statistics")
        if settings.show_statistics:
            lines = self.layout.column(align=True)
            for text in handlers.statistics():
                for line in textwrap.wrap(text, LINE, subsequent_indent="    "):
                    lines.label(text=line, translate=False)


class RENDER_PT_lake_water(RenderSettings, bpy.types.Panel):
    """The engine's settings."""

    bl_label = "Lake Water"

    def draw(self, context: bpy.types.Context) -> None:
        draw_render_settings(self.layout, context.scene)


class RENDER_PT_lake_water_budget(_Budget, RenderSettings, bpy.types.Panel):
    """Budget in the properties editor."""

    bl_parent_id = "RENDER_PT_lake_water"


class RENDER_PT_lake_water_caustics(_Caustics, RenderSettings, bpy.types.Panel):
    """Caustics in the properties editor."""

    bl_parent_id = "RENDER_PT_lake_water"


class RENDER_PT_lake_water_shadows(_Shadows, RenderSettings, bpy.types.Panel):
    """Shadows in the properties editor."""

    bl_parent_id = "RENDER_PT_lake_water"


class RENDER_PT_lake_water_glow(_Glow, RenderSettings, bpy.types.Panel):
    """Glow in the properties editor."""

    bl_parent_id = "RENDER_PT_lake_water"


CLASSES = (
    VIEW3D_PT_lake_water,
    VIEW3D_PT_lake_water_water,
    VIEW3D_PT_lake_water_own,
    LAKE_WATER_UL_waves,
    VIEW3D_PT_lake_water_waves,
    VIEW3D_PT_lake_water_rendering,
    LAKE_WATER_UL_calibration,
    VIEW3D_PT_lake_water_calibration,
    VIEW3D_PT_lake_water_budget,
    VIEW3D_PT_lake_water_caustics,
    VIEW3D_PT_lake_water_shadows,
    VIEW3D_PT_lake_water_glow,
    VIEW3D_PT_lake_water_display,
    RENDER_PT_lake_water,
    RENDER_PT_lake_water_calibration,
    RENDER_PT_lake_water_budget,
    RENDER_PT_lake_water_caustics,
    RENDER_PT_lake_water_shadows,
    RENDER_PT_lake_water_glow,
)


def standard_panels() -> list[type[bpy.types.Panel]]:
    """Blender's own panels that make sense with the engine LAKE_WATER."""
    found = []
    for panel in bpy.types.Panel.__subclasses__():
        name = panel.__name__
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if name in EEVEE_PANELS:
            found.append(panel)
        elif "BLENDER_RENDER" in engines and name not in UNSUITABLE_PANELS:
            if not any(word in name for word in UNSUITABLE):
                found.append(panel)
    return found


def register() -> None:
    """Add the panels, and this engine to those that Blender's own panels serve."""
    register_classes(CLASSES)
    handlers.subscribe(_messages.listener)
    for panel in standard_panels():
        panel.COMPAT_ENGINES.add(ENGINE_ID)


def unregister() -> None:
    """Remove the panels, and this engine from Blender's own."""
    for panel in standard_panels():
        panel.COMPAT_ENGINES.discard(ENGINE_ID)
    handlers.unsubscribe(_messages.listener)
    unregister_classes(CLASSES)
