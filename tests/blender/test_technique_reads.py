# SPDX-License-Identifier: GPL-3.0-or-later
"""`Technique.reads` says the truth: what it names changes the picture, and nothing else does."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from lake_water_addon.core import parameters
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.properties import place_of
from lake_water_addon.water_objects import create_water

# Marked changes of a lake from the defaults.
CHANGES = {
    **{"k": 3.0, "q": 1.5, "c": 8.0, "ior": 1.9, "water_color": (0.9, 0.1, 0.6), "depth": 0.05},
    **{"fov_ext": 3.0, "texture_size": 32, "intersection_steps": 1},
    **{"reflection_steps": 16, "use_exact_fresnel": True},
}
FROM_UNDER_WATER = {"RIPPLE": {"water_color"}}
"""What a technique reads only for a picture from under water."""


def build_pool() -> bpy.types.Object:
    """Water over an uneven bottom, with a post that stands out of it, sun and camera."""
    scene = bpy.context.scene
    for i in range(8):
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(i - 3.5, 0.0, -1.5 + 0.4 * (i % 2)))
        bpy.context.object.scale = (1.0, 8.0, 1.0)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.5, 1.0, 0.5))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler = (0.5, 0.2, 0.0)
    sun.data.energy = 3.0
    scene.collection.objects.link(sun)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    place = Vector((0.0, -7.0, 2.5))
    camera.matrix_world = Matrix.Translation(place) @ (-place).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    scene.render.engine = "LAKE_WATER"
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.lake_water.samples = 1
    scene.frame_set(50)
    return create_water("Pool", 8.0, 8.0, scene.collection)


def picture(path: Path) -> np.ndarray:
    """The scene's picture, (h, w, 4), as written to the path."""
    render = bpy.context.scene.render
    render.image_settings.file_format = "OPEN_EXR"
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(48, 64, 4)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_technique_reads_what_it_says_and_nothing_else(
    gpu: ModuleType, tmp_path: Path, technique: str
) -> None:
    obj, scene = build_pool(), bpy.context.scene
    scene.lake_water.technique = technique
    obj.lake_water.pond.geometric_waves = True  # else Pond has no use for waves
    path = tmp_path / "picture.exr"
    before = picture(path)

    def changes(name: str, value: object) -> bool:
        group, attribute = place_of(name, scene, obj)
        held = getattr(group, attribute)
        held = tuple(held) if hasattr(held, "__len__") and not isinstance(held, str) else held
        setattr(group, attribute, value)
        changed = np.abs(picture(path) - before).max() > 1e-3
        setattr(group, attribute, held)
        return bool(changed)

    reads = TECHNIQUES[technique].reads - FROM_UNDER_WATER.get(technique, set())
    assert {name for name, value in CHANGES.items() if changes(name, value)} == reads & set(CHANGES)
    for name, own in parameters.OWN.items():
        if own.technique != technique and isinstance(own.default, float):
            setattr(*place_of(name, scene, obj), own.default * 0.5 + 0.01)
    assert np.array_equal(picture(path), before), "it reads the settings of another technique"
    for wave in obj.lake_water.waves:
        wave.amplitude *= 1.5
    assert (np.abs(picture(path) - before).max() > 1e-3) == ("waves" in reads)


@pytest.mark.parametrize(("technique", "names"), FROM_UNDER_WATER.items())
def test_what_is_read_from_under_water(
    gpu: ModuleType, tmp_path: Path, technique: str, names: set[str]
) -> None:
    obj, scene = build_pool(), bpy.context.scene
    scene.lake_water.technique = technique
    scene.camera.location = (0.0, -3.0, -0.5)
    before = picture(tmp_path / "picture.exr")
    for name in names:
        setattr(*place_of(name, scene, obj), CHANGES[name])
        assert np.abs(picture(tmp_path / "picture.exr") - before).max() > 1e-3, name
