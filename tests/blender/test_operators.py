# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons: what they make, what they refuse and in which words, and that settings can be animated."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from lake_water_addon import handlers, operators, panels, preferences, properties, water_objects
from lake_water_addon.core import parameters
from lake_water_addon.core.attenuation import PUBLISHED
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import WaterSettings
from lake_water_addon.core.techniques import DEFAULT_TECHNIQUE, TECHNIQUES
from lake_water_addon.core.waves import max_height
from lake_water_addon.host import frame_settings
from lake_water_addon.map_images import image_messages
from lake_water_addon.sun_lights import SunFinder
from lake_water_addon.water_objects import WaterError

ALL_PARAMETERS = (*parameters.WATER, *parameters.OWN, *parameters.SCENE)


def add_water(**options: object) -> bpy.types.Object:
    assert bpy.ops.lake_water.add_water(**options) == {"FINISHED"}
    return bpy.context.object


def add_plane(**transform: object) -> bpy.types.Object:
    bpy.ops.mesh.primitive_plane_add(**transform)
    return bpy.context.object


def evaluated_settings(obj: bpy.types.Object) -> WaterSettings:
    return water_objects.settings_of(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()))


# What the buttons make


def test_add_water_makes_a_rectangle_at_the_cursor_with_the_default_settings() -> None:
    bpy.context.scene.cursor.location = (1.0, -2.0, 3.5)
    obj = add_water(size=8.0)
    assert tuple(obj.location) == (1.0, -2.0, 3.5)
    assert tuple(obj.dimensions)[:2] == (8.0, 8.0)
    assert obj.data.polygons[0].normal.z == 1.0, "the surface must face up"
    assert bpy.context.selected_objects == [obj]
    assert (obj.lake_water.enabled, obj.lake_water.surface) == (True, "GRID")
    assert obj.display_type == "WIRE", "Blender would draw the faces as well"
    assert not obj.hide_render and not obj.hide_viewport

    settings, default = water_objects.settings_of(obj), WaterSettings()
    assert (settings.k, settings.q, settings.c, settings.depth) == (
        default.k,
        default.q,
        default.c,
        default.depth,
    )
    assert settings.ior == pytest.approx(default.ior)
    assert settings.water_color == pytest.approx(default.water_color)
    assert bpy.context.scene.lake_water.technique == DEFAULT_TECHNIQUE


def test_default_waves_are_ripples_of_a_lake() -> None:
    waves = water_objects.settings_of(add_water()).waves
    assert len(waves) >= 4
    assert max_height(waves) == pytest.approx(0.1, rel=1e-4)
    assert 0.4 < min(w.wavelength for w in waves) and max(w.wavelength for w in waves) < 4.5
    steepness = [2.0 * math.pi * w.amplitude / w.wavelength for w in waves]
    assert max(steepness) < 0.1, "as steep as this they would break"
    assert len({round(w.direction, 3) for w in waves}) == len(waves)
    assert water_objects.default_waves() == water_objects.default_waves(), "not deterministic"


def test_add_lake_makes_a_whole_scene() -> None:
    assert bpy.ops.lake_water.add_lake(seed=3, detail=0.1) == {"FINISHED"}
    scene = bpy.context.scene
    assert scene.camera is not None
    assert scene.world is not None
    assert any(obj.type == "LIGHT" and obj.data.type == "SUN" for obj in scene.objects)
    assert water_objects.waters_of(scene) == [bpy.context.object]
    if operators.engine_is_registered():
        assert scene.render.engine == "LAKE_WATER"


def test_make_water_keeps_a_rectangle_as_grid_and_anything_else_as_mesh() -> None:
    cases = {
        "GRID": [add_plane(), add_plane(rotation=(0.0, 0.0, 0.7), location=(0.0, 0.0, 2.0), size=30.0)],
        "MESH": [],
    }
    bpy.ops.mesh.primitive_circle_add(fill_type="NGON")
    cases["MESH"].append(bpy.context.object)
    bpy.ops.mesh.primitive_grid_add()
    cases["MESH"].append(bpy.context.object)
    diamond = add_plane()
    diamond.data.transform(Matrix.Rotation(math.radians(45.0), 4, "Z"))
    cases["MESH"].append(diamond)
    subdivided = add_plane()
    subdivided.modifiers.new("Subdivision", "SUBSURF")
    cases["MESH"].append(subdivided)
    for surface, objects in cases.items():
        for obj in objects:
            bpy.context.view_layer.objects.active = obj
            assert bpy.ops.lake_water.make_water() == {"FINISHED"}
            assert obj.lake_water.surface == surface, obj.name


