# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as a person uses it: pictures of small scenes, read back from OpenEXR files."""

from __future__ import annotations

import math

import numpy as np
import pytest

SIZE = (96, 72)


@pytest.fixture
def pool(blender):
    """A floor 2 m under water, a post through the surface, a camera and a sun, for the engine LAKE_WATER."""
    from lake_water_addon import water_objects

    scene = blender.context.scene
    scene.render.engine = "LAKE_WATER"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.use_persistent_data = True
    scene.lake_water.samples = 1
    scene.world = blender.data.worlds.new("Sky")
    scene.world.color = (0.5, 0.6, 0.8)
    blender.ops.mesh.primitive_plane_add(size=40, location=(0, 0, -2))
    blender.ops.mesh.primitive_cube_add(size=1, location=(1, 0, 0))
    blender.context.object.scale = (0.6, 0.6, 3.0)
    blender.ops.object.light_add(type="SUN", rotation=(0.6, 0.2, 0.0))
    blender.context.object.data.energy = 3.0
    blender.ops.object.camera_add(location=(0, -9, 5), rotation=(math.radians(62), 0, 0))
    scene.camera = blender.context.object
    water_objects.create_water("Pool", 12.0, 12.0, scene.collection, (0, 0, 0))
    return scene


def render(scene, tmp_path) -> np.ndarray:
    """(h, w, 4) scene-linear, first row at the bottom."""
    import bpy

    from lake_water_addon.engine import last_render_report

    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.render.render(write_still=True)
    assert last_render_report()["error"] is None
    image = bpy.data.images.load(scene.render.filepath)
    try:
        pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(image.size[1], image.size[0], 4)
    finally:
        bpy.data.images.remove(image)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("border", [(0.25, 0.75, 0.25, 0.75), (0.1, 0.613, 0.333, 1.0)])
def test_border_render_is_that_part_of_the_picture(pool, tmp_path, border, samples):
    pool.lake_water.samples = samples
    whole = render(pool, tmp_path)
    pool.render.use_border = True
    pool.render.border_min_x, pool.render.border_max_x = border[:2]
    pool.render.border_min_y, pool.render.border_max_y = border[2:]
    left, right = (int(np.float32(b) * SIZE[0]) for b in border[:2])
    bottom, top = (int(np.float32(b) * SIZE[1]) for b in border[2:])

    placed = render(pool, tmp_path)
    inside = placed[bottom:top, left:right]
    np.testing.assert_allclose(inside, whole[bottom:top, left:right], atol=2e-3)
    outside = placed.copy()
    outside[bottom:top, left:right] = 0.0
    assert not outside.any()

    pool.render.use_crop_to_border = True
    np.testing.assert_array_equal(render(pool, tmp_path), inside)


