# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of maps: made once, kept with the file, made again when lost; and what is said of a person's own."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from lake_water_addon.core import wave_maps
from lake_water_addon.map_images import image_messages, wave_map


def pixels_of(image):
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], image.channels)


def new_image(texels, *, data=True, as_float=False, name="Mine"):
    height, width = texels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=as_float, is_data=data)
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = texels
    image.pixels.foreach_set(rgba.ravel())
    return image


@pytest.mark.parametrize("kind", ["NORMAL", "DUDV"])
def test_an_image_holds_the_map(kind):
    image = wave_map(kind, 3, 64)
    np.testing.assert_allclose(pixels_of(image)[..., :3], wave_maps.make_map(kind, 3, 64), atol=1e-7)
    assert np.all(pixels_of(image)[..., 3] == 1.0)
    assert image.colorspace_settings.is_data
    assert image_messages(image, kind) == ()


def test_a_map_is_made_once():
    first = wave_map("NORMAL", 3, 64)
    assert first.name == "Lake Water Normal Map 3 64"
    first.name = "Another name"
    assert wave_map("NORMAL", 3, 64) == first
    others = [wave_map("NORMAL", 4, 64), wave_map("NORMAL", 3, 32), wave_map("DUDV", 3, 64)]
    assert len({first, *others}) == 4
    assert len(bpy.data.images) == 4


def test_somebody_elses_image_of_that_name_is_left_alone():
    mine = new_image(np.full((8, 8, 3), 0.25), name="Lake Water Normal Map 3 64")
    assert wave_map("NORMAL", 3, 64) != mine
    np.testing.assert_allclose(pixels_of(mine)[..., :3], 0.25, atol=0.5 / 255.0)


def test_a_map_is_saved_with_the_file(tmp_path):
    wave_map("DUDV", 3, 64).use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "pond.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "pond.blend"))
    (image,) = bpy.data.images
    assert wave_map("DUDV", 3, 64) == image
    assert not image.is_dirty
    np.testing.assert_allclose(pixels_of(image)[..., :3], wave_maps.make_map("DUDV", 3, 64), atol=1e-6)


def test_a_map_that_lost_its_pixels_is_made_again_in_its_place():
    """Blender blanks a generated image that is not packed when it opens the file."""
    lost = wave_map("NORMAL", 3, 64)
    blank = bpy.data.images.new("Renamed", 64, 64)
    blank["lake_water_map"] = lost["lake_water_map"]
    bpy.data.images.remove(lost)
    user = bpy.data.textures.new("User", "IMAGE")
    user.image = blank
    made = wave_map("NORMAL", 3, 64)
    assert made.name == "Renamed"
    assert user.image == made
    assert image_messages(made, "NORMAL") == ()
    assert len(bpy.data.images) == 1


def test_a_map_that_was_painted_on_is_kept():
    image = wave_map("NORMAL", 3, 64)
    image.pixels.foreach_set(np.full(64 * 64 * 4, 0.75, dtype=np.float32))
    assert wave_map("NORMAL", 3, 64) == image
    assert pixels_of(image)[0, 0, 0] == 0.75


def test_no_image_is_no_mistake():
    assert image_messages(None, "NORMAL") == ()


def test_an_image_without_a_file_is_named():
    image = bpy.data.images.new("Gone", 4, 4)
    image.source = "FILE"
    image.filepath = "//nowhere.png"
    (message,) = image_messages(image, "NORMAL")
    assert message.startswith('Image "Gone" has no pixels')
    assert "nowhere.png" in message


@pytest.mark.parametrize(("kind", "other"), [("NORMAL", "DUDV"), ("DUDV", "NORMAL")])
def test_the_other_kind_of_map_is_told(kind, other):
    image = new_image(wave_maps.make_map(other, 1, 64))
    labels = {"NORMAL": "normal map", "DUDV": "dudv map"}
    (message,) = image_messages(image, kind)
    assert message.startswith(f'Image "Mine" looks like a {labels[other]}, but a {labels[kind]} is needed')
    assert image_messages(image, other) == ()


@pytest.mark.parametrize("kind", ["NORMAL", "DUDV"])
def test_a_colour_space_that_bends_values_is_told(kind):
    """8 bits keep the file's own values, so that the kind is told, too; floats are converted on loading."""
    image = new_image(wave_maps.make_map(kind, 1, 64), data=False)
    (message,) = image_messages(image, kind)
    assert message.startswith('Image "Mine": its color space is sRGB')
    assert message.endswith("Set its Color Space to Non-Color")
    wrong = "DUDV" if kind == "NORMAL" else "NORMAL"
    assert len(image_messages(image, wrong)) == 2
    as_float = new_image(wave_maps.make_map(wrong, 1, 64), data=False, as_float=True, name="Float")
    assert len(image_messages(as_float, kind)) == 1


def test_another_picture_is_told():
    picture = np.random.default_rng(1).random((64, 64, 3))
    assert image_messages(new_image(picture), "NORMAL") == ('Image "Mine" does not look like a normal map',)
    assert image_messages(new_image(picture, name="Other"), "DUDV") == (
        'Image "Other" does not look like a dudv map',
    )


def test_a_file_on_disk_is_judged_by_its_own_values(tmp_path):
    """An 8-bit PNG that Blender tags as sRGB, as it does with any that is loaded."""
    saved = new_image(wave_maps.make_map("NORMAL", 1, 64))
    saved.file_format = "PNG"
    saved.filepath_raw = str(tmp_path / "normals.png")
    saved.save()
    loaded = bpy.data.images.load(saved.filepath_raw)
    (message,) = image_messages(loaded, "NORMAL")
    assert "color space" in message
    loaded.colorspace_settings.name = "Non-Color"
    assert image_messages(loaded, "NORMAL") == ()