def test_turned_off_water_is_an_ordinary_mesh_again_and_keeps_its_settings() -> None:
    obj = add_plane()
    obj.display_type = "SOLID"
    bpy.ops.lake_water.make_water()
    bpy.ops.lake_water.set_parameters(k=2.0)
    assert bpy.ops.lake_water.remove_water() == {"FINISHED"}
    assert (obj.lake_water.enabled, obj.display_type) == (False, "SOLID")
    bpy.ops.lake_water.make_water()
    assert (obj.lake_water.k, obj.display_type) == (2.0, "WIRE")


# What they refuse


def _scaled_to_nothing() -> None:
    add_plane().scale = (1.0, 0.0, 1.0)


def _mirrored() -> None:
    add_plane().scale = (-1.0, 1.0, 1.0)


def _origin_elsewhere() -> None:
    add_plane().data.transform(Matrix.Translation((0.0, 0.0, 2.0)))


def _no_active_object() -> None:
    bpy.context.view_layer.objects.active = None


REFUSALS = {
    "no active object": (_no_active_object, "no active object"),
    "curve": (bpy.ops.curve.primitive_bezier_circle_add, "not a mesh but of type curve"),
    "empty": (bpy.ops.object.empty_add, "not a mesh but of type empty"),
    "no faces": (bpy.ops.mesh.primitive_circle_add, "no faces"),
    "monkey": (bpy.ops.mesh.primitive_monkey_add, "1.97 m high"),
    "zero scale": (_scaled_to_nothing, "scale of zero"),
    "tilted": (lambda: add_plane(rotation=(math.radians(17.0), 0.0, 1.0)), "tilted by 17°"),
    "mirrored": (_mirrored, "upside down"),
    "upside down": (lambda: add_plane(rotation=(math.pi, 0.0, 0.0)), "upside down"),
    "origin elsewhere": (_origin_elsewhere, "2 m above its origin"),
    "already water": (add_water, "water already"),
}


@pytest.mark.parametrize(("prepare", "words"), REFUSALS.values(), ids=REFUSALS.keys())
def test_make_water_says_why_not_and_changes_nothing(prepare: object, words: str) -> None:
    prepare()
    obj = bpy.context.object
    before = (obj.lake_water.enabled, obj.display_type, len(obj.lake_water.waves)) if obj else None
    with pytest.raises(RuntimeError, match=words) as refusal:  # what Python sees of an ERROR report
        bpy.ops.lake_water.make_water()
    assert "Traceback" not in str(refusal.value)
    assert obj is None or before == (obj.lake_water.enabled, obj.display_type, len(obj.lake_water.waves))


def test_a_tilt_of_less_than_a_degree_is_accepted() -> None:
    obj = add_plane()
    obj.rotation_euler = Euler((math.radians(0.9), 0.0, 0.3))
    assert bpy.ops.lake_water.make_water() == {"FINISHED"}


def test_create_water_refuses_a_size_that_is_not_positive() -> None:
    with pytest.raises(WaterError, match="must be greater than 0"):
        water_objects.create_water("Water", 0.0, 5.0, bpy.context.scene.collection)
    assert not bpy.data.objects


def test_parameters_without_water_say_what_to_press() -> None:
    with pytest.raises(RuntimeError, match="no water: use Add Lake"):
        bpy.ops.lake_water.set_parameters(k=1.0)
    first, second = add_water(), add_water()
    for obj in (first, second):
        obj.select_set(False)
    bpy.context.view_layer.objects.active = None
    with pytest.raises(RuntimeError, match="several water objects"):
        bpy.ops.lake_water.set_parameters(k=1.0)


# Parameters and waves


def test_set_parameters_sets_what_is_given_and_leaves_the_rest() -> None:
    obj = add_water()
    obj.lake_water.q = 4.5
    bpy.ops.lake_water.set_parameters(k=0.25, fov_ext=1.2, water_color=(0.1, 0.2, 0.3))
    bpy.ops.lake_water.set_parameters(c=2.0)
    settings = obj.lake_water
    assert (settings.k, settings.q, settings.c) == (0.25, 4.5, 2.0)
    assert tuple(settings.water_color) == pytest.approx((0.1, 0.2, 0.3))
    assert bpy.context.scene.lake_water.fov_ext == pytest.approx(1.2)