def test_resolution_percentage(pool, tmp_path):
    pool.render.resolution_percentage = 50
    assert render(pool, tmp_path).shape == (SIZE[1] // 2, SIZE[0] // 2, 4)


def test_transparent_film_leaves_the_sky_out_and_keeps_it_in_the_mirror(pool, tmp_path):
    pool.camera.rotation_euler[0] = math.radians(80)
    opaque = render(pool, tmp_path)
    pool.render.film_transparent = True
    clear = render(pool, tmp_path)
    sky = clear[..., 3] == 0.0
    assert np.all(opaque[..., 3] == 1.0) and 0.05 < sky.mean() < 0.8
    np.testing.assert_array_equal(clear[~sky], opaque[~sky])


def test_picture_is_a_function_of_time_alone(pool, tmp_path):
    pool.frame_set(7)
    first = render(pool, tmp_path)
    pool.frame_set(100)
    other = render(pool, tmp_path)
    pool.frame_set(7)
    np.testing.assert_array_equal(render(pool, tmp_path), first)
    assert np.abs(other - first).max() > 0.01, "the waves do not move"


def test_frame_in_which_only_the_time_changed_makes_and_reads_nothing(pool, tmp_path):
    from lake_water_addon.engine import last_render_report

    for frame in (1, 2):
        pool.frame_set(frame)
        render(pool, tmp_path)
    report = last_render_report()
    assert report["created"] == {}, "GPU objects made in a frame where nothing but the time changed"
    assert report["extraction_s"] < 0.5 * report["frame_s"]


def test_mesh_surface_with_the_grids_vertices_is_drawn_like_the_grid(pool, blender, tmp_path):
    from lake_water_addon import water_objects

    water = blender.data.objects["Pool"]
    water.lake_water.grid_resolution = 33
    grid = render(pool, tmp_path)
    water_objects.remove_water(water)
    blender.ops.mesh.primitive_grid_add(x_subdivisions=32, y_subdivisions=32, size=12)
    mesh_water = blender.context.object
    blender.data.objects.remove(water)
    water_objects.make_water(mesh_water)
    assert mesh_water.lake_water.surface == "MESH"
    waves = water_objects.default_waves()
    water_objects.set_waves(mesh_water, waves)
    mesh = render(pool, tmp_path)
    # The two split their squares along different diagonals, so heights between vertices differ a little.
    assert np.mean(np.abs(mesh - grid)) < 2e-3


def test_two_bodies_at_different_heights_each_have_their_own_water(pool, blender, tmp_path):
    from lake_water_addon import water_objects

    blender.data.objects["Pool"].lake_water.water_color = (1.0, 0.0, 0.0)
    blender.data.objects["Pool"].lake_water.k = 50.0
    upper = water_objects.create_water("Upper", 3.0, 3.0, pool.collection, (-3, 0, 1.0))
    upper.lake_water.water_color = (0.0, 0.0, 1.0)
    upper.lake_water.k = 50.0
    picture = render(pool, tmp_path)
    red = (picture[..., 0] > 0.7) & (picture[..., 2] < 0.5)
    blue = (picture[..., 2] > 0.7) & (picture[..., 0] < 0.5)
    assert red.mean() > 0.1 and blue.mean() > 0.02
    assert np.argwhere(blue)[:, 1].mean() < SIZE[0] / 2, "the upper pool is on the left"


@pytest.mark.parametrize(
    "what", ["nothing but water", "no water", "mesh without faces", "zero scale", "no world"]
)
def test_odd_scenes_render(pool, blender, tmp_path, what):
    if what == "nothing but water":
        for obj in [o for o in pool.objects if o.name not in ("Pool", pool.camera.name)]:
            blender.data.objects.remove(obj)
    elif what == "no water":
        blender.data.objects.remove(blender.data.objects["Pool"])
    elif what == "mesh without faces":
        blender.data.objects["Plane"].data.clear_geometry()
    elif what == "zero scale":
        blender.data.objects["Cube"].scale = (0, 0, 0)
    else:
        pool.world = None
    picture = render(pool, tmp_path)
    assert np.isfinite(picture).all() and np.ptp(picture[..., :3]) > 0.01


def test_panoramic_camera_is_refused_with_words(pool, blender, capfd):
    from lake_water_addon.engine import last_render_report

    pool.camera.data.type = "PANO"
    blender.ops.render.render()
    assert "perspective and" in last_render_report()["error"]
    assert "Traceback" not in capfd.readouterr().err


def test_settings_of_the_scene_reach_the_picture(pool, blender, tmp_path):
    pictures = [render(pool, tmp_path)]
    changes = (
        ("lake_water.intersection_steps", lambda: setattr(pool.lake_water, "intersection_steps", 1)),
        ("lake_water.fov_ext", lambda: setattr(pool.lake_water, "fov_ext", 1.1)),
        ("lake_water.texture_size", lambda: setattr(pool.lake_water, "texture_size", 64)),
        *(
            (
                f"object.{name}",
                lambda name=name, value=value: setattr(blender.data.objects["Pool"].lake_water, name, value),
            )
            for name, value in (
                ("k", 2.0),
                ("q", 3.0),
                ("c", 3.0),
                ("ior", 1.6),
                ("water_color", (0.3, 0.1, 0)),
            )
        ),
    )
    for name, change in changes:
        change()
        pictures.append(render(pool, tmp_path))
        assert np.abs(pictures[-1] - pictures[-2]).max() > 1e-3, f"{name} changes nothing"


def test_only_what_changed_is_uploaded_again(pool, blender, tmp_path):
    from lake_water_addon.engine import last_render_report

    def made_by(change) -> dict[str, int]:
        change()
        render(pool, tmp_path)
        return last_render_report()["created"]

    def move_vertex() -> None:
        mesh = blender.data.objects["Plane"].data
        mesh.vertices[0].co.z += 0.1
        mesh.update()

    render(pool, tmp_path)
    render(pool, tmp_path)
    assert made_by(lambda: None) == {}
    assert made_by(lambda: setattr(pool.camera, "location", (1, -9, 5))) == {}, "the camera uploads nothing"
    water = blender.data.objects["Pool"]
    assert made_by(lambda: setattr(water.lake_water, "k", 0.1)) == {}, "a setting uploads nothing"
    cube = blender.data.objects["Cube"]
    assert made_by(lambda: setattr(cube, "location", (2, 1, 0))) == {"textures": 1}, "its matrix is a texture"
    assert made_by(move_vertex) == {"buffers": 1, "batches": 1, "textures": 1}, "one mesh and its matrices"
