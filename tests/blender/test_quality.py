# SPDX-License-Identifier: GPL-3.0-or-later
"""Quality on a scene: written as settings when it is set, and derived from them whenever it is read."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from lake_water_addon.core.quality import CUSTOM, LARGEST, QUALITIES, quality_settings
from lake_water_addon.core.settings import DEFAULTS
from lake_water_addon.properties import longer_side


def set_resolution(x: int, y: int, percentage: int = 100) -> None:
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = x, y, percentage


@pytest.mark.parametrize("name", QUALITIES)
@pytest.mark.parametrize("size", [(320, 240, 100), (1080, 1920, 50), (3840, 2160, 100)])
def test_setting_it_writes_the_settings_and_reading_finds_it_again(
    name: str, size: tuple[int, int, int]
) -> None:
    settings = bpy.context.scene.lake_water
    set_resolution(*size)
    settings.technique = "TRACED"
    settings.use_glow = False
    settings.quality = name
    side = max(size[:2]) * size[2] // 100
    assert longer_side(bpy.context.scene) == side
    for key, value in quality_settings(name, side).items():
        assert getattr(settings, key) == pytest.approx(value), key
    assert settings.quality == name
    assert (settings.technique, settings.use_glow) == ("TRACED", False)
    settings.photon_size += 1
    assert settings.quality == CUSTOM


def test_every_size_of_texture_is_in_the_range_of_its_property() -> None:
    prop = bpy.context.scene.lake_water.bl_rna.properties["texture_size"]
    assert prop.hard_max == LARGEST


def test_it_is_custom_for_a_picture_of_another_size() -> None:
    settings = bpy.context.scene.lake_water
    set_resolution(640, 480)
    settings.quality = "FINE"
    set_resolution(1280, 960)
    assert settings.quality == CUSTOM
    set_resolution(1280, 960, 50)
    assert settings.quality == "FINE"


def test_custom_changes_nothing() -> None:
    settings = bpy.context.scene.lake_water
    settings.quality = "DRAFT"
    before = settings.texture_size
    settings.quality = CUSTOM
    assert settings.texture_size == before
    assert settings.quality == "DRAFT"


def test_it_is_not_saved_but_what_it_set_is(tmp_path: Path) -> None:
    bpy.context.scene.lake_water.quality = "BEST"
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.context.scene.lake_water.quality = "DRAFT"
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.context.scene.lake_water.quality == "BEST"


def test_reset_leads_back_to_the_defaults() -> None:
    bpy.ops.lake_water.add_water()
    settings = bpy.context.scene.lake_water
    settings.quality = "BEST"
    bpy.ops.lake_water.reset_parameters()
    assert settings.texture_size == DEFAULTS.texture_size
    assert settings.samples == settings.bl_rna.properties["samples"].default


def test_setting_it_tags_the_scene_for_the_viewports() -> None:
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    seen = []

    def note(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        seen.extend(update.id.original for update in depsgraph.updates)

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        scene.lake_water.quality = "DRAFT"
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    assert scene in seen