def test_set_parameters_leaves_what_is_not_given_as_it_is_on_each_selected_water() -> None:
    first, second = add_water(), add_water()
    first.select_set(True)
    first.lake_water.q, second.lake_water.q = 3.0, 7.0
    bpy.ops.lake_water.set_parameters(k=1.5)
    assert [(o.lake_water.k, o.lake_water.q) for o in (first, second)] == [(1.5, 3.0), (1.5, 7.0)]


def test_set_parameters_finds_the_only_water_of_the_scene() -> None:
    water = add_water()
    add_plane()
    bpy.ops.lake_water.set_parameters(k=1.5)
    assert water.lake_water.k == 1.5


def another(value: object) -> object:
    """A value of the same type that a setting with this one may have, too."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, tuple):
        return tuple(part + 0.03125 for part in value)
    return value + 1 if isinstance(value, int) else value + 0.03125


def other_values(obj: bpy.types.Object) -> dict[str, object]:
    """Another value for every parameter but the technique, as `set_parameters` takes it."""
    image = bpy.data.images.get("map") or bpy.data.images.new("map", 4, 4, is_data=True)
    values = {}
    for name in ALL_PARAMETERS:
        if name in parameters.OWN and parameters.OWN[name].is_image:
            values[name] = image.name
        elif name != "technique":
            value = getattr(*properties.place_of(name, bpy.context.scene, obj))
            if isinstance(value, str):
                values[name] = {"caustics_method": "CPU"}[name]
            else:
                values[name] = another(tuple(value) if hasattr(value, "__len__") else value)
    return values


def test_set_parameters_takes_every_parameter_of_every_technique() -> None:
    obj, scene = add_water(), bpy.context.scene
    values = other_values(obj)
    for name, value in values.items():
        bpy.ops.lake_water.set_parameters(**{name: value})
    bpy.ops.lake_water.set_parameters(technique="RIPPLE")
    assert scene.lake_water.technique == "RIPPLE"
    for name, value in values.items():
        held = getattr(*properties.place_of(name, scene, obj))
        if isinstance(held, bpy.types.Image):
            held = held.name
        elif isinstance(value, tuple):
            held = tuple(held)
        assert held == (value if isinstance(value, str) else pytest.approx(value)), name


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_set_parameters_says_what_has_no_effect(technique: str, capfd: pytest.CaptureFixture[str]) -> None:
    obj = add_water()
    scene = bpy.context.scene.lake_water
    scene.technique = technique
    read = TECHNIQUES[technique].reads
    all_read = frozenset().union(*(t.reads for t in TECHNIQUES.values()))
    own = {name for name, parameter in parameters.OWN.items() if parameter.technique == technique}
    silent = (
        (set(parameters.WATER) & read) | own | {n for n in parameters.SCENE if n in read or n not in all_read}
    )
    for name, value in other_values(obj).items():
        capfd.readouterr()
        assert bpy.ops.lake_water.set_parameters(**{name: value}) == {"FINISHED"}
        said = "No effect with the technique " + TECHNIQUES[technique].label in "".join(capfd.readouterr())
        assert said == (name not in silent), name


def test_set_parameters_refuses_an_image_that_is_not_there() -> None:
    obj = add_water()
    with pytest.raises(RuntimeError, match='no image "nowhere" in this file'):
        bpy.ops.lake_water.set_parameters(pond_bias_map="nowhere", k=2.0)
    assert obj.lake_water.k == 0.5, "half of it was done"
    obj.lake_water.pond.bias_map = bpy.data.images.new("map", 4, 4)
    bpy.ops.lake_water.set_parameters(pond_bias_map="")
    assert obj.lake_water.pond.bias_map is None


def test_published_absorption_and_new_maps_are_one_click_away() -> None:
    obj = add_water()
    for key, published in PUBLISHED.items():
        bpy.ops.lake_water.set_absorption(water=key)
        assert tuple(obj.lake_water.traced.absorption) == pytest.approx(published.per_metre)
    bpy.ops.lake_water.new_map(parameter="ripple_dudv_map", seed=3, size=32)
    bpy.ops.lake_water.new_map(parameter="pond_normal_map_1", seed=3, size=32)
    settings = obj.lake_water
    assert image_messages(settings.ripple.dudv_map, "DUDV") == ()
    assert image_messages(settings.pond.normal_map_1, "NORMAL") == ()
    assert settings.pond.normal_map_0 is None
    for wrong in ("", "pond_bias", "pond_bias_map"):
        with pytest.raises(RuntimeError, match="is no normal map or dudv map"):
            bpy.ops.lake_water.new_map(parameter=wrong)


def test_reset_puts_everything_but_the_display_back() -> None:
    obj, scene = add_water(), bpy.context.scene
    waves = water_objects.settings_of(obj).waves
    bpy.ops.lake_water.set_parameters(k=2.0, q=3.0, c=4.0, fov_ext=2.0, water_color=(1.0, 1.0, 1.0))
    obj.lake_water.grid_resolution = 200
    obj.lake_water.waves.clear()
    for field in fields(FrameSettings):
        if isinstance(field.default, bool):
            setattr(scene.lake_water, field.name, not field.default)
        elif not isinstance(field.default, str):
            setattr(scene.lake_water, field.name, field.default + 1)
    scene.lake_water.caustics_method = "CPU"
    bpy.ops.lake_water.set_parameters(technique="POND", **other_values(obj))
    scene.lake_water.show_in_viewport = False
    bpy.ops.lake_water.reset_parameters()
    settings = water_objects.settings_of(obj)
    assert (settings.k, settings.q, settings.c) == (0.5, 5.0, 1.0)
    assert settings.waves == waves
    for own in settings.own:
        for field in fields(own):
            assert getattr(own, field.name) == pytest.approx(field.default), field.name
    assert settings.images == ()
    assert obj.lake_water.grid_resolution == 49
    assert asdict(frame_settings(scene)) == pytest.approx(asdict(FrameSettings()))
    assert obj.lake_water.enabled and obj.display_type == "WIRE"
    assert not scene.lake_water.show_in_viewport


def test_waves_are_added_and_removed_down_to_none() -> None:
    obj = add_water()
    count = len(obj.lake_water.waves)
    bpy.ops.lake_water.wave_add()
    added = obj.lake_water.waves[count]
    assert obj.lake_water.active_wave == count
    assert 0.0 < added.wavelength < obj.lake_water.waves[0].wavelength
    for _ in range(count + 1):
        bpy.ops.lake_water.wave_remove()
    assert (len(obj.lake_water.waves), obj.lake_water.active_wave) == (0, 0)
    assert not bpy.ops.lake_water.wave_remove.poll()
    bpy.ops.lake_water.wave_add()
    assert len(obj.lake_water.waves) == 1


def test_values_out_of_range_are_clamped() -> None:
    settings = add_water().lake_water
    settings.k, settings.ior, settings.grid_resolution = -1.0, 0.5, 5000
    settings.waves[0].wavelength = 0.0
    assert (settings.k, settings.ior, settings.grid_resolution) == (0.0, 1.0, 1024)
    assert settings.waves[0].wavelength > 0.0


# What Blender does with the settings


def test_a_change_from_python_reaches_the_evaluated_scene() -> None:
    obj, scene = add_water(), bpy.context.scene
    evaluated_settings(obj)
    changed: list[str] = []
    listener = handlers.Listener(
        updated=lambda scene, depsgraph: changed.extend(u.id.name for u in depsgraph.updates)
    )
    handlers.subscribe(listener)
    try:
        for change in (
            lambda: setattr(obj.lake_water, "k", 1.25),
            lambda: setattr(obj.lake_water.waves[1], "amplitude", 0.5),
            bpy.ops.lake_water.wave_remove,
            bpy.ops.lake_water.reset_parameters,
        ):
            changed.clear()
            change()
            assert evaluated_settings(obj) == water_objects.settings_of(obj)
            assert obj.name in changed
        for change in (
            lambda: setattr(scene.lake_water, "fov_ext", 1.25),
            bpy.ops.lake_water.reset_parameters,
        ):
            changed.clear()
            change()
            bpy.context.view_layer.update()
            assert scene.name in changed
    finally:
        handlers.unsubscribe(listener)


def test_settings_can_be_animated_and_driven() -> None:
    obj, scene = add_water(), bpy.context.scene
    for frame, value in ((1, 0.0), (11, 1.0)):
        obj.lake_water.k = obj.lake_water.waves[0].amplitude = value
        obj.lake_water.keyframe_insert("k", frame=frame)
        obj.lake_water.waves[0].keyframe_insert("amplitude", frame=frame)
    obj.lake_water.driver_add("q").driver.expression = "2 * frame"
    scene.lake_water.driver_add("fov_ext").driver.expression = "1 + frame / 10"
    scene.frame_set(6)
    settings = evaluated_settings(obj)
    assert (settings.k, settings.waves[0].amplitude, settings.q) == pytest.approx((0.5, 0.5, 12.0))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert scene.evaluated_get(depsgraph).lake_water.fov_ext == pytest.approx(1.6)


def test_settings_are_saved_with_the_file(tmp_path: Path) -> None:
    obj = add_water()
    bpy.ops.lake_water.set_parameters(k=0.75, fov_ext=1.25, pond_bias=0.75, traced_march_steps=7)
    saved, name = water_objects.settings_of(obj), obj.name
    path = str(tmp_path / "lake.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    loaded = bpy.data.objects[name]
    assert water_objects.settings_of(loaded) == saved
    assert (loaded.lake_water.enabled, loaded.display_type) == (True, "WIRE")
    assert bpy.context.scene.lake_water.fov_ext == 1.25
    assert handlers.waters(bpy.context.scene) == [loaded]


def test_settings_of_techniques_hold_in_a_library_override(tmp_path: Path) -> None:
    name = add_water().name
    lake, user = str(tmp_path / "lake.blend"), str(tmp_path / "user.blend")
    bpy.ops.wm.save_as_mainfile(filepath=lake)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(lake, link=True) as (_, linked):
        linked.objects = [name]
    obj = linked.objects[0].override_create(remap_local_usages=True)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    bpy.context.view_layer.objects.active = obj
    values = {
        "k": 2.0,
        "pond_bias": 0.75,
        "ripple_flow_speed": 0.5,
        "traced_march_steps": 7,
        "simple_lake_step": 0.5,
    }
    bpy.ops.lake_water.set_parameters(**values)
    bpy.ops.wm.save_as_mainfile(filepath=user)
    bpy.ops.wm.open_mainfile(filepath=user)
    obj = next(o for o in bpy.data.objects if o.override_library is not None)
    held = {name: getattr(*properties.place_of(name, bpy.context.scene, obj)) for name in values}
    assert held == values


def test_every_setting_is_explained() -> None:
    for group in properties.CLASSES:
        for prop in group.bl_rna.properties:
            if prop.identifier not in {"rna_type", "name"}:
                assert prop.description, f"{group.__name__}.{prop.identifier} has no description"
    for technique in TECHNIQUES.values():
        assert technique.label and technique.description


def test_preferences_of_a_checkout_are_the_built_in_defaults() -> None:
    assert preferences.defaults(bpy.context) == preferences.Defaults()


def test_first_water_takes_over_the_preferences_but_not_over_a_choice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = preferences.Defaults(show_in_viewport=False, show_statistics=True, grid_resolution=100)
    monkeypatch.setattr(preferences, "defaults", lambda context: own)
    settings = bpy.context.scene.lake_water
    settings.show_statistics = False
    assert add_water().lake_water.grid_resolution == 100
    assert (settings.show_in_viewport, settings.show_statistics) == (False, False)
    settings.show_in_viewport = True
    add_water()
    assert settings.show_in_viewport


def test_waters_are_found_without_looking_at_every_object() -> None:
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("Many")
    for i in range(2000):
        scene.collection.objects.link(bpy.data.objects.new(f"Many {i}", mesh))
    obj = add_water()
    bpy.context.view_layer.update()
    assert handlers.waters(scene) == [obj]
    assert _seconds(lambda: handlers.waters(scene)) < 0.1 * _seconds(lambda: water_objects.waters_of(scene))
    obj.name = "Another name"
    assert handlers.waters(scene) == [obj]
    scene.collection.objects.unlink(obj)
    bpy.context.view_layer.update()
    assert handlers.waters(scene) == []
    scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    assert handlers.waters(scene) == [obj]
    bpy.data.objects.remove(obj)
    assert handlers.waters(scene) == []


# What the sun's panels show


class Layout:
    """Stands for Blender's layout, which only a window has: remembers labels, and which values are dimmed."""

    def __init__(self) -> None:
        self.active = True
        self.parts: list[Layout] = []
        self.labels: list[str] = []
        self.buttons: list[str] = []
        self.values: list[str] = []

    def column(self, **_options: object) -> Layout:
        self.parts.append(Layout())
        return self.parts[-1]

    split = row = column

    def separator(self) -> None:
        pass

    def label(self, *, text: str = "", **_options: object) -> None:
        self.labels.append(text)

    def prop(self, _data: object, name: str, **_options: object) -> None:
        self.values.append(name)

    template_ID = prop

    def operator(self, name: str = "", *_more: object, **_options: object) -> Layout:
        self.buttons.append(name)
        return self

    operator_menu_enum = popover = operator

    def template_list(
        self, _kind: str, _name: str, _data: object, name: str, *_other: object, **_more: object
    ) -> None:
        self.values.append(name)

    def shown(self) -> dict[str, bool]:
        """Each value with whether it is bright."""
        of_parts = {name: on and self.active for part in self.parts for name, on in part.shown().items()}
        return dict.fromkeys(self.values, self.active) | of_parts

    def text(self) -> list[str]:
        return self.labels + [line for part in self.parts for line in part.text()]


