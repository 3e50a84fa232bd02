# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: what those that are shipped say, what applying one does, how a person saves and removes them."""

from __future__ import annotations

import re
from pathlib import Path

import bpy
import pytest

from lake_water_addon import presets, water_objects
from lake_water_addon.core import parameters
from lake_water_addon.core.attenuation import PUBLISHED
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.properties import place_of

NAMES = (
    "Calm sea at dusk",
    "Clear alpine lake",
    "Green pond",
    "Peat lake",
    "Pond 2006",
    "Swimming pool",
    "Thesis 2008",
)
# What decides the look, and not how finely it is drawn: that is a person's own choice.
LOOK = {
    *("technique", "use_caustics", "use_shadows", "use_glow", "use_exact_under_water"),
    *("glow_strength", "glow_exponent", "glow_threshold"),
}
QUALITY = {
    *("fov_ext", "texture_size", "least_grid_resolution"),
    *("intersection_steps", "refraction_steps", "reflection_steps", "use_exact_fresnel"),
    *("caustics_size", "photon_size", "caustics_steps", "light_depth_size"),
}


def add_water() -> bpy.types.Object:
    bpy.ops.lake_water.add_water()
    return bpy.context.object


def apply(name: str) -> None:
    assert bpy.ops.lake_water.preset_apply(filepath=str(presets.find(name))) == {"FINISHED"}


def values(obj: bpy.types.Object) -> dict[str, object]:
    """Every parameter, and the waves."""
    found = {"waves": water_objects.settings_of(obj).waves}
    for name in (*parameters.WATER, *parameters.OWN, *parameters.SCENE):
        value = getattr(*place_of(name, bpy.context.scene, obj))
        found[name] = tuple(value) if not isinstance(value, str) and hasattr(value, "__len__") else value
    return found


def assigned(path: Path) -> dict[str, object]:
    """What a preset's file sets, by attribute, the waves apart."""
    lines = re.findall(r"^(?:water|scene)\.([\w.]+) = (.*)$", path.read_text(), re.MULTILINE)
    return {name: eval(value, {}) for name, value in lines}  # our own file


def test_those_that_are_shipped_are_found_by_any_spelling() -> None:
    assert tuple(presets.paths()) == NAMES
    assert presets.find("thesis_2008") == presets.find("THESIS 2008") == presets.paths()["Thesis 2008"]
    with pytest.raises(presets.PresetError, match="no preset 'sea': choose one of Calm sea at dusk, Clear"):
        presets.find("sea")


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_says_all_of_the_look_in_values_that_hold(name: str) -> None:
    obj = add_water()
    path = presets.find(name)
    said = assigned(path)
    technique = TECHNIQUES[said["technique"]]
    spectral = {"traced.absorption"} if technique.spectral else set()
    assert LOOK | set(parameters.WATER) | spectral <= set(said)
    if name != "Thesis 2008":
        assert not QUALITY & set(said)
    apply(name)
    for key, value in said.items():
        group = bpy.context.scene.lake_water if key in parameters.SCENE else obj.lake_water
        held = group.path_resolve(key)
        held = tuple(held) if isinstance(value, tuple) else held
        assert held == (value if isinstance(value, str) else pytest.approx(value)), f"{key} was cut"
    waves = water_objects.settings_of(obj).waves
    assert len(waves) >= 4
    assert max(6.3 * wave.amplitude / wave.wavelength for wave in waves) < 0.15, "as steep as this they break"
    assert (obj.lake_water.enabled, obj.lake_water.surface) == (True, "GRID")
    if spectral:
        assert obj.lake_water.k == pytest.approx(sum(said["traced.absorption"]) / 3.0, rel=0.02)


def test_a_preset_does_the_same_whatever_was_before() -> None:
    obj = add_water()
    results = []
    for before in NAMES:
        apply(before)
        apply("Peat lake")
        results.append(
            {k: v for k, v in values(obj).items() if k not in QUALITY and not k.startswith("pond_")}
        )
    assert all(result == results[0] for result in results)


