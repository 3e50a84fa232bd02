# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons. Each is one call deep: the work is done by functions that need no user interface."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty
from mathutils import Color

from . import handlers, map_images, preferences, properties, water_objects
from .core import parameters
from .core.attenuation import PUBLISHED, WAVELENGTHS
from .core.techniques import TECHNIQUES
from .properties import place_of
from .registration import register_classes, unregister_classes
from .water_objects import WaterError

ENGINE_ID = "LAKE_WATER"
SCENE_DISPLAY = ("show_in_viewport", "show_statistics")  # how the viewport looks, no parameter of the picture


def shown_water(context: bpy.types.Context) -> bpy.types.Object | None:
    """The water object that the panels show: the active one, else the only one of the scene, else None."""
    if water_objects.is_water(context.object):
        return context.object
    waters = handlers.waters(context.scene)
    return waters[0] if len(waters) == 1 else None


def target_waters(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The water objects that an operator changes: all selected ones, else the one that the panels show.

    Raises WaterError when that leaves none.
    """
    selected = [obj for obj in context.selected_objects if water_objects.is_water(obj)]
    if selected:
        return selected
    obj = shown_water(context)
    if obj is not None:
        return [obj]
    if water_objects.waters_of(context.scene):
        raise WaterError("The scene has several water objects: select those to change")
    raise WaterError("The scene has no water: use Add Lake, Add Water or Make Water first")


def _first_water_defaults(context: bpy.types.Context) -> None:
    """Give a scene that gets its first water the person's own defaults, where nothing is set yet."""
    settings = context.scene.lake_water
    defaults = preferences.defaults(context)
    for name in SCENE_DISPLAY:
        if not settings.is_property_set(name):
            setattr(settings, name, getattr(defaults, name))


def _select_only(context: bpy.types.Context, obj: bpy.types.Object) -> None:
    """Make the object the active and only selected one, where the view layer has it."""
    context.view_layer.update()  # tells the view layer of a new object
    if obj.name not in context.view_layer.objects:
        return
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


class _ObjectModeOperator:
    """Operators that add or change objects as a whole."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Switch to Object Mode first")
            return False
        return True

    def refuse(self, error: Exception) -> set[str]:
        """Report the error and cancel."""
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


@contextmanager
def _busy_cursor(context: bpy.types.Context) -> Iterator[None]:
    """Show that Blender is at work; without a window nobody sees it."""
    window = context.window
    if window is not None:
        window.cursor_modal_set("WAIT")
    try:
        yield
    finally:
        if window is not None:
            window.cursor_modal_restore()


class LAKE_WATER_OT_add_lake(_ObjectModeOperator, bpy.types.Operator):
    """Add a whole lake: basin, shore, plants, things in the water, sun, sky and camera"""

    bl_idname = "lake_water.add_lake"
    bl_label = "Add Lake"

    seed: IntProperty(
        name="Seed",
        description="Another number gives another lake; the same number the same lake",
        default=1,
        min=0,
        max=2**31 - 1,
    )
    detail: FloatProperty(
        name="Detail",
        description="How finely everything is modeled: 1 is the scene of the 2008 thesis (about 131,000 "
        "vertices), lower is faster to build and to draw",
        default=1.0,
        min=0.1,
        max=4.0,
        soft_max=2.0,
        step=10,
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        from .scenes import build_lake

        scene = context.scene
        first = not water_objects.waters_of(scene)
        try:
            with _busy_cursor(context):  # some seconds
                lake = build_lake(scene, seed=self.seed, detail=self.detail)
        except ValueError as error:
            return self.refuse(error)
        if first:
            _first_water_defaults(context)
        scene.camera = lake.camera
        if engine_is_registered():
            scene.render.engine = ENGINE_ID
        _select_only(context, lake.water)
        if context.space_data is not None and context.space_data.type == "VIEW_3D":
            context.space_data.region_3d.view_perspective = "CAMERA"
        return {"FINISHED"}


class LAKE_WATER_OT_add_water(_ObjectModeOperator, bpy.types.Operator):
    """Add a square water surface at the 3D cursor"""

    bl_idname = "lake_water.add_water"
    bl_label = "Add Water"

    size: FloatProperty(
        name="Size",
        description="Length of each side; scale the object for another shape",
        default=20.0,
        min=0.001,
        soft_min=0.1,
        soft_max=1000.0,
        subtype="DISTANCE",
        unit="LENGTH",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        first = not water_objects.waters_of(context.scene)
        try:
            obj = water_objects.create_water(
                "Water", self.size, self.size, context.collection, context.scene.cursor.location
            )
        except (WaterError, RuntimeError) as error:  # RuntimeError: the collection cannot be edited
            return self.refuse(error)
        obj.lake_water.grid_resolution = preferences.defaults(context).grid_resolution
        if first:
            _first_water_defaults(context)
        space = context.space_data
        if space is not None and space.type == "VIEW_3D" and space.local_view is not None:
            obj.local_view_set(space, True)
        _select_only(context, obj)
        return {"FINISHED"}


class LAKE_WATER_OT_make_water(_ObjectModeOperator, bpy.types.Operator):
    """Turn the active mesh into water. It must lie flat; a plain rectangle gets a fine grid of its own"""

    bl_idname = "lake_water.make_water"
    bl_label = "Make Water"

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = context.object
        if obj is None:
            return self.refuse(WaterError("There is no active object: click the mesh that is to be water"))
        context.view_layer.update()
        first = not water_objects.waters_of(context.scene)
        try:
            water_objects.make_water(obj)
        except WaterError as error:
            return self.refuse(error)
        if not obj.lake_water.is_property_set("grid_resolution"):
            obj.lake_water.grid_resolution = preferences.defaults(context).grid_resolution
        if first:
            _first_water_defaults(context)
        return {"FINISHED"}


class LAKE_WATER_OT_remove_water(_ObjectModeOperator, bpy.types.Operator):
    """Make the selected water an ordinary mesh again. Its settings stay for the next time"""

    bl_idname = "lake_water.remove_water"
    bl_label = "Turn Off Water"

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            for obj in target_waters(context):
                water_objects.remove_water(obj)
        except WaterError as error:
            return self.refuse(error)
        return {"FINISHED"}


def _option(group: type[bpy.types.PropertyGroup], name: str) -> object:
    """The property of an operator that is like a setting of a group."""
    setting = group.__annotations__[name]
    # SKIP_SAVE: a value that is left out means "as it is", not "as in the last call".
    kept = {key: value for key, value in setting.keywords.items() if key not in ("update", "override")}
    return setting.function(**kept | {"options": {"SKIP_SAVE"}})


def _options() -> dict[str, object]:
    """A property for every parameter of `core.parameters`; an image's is its name."""
    options = {name: _option(properties.LakeWaterObjectSettings, name) for name in parameters.WATER}
    for name, own in parameters.OWN.items():
        if own.is_image:
            options[name] = StringProperty(
                name=own.label, description="Name of an image of this file, or nothing", options={"SKIP_SAVE"}
            )
        else:
            options[name] = _option(properties.TECHNIQUE_GROUPS[own.technique.lower()], own.field)
    return options | {name: _option(properties.LakeWaterSceneSettings, name) for name in parameters.SCENE}


class LAKE_WATER_OT_set_parameters(_ObjectModeOperator, bpy.types.Operator):
    """Set parameters of the selected water and of the scene in one step"""

    bl_idname = "lake_water.set_parameters"
    bl_label = "Set Parameters"

    filled_in: StringProperty(
        description="Names of parameters that nobody gave, and that show what holds",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return True  # changes settings only: fine in every mode

    def _shown(self, scene: bpy.types.Scene) -> tuple[str, ...]:
        return parameters.of_technique(scene.lake_water.technique)

    def _given(self, scene: bpy.types.Scene, obj: bpy.types.Object) -> dict[str, object]:
        """What was asked for, by name: what the caller gave, and what a person then changed in the popup."""
        filled_in = self.filled_in.split()
        given = {}
        for name in (*parameters.WATER, *parameters.OWN, *parameters.SCENE):
            if self.properties.is_property_set(name):
                value = getattr(self, name)
                if name not in filled_in or _plain(value) != _plain(getattr(*place_of(name, scene, obj))):
                    given[name] = value
        return given

    def _fill_in(self, scene: bpy.types.Scene, obj: bpy.types.Object, given: Iterable[str]) -> None:
        """Let what is shown, and was not given, say what holds."""
        names = [name for name in self._shown(scene) if name not in given]
        for name in names:
            setattr(self, name, getattr(*place_of(name, scene, obj)))
        self.filled_in = " ".join(names)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            first = target_waters(context)[0]
        except WaterError as error:
            return self.refuse(error)
        self._fill_in(context.scene, first, self._given(context.scene, first))
        return context.window_manager.invoke_props_popup(self, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        try:
            targets = target_waters(context)
            given = self._given(scene, targets[0])
            values = {name: self._value(name, value) for name, value in given.items()}
        except WaterError as error:
            return self.refuse(error)
        try:
            for obj in targets:
                for name, value in values.items():
                    setattr(*place_of(name, scene, obj), value)
        except AttributeError:
            return self.refuse(
                WaterError(
                    f'"{obj.name}" or the scene is linked from another file: make it local, or a library '
                    "override, first"
                )
            )
        self._fill_in(scene, targets[0], given)  # so that the redo panel shows what holds
        technique = scene.lake_water.technique
        without = [name for name in given if not parameters.has_effect(name, technique)]
        if without:
            labels = ", ".join(self.properties.bl_rna.properties[name].name for name in without)
            self.report({"WARNING"}, f"No effect with the technique {TECHNIQUES[technique].label}: {labels}")
        return {"FINISHED"}

    @staticmethod
    def _value(name: str, value: object) -> object:
        """The value to set; an image for its name. Raises WaterError for one that is not there."""
        if name not in parameters.OWN or not parameters.OWN[name].is_image:
            return value
        if value and value not in bpy.data.images:
            raise WaterError(
                f'There is no image "{value}" in this file: open it first, or give its exact name'
            )
        return bpy.data.images[value] if value else None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in self._shown(context.scene):
            layout.prop(self, name)


LAKE_WATER_OT_set_parameters.__annotations__ |= _options()


def _plain(value: object) -> object:
    """A value to compare: vectors and colors as tuples."""
    return tuple(value) if isinstance(value, (bpy.types.bpy_prop_array, Color)) else value


class LAKE_WATER_OT_new_map(bpy.types.Operator):
    """Make a tileable image of ripples, which can then be painted on, saved or exchanged"""

    bl_idname = "lake_water.new_map"
    bl_label = "New Map"
    bl_options = {"REGISTER", "UNDO"}

    parameter: StringProperty(
        description="Where the image goes, such as pond_normal_map_0", options={"HIDDEN", "SKIP_SAVE"}
    )
    seed: IntProperty(
        name="Seed",
        description="Another number gives other ripples; the same number the same",
        default=1,
        min=0,
        max=2**31 - 1,
    )
    size: IntProperty(
        name="Size",
        description="Width and height in pixels. The ripples of a tile are the same in any size",
        default=map_images.DEFAULT_SIZE,
        min=8,
        max=4096,
        soft_min=64,
        soft_max=1024,
        subtype="PIXEL",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if shown_water(context) is None:
            cls.poll_message_set("Select a water object first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        own = parameters.OWN.get(self.parameter)
        if own is None or own.kind not in map_images.LABELS:
            self.report({"ERROR"}, f'"{self.parameter}" is no normal map or dudv map')
            return {"CANCELLED"}
        group, name = place_of(self.parameter, context.scene, shown_water(context))
        setattr(group, name, map_images.wave_map(own.kind, self.seed, self.size))
        return {"FINISHED"}


class LAKE_WATER_OT_set_absorption(_ObjectModeOperator, bpy.types.Operator):
    """Take the absorption of the selected water from published measurements"""

    bl_idname = "lake_water.set_absorption"
    bl_label = "Published Values"

    water: EnumProperty(
        name="Water",
        description="The water that was measured",
        items=[
            (key, published.label, f"{published.description}. {published.per_metre} 1/m at {WAVELENGTHS} nm")
            for key, published in PUBLISHED.items()
        ],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            for obj in target_waters(context):
                obj.lake_water.traced.absorption = PUBLISHED[self.water].per_metre
        except WaterError as error:
            return self.refuse(error)
        return {"FINISHED"}


class LAKE_WATER_OT_reset_parameters(_ObjectModeOperator, bpy.types.Operator):
    """Put all parameters of the selected water, its waves and the scene's settings back to their defaults"""

    bl_idname = "lake_water.reset_parameters"
    bl_label = "Reset Parameters"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            targets = target_waters(context)
        except WaterError as error:
            return self.refuse(error)
        for obj in targets:
            water_objects.reset_water(obj)
        water_objects.reset_settings(context.scene.lake_water, keep=(*SCENE_DISPLAY, "calibration"))
        return {"FINISHED"}


class _WaveOperator:
    """Operators on the wave list of the water object that the panel shows."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if shown_water(context) is None:
            cls.poll_message_set("Select a water object first")
            return False
        return True


class LAKE_WATER_OT_wave_add(_WaveOperator, bpy.types.Operator):
    """Add a wave, like the active one but shorter and flatter"""

    bl_idname = "lake_water.wave_add"
    bl_label = "Add Wave"

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            water_objects.add_wave(shown_water(context))
        except water_objects.WaterError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class LAKE_WATER_OT_wave_remove(_WaveOperator, bpy.types.Operator):
    """Remove the active wave"""

    bl_idname = "lake_water.wave_remove"
    bl_label = "Remove Wave"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not super().poll(context):
            return False
        if not shown_water(context).lake_water.waves:
            cls.poll_message_set("The water has no waves")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        water_objects.remove_active_wave(shown_water(context))
        return {"FINISHED"}


def engine_is_registered() -> bool:
    """Whether Blender knows the render engine LAKE_WATER."""
    return any(
        getattr(cls, "bl_idname", "") == ENGINE_ID and cls.is_registered
        for cls in bpy.types.RenderEngine.__subclasses__()
    )


CLASSES = (
    LAKE_WATER_OT_add_lake,
    LAKE_WATER_OT_add_water,
    LAKE_WATER_OT_make_water,
    LAKE_WATER_OT_remove_water,
    LAKE_WATER_OT_set_parameters,
    LAKE_WATER_OT_new_map,
    LAKE_WATER_OT_set_absorption,
    LAKE_WATER_OT_reset_parameters,
    LAKE_WATER_OT_wave_add,
    LAKE_WATER_OT_wave_remove,
)


def register() -> None:
    """Add the operators."""
    register_classes(CLASSES)


def unregister() -> None:
    """Remove the operators."""
    unregister_classes(CLASSES)