def draw_panel(effect: type) -> Layout:
    panel = type("Panel", (effect,), {"layout": Layout()})()
    panel.draw(bpy.context)
    return panel.layout


def draw_registered(panel: type[bpy.types.Panel]) -> Layout:
    """Draw a panel of Blender's own kind, of which only a window has instances."""
    stand_in = SimpleNamespace(layout=Layout(), _draw_map=getattr(panel, "_draw_map", None))
    panel.draw(stand_in, bpy.context)
    return stand_in.layout


SIDEBAR = tuple(
    getattr(panels, f"VIEW3D_PT_lake_water{name}") for name in ("", "_water", "_own", "_waves", "_rendering")
)


def shown_in_sidebar() -> set[str]:
    """Settings that the sidebar shows, those of a technique under the names of `core.parameters`."""
    own = panels.VIEW3D_PT_lake_water_own
    found = set()
    for panel in SIDEBAR:
        if panel.poll(bpy.context) if hasattr(panel, "poll") else True:
            prefix = bpy.context.scene.lake_water.technique.lower() + "_" if panel is own else ""
            found |= {prefix + name for name in draw_registered(panel).shown()}
    return found.union(*(draw_panel(effect).shown() for effect in EFFECTS), {e.switch for e in EFFECTS})


EFFECTS = (panels._Caustics, panels._Shadows, panels._Glow)