def test_the_thesis_is_its_table() -> None:
    obj = add_water()
    scene = bpy.context.scene.lake_water
    obj.lake_water.grid_resolution, scene.fov_ext, scene.intersection_steps = 100, 2.0, 7
    apply("Thesis 2008")
    assert (scene.technique, scene.fov_ext, scene.intersection_steps, scene.caustics_size) == (
        "LAKE",
        1.5,
        3,
        256,
    )
    assert (scene.glow_exponent, scene.glow_threshold, scene.glow_strength) == (200.0, 0.0, 1.0)
    assert (scene.use_exact_under_water, obj.lake_water.grid_resolution) == (False, 49)
    assert (obj.lake_water.k, obj.lake_water.q, obj.lake_water.c) == (0.5, 5.0, 1.0)
    assert tuple(obj.lake_water.water_color) == pytest.approx((0.0, 0.2, 0.1))


def test_absorption_is_the_published_one() -> None:
    obj = add_water()
    for name, published in (("Swimming pool", "PURE"), ("Green pond", "COASTAL_7")):
        apply(name)
        assert tuple(obj.lake_water.traced.absorption) == pytest.approx(PUBLISHED[published].per_metre)


def test_a_preset_is_applied_to_the_water_that_the_panel_shows_or_to_all_that_are_selected() -> None:
    first, second = add_water(), add_water()
    first.select_set(True)
    apply("Green pond")
    assert first.lake_water.k == second.lake_water.k == pytest.approx(0.66)
    bpy.data.objects.remove(second)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    apply("Peat lake")
    assert first.lake_water.k == pytest.approx(2.03)
    assert cube.lake_water.k == 0.5 and not cube.lake_water.waves
    evaluated = first.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert water_objects.settings_of(evaluated) == water_objects.settings_of(first)


def test_without_water_and_with_a_broken_file_it_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no water: use Add Lake"):
        apply("Peat lake")
    add_water()
    (tmp_path / "broken.py").write_text("import bpy\nwater = bpy.context.object.lake_water\nwater.k = None\n")
    with pytest.raises(RuntimeError, match=r"broken\.py fails: .*float.* Remove it, or save it anew"):
        bpy.ops.lake_water.preset_apply(filepath=str(tmp_path / "broken.py"))


def test_a_person_saves_applies_and_removes_one() -> None:
    obj = add_water()
    apply("Calm sea at dusk")
    obj.lake_water.ripple.flow_speed = 0.75
    obj.lake_water.pond.geometric_waves = True
    obj.lake_water.pond.normal_map_0 = bpy.data.images.new("map", 4, 4)
    bpy.context.scene.lake_water.texture_size = 256
    saved = values(obj)
    bpy.ops.mesh.primitive_cube_add()  # active, and no water
    assert bpy.ops.lake_water.preset_add(name="My sea") == {"FINISHED"}
    path = presets.find("my sea")
    assert not path.is_relative_to(presets.DATA)
    bpy.data.objects.remove(bpy.context.object)
    bpy.ops.lake_water.reset_parameters()
    bpy.context.scene.lake_water.caustics_method = "CPU"
    apply("My sea")
    # Images stay with the file, the method with the machine.
    assert values(obj) == saved | {"pond_normal_map_0": None, "caustics_method": "CPU"}
    assert bpy.ops.lake_water.preset_add(name="My sea", remove_name=True) == {"FINISHED"}
    assert tuple(presets.paths()) == NAMES and not path.exists()


def test_those_that_are_shipped_are_not_overwritten_or_removed() -> None:
    with pytest.raises(RuntimeError, match="Select the water"):
        bpy.ops.lake_water.preset_add(name="Mine")
    add_water()
    text = presets.find("Peat lake").read_text()
    assert bpy.ops.lake_water.preset_add(name="Peat lake") == {"CANCELLED"}
    assert bpy.ops.lake_water.preset_add(name="Peat lake", remove_name=True) == {"CANCELLED"}
    assert presets.find("Peat lake").read_text() == text
    assert tuple(presets.paths()) == NAMES