def test_every_setting_of_the_picture_is_in_a_panel() -> None:
    layout = Layout()
    panels.draw_render_settings(layout, bpy.context.scene)
    found = set(layout.shown()).union(*(draw_panel(effect).shown() for effect in EFFECTS))
    found |= {effect.switch for effect in EFFECTS}
    assert {field.name for field in fields(FrameSettings)} <= found


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_the_panel_shows_what_the_technique_reads_and_nothing_else(technique: str) -> None:
    add_water()
    bpy.context.scene.lake_water.technique = technique
    read = {name for name in ALL_PARAMETERS if parameters.has_effect(name, technique)}
    assert shown_in_sidebar() & set(ALL_PARAMETERS) == read
    assert ("waves" in shown_in_sidebar()) == ("waves" in TECHNIQUES[technique].reads)


def test_every_parameter_has_a_place_in_some_panel() -> None:
    add_water()
    found = set()
    for technique in TECHNIQUES:
        bpy.context.scene.lake_water.technique = technique
        found |= shown_in_sidebar()
    assert set(ALL_PARAMETERS) <= found


def test_waves_that_the_technique_leaves_flat_are_dimmed() -> None:
    obj = add_water()
    bpy.context.scene.lake_water.technique = "POND"
    for raised in (False, True):
        obj.lake_water.pond.geometric_waves = raised
        shown = draw_registered(panels.VIEW3D_PT_lake_water_waves).shown()
        assert shown["waves"] == shown["depth"] == raised


def test_the_panel_warns_of_an_image_that_is_no_map(monkeypatch: pytest.MonkeyPatch) -> None:
    obj, scene = add_water(), bpy.context.scene
    scene.lake_water.technique = "RIPPLE"

    def said() -> str:
        return " ".join(draw_registered(panels.VIEW3D_PT_lake_water_own).text())

    before = len(bpy.data.images)
    assert said() == "" and len(bpy.data.images) == before, "nothing is made while Blender draws"
    image = obj.lake_water.ripple.dudv_map = bpy.data.images.new("mine", 4, 4)
    assert "its color space is sRGB" in said() and 'Image "mine" does not look like a dudv map' in said()
    image.colorspace_settings.name = "Non-Color"
    assert "color space" not in said() and "does not look like" in said()
    bpy.ops.lake_water.new_map(parameter="ripple_dudv_map", size=16)
    assert said() == ""
    # Told once, and not asked again at each redraw.
    monkeypatch.setattr(panels, "image_messages", lambda *_: pytest.fail("read again"))
    assert said() == ""
    scene.lake_water.technique = "POND"
    obj.lake_water.pond.bias_map = bpy.data.images.new("film", 4, 4)
    assert said() == ""
    obj.lake_water.pond.bias_map.source = "MOVIE"
    assert "is of the kind movie, which is not supported" in said()


def test_values_that_change_nothing_are_dimmed() -> None:
    settings = bpy.context.scene.lake_water
    bpy.ops.object.light_add(type="SUN")
    for effect in EFFECTS:
        assert all(draw_panel(effect).shown().values())
    settings.use_glow = settings.use_shadows = False
    assert not any(draw_panel(panels._Glow).shown().values())
    assert all(draw_panel(panels._Shadows).shown().values()), "caustics need the light's depth, too"
    settings.use_caustics = False
    for effect in EFFECTS:
        assert not any(draw_panel(effect).shown().values())


def test_without_a_sun_its_panels_say_so() -> None:
    bpy.ops.object.light_add(type="POINT")
    for effect in EFFECTS:
        layout = draw_panel(effect)
        assert layout.text()[0] == "No sun light in this scene"
        assert not any(layout.shown().values())


def test_the_panel_says_how_caustics_are_summed_here(
    gpu: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def said(wanted: str) -> str:
        layout = Layout()
        panels._Caustics().draw_method(layout, wanted)
        return " ".join(sorted(layout.text()))

    assert [said(method) for method in ("AUTO", "CPU", "GPU_COMPUTE")] == ["GPU Compute In Use", "", ""]
    monkeypatch.setattr(gpu.platform, "backend_type_get", lambda: "METAL")
    assert said("AUTO") == "GPU Points In Use"
    assert "GPU Compute" in said("GPU_COMPUTE") and "Metal" in said("GPU_COMPUTE")


def test_a_sun_is_found_wherever_it_is() -> None:
    scene = bpy.context.scene

    def has_sun() -> bool:
        bpy.context.view_layer.update()
        return handlers.has_sun(scene, bpy.context.view_layer)

    bpy.ops.object.light_add(type="SUN")
    sun = bpy.context.object
    assert has_sun() and has_sun()
    sun.hide_set(True)
    assert has_sun(), "it may still be in the render"
    sun.data.type = "SPOT"
    assert not has_sun()
    sun.data.type = "SUN"
    assert has_sun()
    scene.collection.objects.unlink(sun)
    assert not has_sun()
    sky = bpy.data.collections.new("Sky")
    sky.objects.link(sun)
    bpy.ops.object.collection_instance_add(collection=sky.name)
    assert has_sun()
    bpy.data.objects.remove(sun)
    assert not has_sun()


def test_a_known_sun_is_found_without_looking_at_every_object() -> None:
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("Many")
    for i in range(2000):
        scene.collection.objects.link(bpy.data.objects.new(f"Many {i}", mesh))
    bpy.ops.object.light_add(type="SUN")
    known = _seconds(lambda: handlers.has_sun(scene, bpy.context.view_layer))
    assert known < 0.1 * _seconds(lambda: SunFinder().has_sun(scene, bpy.context.view_layer))


def _seconds(function: object, repeats: int = 5) -> float:
    """The shortest of several runs."""
    import time

    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.min(times))
