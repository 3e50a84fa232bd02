# SPDX-License-Identifier: GPL-3.0-or-later
"""The water of Cycles and EEVEE: the surface of `core/waves.py`, the model's optics, off when not in use."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import lake_water_addon
from lake_water_addon import water_objects
from lake_water_addon.core import optics, waves
from lake_water_addon.core.waves import MAX_WAVES, SineWave
from lake_water_addon.extract import SceneExtractor
from lake_water_addon.nodes import carry, drivers, material, sine_waves, switching, trees

FRAMES = (0, 1, 1000, 100000)


def add_water(size: float = 20.0, **transform: object) -> bpy.types.Object:
    obj = water_objects.create_water("Lake", size, 0.7 * size, bpy.context.scene.collection)
    for name, value in transform.items():
        setattr(obj, name, value)
    return obj


def add_mesh_water() -> bpy.types.Object:
    """A triangulated disc, uneven by some centimetres."""
    bpy.ops.mesh.primitive_circle_add(vertices=48, radius=5.0, fill_type="TRIFAN")
    obj = bpy.context.object
    mesh = obj.data
    for vertex in mesh.vertices:
        vertex.co.z = 0.05 * math.sin(vertex.co.x)
    mesh.shade_smooth()
    water_objects.make_water(obj)
    return obj


def switch_to(engine: str) -> None:
    bpy.context.scene.render.engine = engine
    bpy.context.view_layer.update()


def evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def positions(mesh: bpy.types.Mesh) -> np.ndarray:
    values = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.attributes["position"].data.foreach_get("vector", values.ravel())
    return values.astype(np.float64)


def from_origin(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> np.ndarray:
    """(V, 3) positions along the world's axes from the object's origin: no digits lost far away."""
    return positions(mesh) @ np.array(obj.matrix_world.to_3x3()).T


def packed_waves(obj: bpy.types.Object) -> np.ndarray:
    scene = bpy.context.scene
    settings = water_objects.settings_of(evaluated(obj))
    time = scene.frame_current_final * scene.render.fps_base / scene.render.fps
    heading = math.atan2(obj.matrix_world[1][0], obj.matrix_world[0][0])
    return waves.pack(settings.waves, time, settings.depth, heading)


def worst_height(obj: bpy.types.Object, flat: float | np.ndarray = 0.0) -> float:
    """Greatest distance of the evaluated mesh from core's surface, m."""
    points = from_origin(obj, evaluated(obj).data)
    return float(np.abs(points[:, 2] - flat - waves.height(packed_waves(obj), points[:, :2])).max())


# The surface


@pytest.mark.parametrize(
    "transform",
    [
        {},
        {"rotation_euler": (0.0, 0.0, 2.3), "scale": (1.5, 0.6, 3.0), "location": (30.0, -20.0, 4.0)},
        {"location": (2e6, -1e6, 100.0), "rotation_euler": (0.0, 0.0, -0.4)},
    ],
    ids=["plain", "turned and scaled", "far away"],
)
def test_grid_equals_core_at_any_frame(transform: dict[str, object]) -> None:
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    obj = add_water(**transform)
    for frame in FRAMES:
        scene.frame_set(frame)
        assert len(evaluated(obj).data.vertices) == 49 * 49
        assert worst_height(obj) < 1e-5
    scene.frame_set(1000, subframe=0.25)
    assert worst_height(obj) < 1e-5
    points = from_origin(obj, evaluated(obj).data)
    assert np.ptp(points[:, 2]) > 0.1, "the surface is flat"


def test_grid_is_the_grid_of_the_water_body() -> None:
    obj = add_water(rotation_euler=(0.0, 0.0, 0.6), scale=(2.0, 1.0, 1.0))
    obj.data.transform(Matrix.Translation((3.0, 1.0, 0.0)))
    obj.lake_water.grid_resolution = 33
    mesh = evaluated(obj).data
    switch_to("LAKE_WATER")
    (body,) = SceneExtractor().snapshot(bpy.context.evaluated_depsgraph_get()).waters
    resolution, half_x, half_y, center_x, center_y = body.grid
    line = np.linspace(-1.0, 1.0, resolution)
    x, y = np.meshgrid(center_x + half_x * line, center_y + half_y * line, indexing="ij")
    switch_to("CYCLES")
    mesh = evaluated(obj).data
    framed = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.attributes[sine_waves.FRAME_ATTRIBUTE].data.foreach_get("vector", framed.ravel())
    np.testing.assert_allclose(framed[:, :2], np.stack([x.ravel(), y.ravel()], axis=1), atol=1e-5)
    assert all(polygon.normal.z > 0.0 for polygon in mesh.polygons)


def test_own_mesh_is_displaced_vertex_by_vertex() -> None:
    obj = add_mesh_water()
    flat = positions(obj.data)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        mesh = evaluated(obj).data
        assert len(mesh.vertices) == len(flat)
        np.testing.assert_allclose(positions(mesh)[:, :2], flat[:, :2], atol=1e-5)
        assert worst_height(obj, flat[:, 2]) < 1e-5


def test_faces_that_look_down_are_turned_up() -> None:
    obj = add_mesh_water()
    obj.data.flip_normals()
    obj.update_tag()
    assert all(polygon.normal.z > 0.0 for polygon in evaluated(obj).data.polygons)


def test_normals_equal_core() -> None:
    obj = add_water(rotation_euler=(0.0, 0.0, 1.1), scale=(0.5, 2.0, 1.5))
    bpy.context.scene.frame_set(77)
    mesh = evaluated(obj).data
    local = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertex_normals.foreach_get("vector", local.ravel())
    world = local @ np.linalg.inv(np.array(obj.matrix_world.to_3x3()))
    world /= np.linalg.norm(world, axis=1, keepdims=True)
    expected = waves.normal(packed_waves(obj), from_origin(obj, mesh)[:, :2])
    np.testing.assert_allclose(world, expected, atol=1e-5)
    assert mesh.normals_domain == "POINT", "smooth over the whole surface"


def test_the_most_waves_that_there_can_be() -> None:
    obj = add_water()
    water_objects.set_waves(obj, [SineWave(0.01, 0.3 + 0.17 * i, 0.2 * i, 0.1 * i) for i in range(MAX_WAVES)])
    bpy.context.scene.frame_set(5000)
    assert worst_height(obj) < 1e-5
    obj.lake_water.waves.add().amplitude = 1.0  # beyond what can be summed: it does not count
    points = from_origin(obj, evaluated(obj).data)
    expected = waves.height(packed_waves(obj)[:MAX_WAVES], points[:, :2])
    np.testing.assert_allclose(points[:, 2], expected, atol=1e-5)


def test_no_waves_is_flat() -> None:
    obj = add_water()
    obj.lake_water.waves.clear()
    obj.update_tag()
    assert positions(evaluated(obj).data)[:, 2] == pytest.approx(0.0)


def test_waves_added_and_removed_are_noticed() -> None:
    obj = add_water()
    evaluated(obj)
    bpy.context.view_layer.objects.active = obj
    for change in (
        bpy.ops.lake_water.wave_add,
        bpy.ops.lake_water.wave_remove,
        bpy.ops.lake_water.wave_remove,
    ):
        change()
        bpy.context.view_layer.update()
        assert worst_height(obj) < 1e-5
        assert carry.waves_shown(obj) == len(obj.lake_water.waves)


def test_settings_under_animation_and_drivers() -> None:
    obj, scene = add_water(), bpy.context.scene
    settings = obj.lake_water
    for frame, value in ((1, 0.02), (101, 0.4)):
        settings.waves[0].amplitude = settings.waves[1].direction = value
        settings.waves[0].keyframe_insert("amplitude", frame=frame)
        settings.waves[1].keyframe_insert("direction", frame=frame)
        settings.depth = 10.0 * value
        settings.keyframe_insert("depth", frame=frame)
        settings.k = value
        settings.keyframe_insert("k", frame=frame)
    settings.waves[2].driver_add("wavelength").driver.expression = "1 + frame / 100"
    settings.driver_add("grid_resolution").driver.expression = "frame + 2"
    for frame in (1, 40, 101):
        scene.frame_set(frame)
        assert worst_height(obj) < 1e-5
        assert len(evaluated(obj).data.vertices) == (frame + 2) ** 2
        worn = carry.material_of(obj).evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert worn.node_tree.nodes[material.WATER].inputs["k"].default_value == pytest.approx(
            evaluated(obj).lake_water.k
        )


def test_time_of_a_remapped_scene() -> None:
    obj, scene = add_water(), bpy.context.scene
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 250
    scene.frame_set(60)
    assert scene.frame_current_final == pytest.approx(24.0)
    assert worst_height(obj) < 1e-5


def test_drivers_run_no_python() -> None:
    obj = add_water()
    evaluated(obj)
    curves = [*obj.animation_data.drivers, *carry.material_of(obj).node_tree.animation_data.drivers]
    assert len(curves) > 50
    for curve in curves:
        assert curve.driver.is_simple_expression, curve.driver.expression
        assert curve.driver.is_valid, curve.data_path


def test_surface_is_exported_as_it_is_evaluated(tmp_path: Path) -> None:
    obj = add_water(rotation_euler=(0.0, 0.0, 0.5))
    bpy.context.scene.frame_set(1000)
    path = tmp_path / "lake.obj"
    bpy.ops.wm.obj_export(filepath=str(path), forward_axis="Y", up_axis="Z", export_materials=False)
    lines = path.read_text().splitlines()
    points = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=np.float64)
    assert len(points) == 49 * 49
    assert sum(line.startswith("f ") for line in lines) == 48 * 48
    np.testing.assert_allclose(points[:, 2], waves.height(packed_waves(obj), points[:, :2]), atol=1e-5)
    mesh = evaluated(obj).to_mesh()
    np.testing.assert_allclose(positions(mesh) @ np.array(obj.matrix_world.to_3x3()).T, points, atol=1e-5)


# Who evaluates it, and when


def test_lake_water_does_not_evaluate_it() -> None:
    obj = add_water()
    obj.lake_water.grid_resolution = 1024
    switch_to("LAKE_WATER")
    modifier = carry.modifier_of(obj)
    assert not modifier.show_viewport and not modifier.show_render
    assert obj.animation_data is None, "driven, although nobody looks"
    updates: list[str] = []

    def note(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        updates.extend(update.id.name for update in depsgraph.updates)

    bpy.app.handlers.frame_change_post.append(note)
    try:
        bpy.context.scene.frame_set(5)
    finally:
        bpy.app.handlers.frame_change_post.remove(note)
    assert not {obj.name, obj.data.name, carry.material_of(obj).name, "Shader Nodetree"} & set(updates)
    assert len(evaluated(obj).data.vertices) == 4


def test_engine_switches_it_on_and_off() -> None:
    obj = add_water()
    for engine, shown in (("CYCLES", True), ("LAKE_WATER", False), ("BLENDER_EEVEE", True)):
        switch_to(engine)
        modifier = carry.modifier_of(obj)
        assert (modifier.show_render, modifier.show_viewport) == (shown, shown)
        assert carry.waves_shown(obj) == (len(obj.lake_water.waves) if shown else None)
        assert len(evaluated(obj).data.vertices) == (49 * 49 if shown else 4)


def test_engine_of_the_command_line_is_noticed() -> None:
    """`blender -E` sets the engine after loading and before rendering, and calls no update."""
    obj = add_water()
    switch_to("LAKE_WATER")
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    assert not carry.modifier_of(obj).show_render
    scene.cycles.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    bpy.ops.render.render()
    assert carry.modifier_of(obj).show_render and carry.waves_shown(obj)


def test_object_in_two_scenes_serves_the_one_that_needs_it() -> None:
    obj = add_water()
    switch_to("LAKE_WATER")
    other = bpy.data.scenes.new("Other")
    other.render.engine = "CYCLES"
    other.collection.objects.link(obj)
    switching.update_file()
    assert carry.modifier_of(obj).show_render
    other.render.engine = "LAKE_WATER"
    switching.update_file()
    assert not carry.modifier_of(obj).show_render


# What the object carries


def test_made_and_turned_off_cleanly() -> None:
    bpy.ops.mesh.primitive_plane_add(size=5.0)
    obj = bpy.context.object
    own = bpy.data.materials.new("Own")
    obj.data.materials.append(own)
    water_objects.make_water(obj)
    evaluated(obj)
    worn = carry.material_of(obj)
    assert [slot.material for slot in obj.material_slots] == [own, worn]
    assert [m.name for m in obj.modifiers] == [carry.MODIFIER]
    mesh = evaluated(obj).data
    assert {mesh.materials[polygon.material_index].name for polygon in mesh.polygons} == {worn.name}
    assert not obj.visible_raycast
    water_objects.remove_water(obj)
    assert [slot.material for slot in obj.material_slots] == [own]
    assert list(obj.data.materials) == [own]
    assert not obj.modifiers and obj.animation_data is None and obj.visible_raycast
    assert list(bpy.data.materials) == [own]
    water_objects.make_water(obj)
    assert carry.is_dressed(obj)


def test_own_animation_survives_turning_off() -> None:
    obj = add_water()
    obj.keyframe_insert("location", frame=1)
    obj.driver_add("hide_render").driver.expression = "False"
    evaluated(obj)
    water_objects.remove_water(obj)
    assert obj.animation_data.action is not None
    assert [curve.data_path for curve in obj.animation_data.drivers] == ["hide_render"]


def test_duplicate_is_driven_by_its_own_settings() -> None:
    obj = add_water()
    evaluated(obj)
    twin = obj.copy()  # as Alt+D: the same mesh
    twin.name = "Pond"
    bpy.context.scene.collection.objects.link(twin)
    twin.lake_water.k = 2.5
    twin.lake_water.waves[0].amplitude = 0.3
    bpy.context.view_layer.update()
    assert worst_height(obj) < 1e-5 and worst_height(twin) < 1e-5
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for water in (obj, twin):
        worn = carry.material_of(water)
        assert material.owner_of(worn) == water
        node = worn.evaluated_get(depsgraph).node_tree.nodes[material.WATER]
        assert node.inputs["k"].default_value == pytest.approx(water.lake_water.k)
    water_objects.remove_water(twin)
    bpy.context.view_layer.update()
    assert carry.is_dressed(obj) and carry.material_of(obj) is not None


def test_file_without_nodes_gets_them_when_it_is_opened(tmp_path: Path) -> None:
    name = add_water().name
    carry.undress(bpy.data.objects[name])
    for tree in list(bpy.data.node_groups):
        bpy.data.node_groups.remove(tree)
    path = str(tmp_path / "old.blend")
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    obj = bpy.data.objects[name]
    assert carry.is_dressed(obj) and carry.modifier_of(obj).show_render
    assert worst_height(obj) < 1e-5


def test_older_groups_are_built_anew_and_their_users_keep_links_and_values(tmp_path: Path) -> None:
    add_water()
    bpy.context.view_layer.update()
    geometry = bpy.data.node_groups[sine_waves.SINE_WAVES.name]
    shader = bpy.data.node_groups["Lake Water"]

    bpy.ops.mesh.primitive_plane_add()
    user = bpy.context.object
    modifier = user.modifiers.new("Mine", "NODES")
    modifier.node_group = geometry
    carry.input_of(modifier, "Resolution").value = 7
    tree = bpy.data.node_groups.new("Mine", "ShaderNodeTree")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = shader
    value = tree.nodes.new("ShaderNodeValue")
    tree.links.new(value.outputs[0], node.inputs["k"])
    node.inputs["q"].default_value = 4.25
    tree.use_fake_user = True

    for group in (geometry, shader):  # as an older version would have left them
        group.nodes.clear()
        group[trees.VERSION] = 0
        group.interface.new_socket("Gone", in_out="INPUT", socket_type="NodeSocketFloat")
    shader.interface.remove(shader.interface.items_tree["Exact Fresnel"])
    shader.name = "Renamed"
    path = str(tmp_path / "old.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)

    geometry, shader = bpy.data.node_groups[sine_waves.SINE_WAVES.name], bpy.data.node_groups["Renamed"]
    node = bpy.data.node_groups["Mine"].nodes["Group"]
    assert node.node_tree == shader
    assert [link.to_socket.name for link in bpy.data.node_groups["Mine"].links] == ["k"]
    assert node.inputs["q"].default_value == 4.25
    names = [i.name for i in shader.interface.items_tree if i.in_out == "INPUT"]
    assert names == [s.name for s in carry.LAKE_WATER.sockets if not s.output]
    assert shader[trees.VERSION] == carry.LAKE_WATER.version
    user = bpy.data.objects["Plane"]
    assert carry.input_of(user.modifiers["Mine"], "Resolution").value == 7
    assert len(evaluated(user).data.vertices) == 49
    assert worst_height(bpy.data.objects["Lake"]) < 1e-5


def test_group_of_a_newer_version_is_left_alone() -> None:
    tree = trees.ensure_group(sine_waves.SINE_WAVES)
    tree[trees.VERSION] = sine_waves.SINE_WAVES.version + 1
    tree.nodes.clear()
    assert trees.ensure_group(sine_waves.SINE_WAVES) == tree
    assert not tree.nodes


def test_waves_go_on_where_the_extension_is_not_enabled_and_after_it_is(tmp_path: Path) -> None:
    obj = add_water()
    name, count = obj.name, len(obj.lake_water.waves)
    switch_to("CYCLES")
    obj.lake_water.k = 0.875
    bpy.context.scene.frame_set(1000)
    expected = positions(evaluated(obj).data)
    bpy.context.scene.frame_set(1)
    path = str(tmp_path / "lake.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    lake_water_addon.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=path)
        bpy.context.scene.frame_set(1000)
        obj = bpy.data.objects[name]
        np.testing.assert_allclose(positions(evaluated(obj).data), expected, atol=1e-6)
        worn = obj.material_slots[0].material.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert worn.node_tree.nodes[material.WATER].inputs["k"].default_value == 0.875
    finally:
        lake_water_addon.register()
    assert carry.waves_shown(obj) == count
    obj.lake_water.waves[0].amplitude = 0.25
    assert worst_height(obj) < 1e-5, "settings drive nothing after the extension was enabled again"


def test_undo_of_adding_water_leaves_nothing() -> None:
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.lake_water.add_water()
    bpy.ops.ed.undo_push(message="Water")
    name = bpy.context.object.name
    bpy.ops.ed.undo()
    assert name not in bpy.data.objects and not bpy.data.node_groups and not bpy.data.materials
    bpy.ops.ed.redo()
    assert carry.is_dressed(bpy.data.objects[name])
    assert worst_height(bpy.data.objects[name]) < 1e-5


# Extraction sees the water body, whatever the modifier does


def snapshot_of(extractor: SceneExtractor):
    return extractor.snapshot(bpy.context.evaluated_depsgraph_get())


@pytest.mark.parametrize("make", [add_water, add_mesh_water], ids=["grid", "mesh"])
@pytest.mark.parametrize("triangulated", [False, True], ids=["alone", "with another modifier"])
def test_extraction_takes_the_calm_surface(make, triangulated: bool) -> None:
    obj = make()
    if triangulated:
        obj.modifiers.new("Triangulate", "TRIANGULATE")
        obj.modifiers.move(1, 0)
    switch_to("LAKE_WATER")
    bpy.context.scene.frame_set(50)
    calm = snapshot_of(SceneExtractor())
    switch_to("CYCLES")
    assert worst_spread(obj) > 0.05, "the modifier did nothing, and nothing was tested"
    seen = snapshot_of(SceneExtractor())
    assert seen.draws == () and not seen.notes
    (before,), (after,) = calm.waters, seen.waters
    if before.grid is not None:
        np.testing.assert_allclose(after.grid, before.grid, rtol=1e-6)
        return
    mesh_before, mesh_after = calm.meshes[before.mesh], seen.meshes[after.mesh]
    np.testing.assert_allclose(mesh_after.positions, mesh_before.positions, atol=1e-6)
    np.testing.assert_allclose(mesh_after.parts[0].triangles, mesh_before.parts[0].triangles)
    assert np.einsum("ij,ij->i", mesh_after.normals, mesh_before.normals).min() > 0.999


def worst_spread(obj: bpy.types.Object) -> float:
    return float(np.ptp(positions(evaluated(obj).data)[:, 2]))


@pytest.mark.parametrize("make", [add_water, add_mesh_water], ids=["grid", "mesh"])
def test_time_passing_with_another_engine_reads_nothing_again(make, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a window in Solid mode with Cycles as engine: driven by the time, and hidden."""
    monkeypatch.setattr(switching, "_look_at_viewports", lambda: switching.Viewports(False, False))
    obj = make()
    switch_to("CYCLES")
    assert carry.waves_shown(obj) and not carry.modifier_of(obj).show_viewport
    extractor = SceneExtractor()

    def note(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        extractor.note_updates(depsgraph)

    bpy.app.handlers.frame_change_post.append(note)
    try:
        first = snapshot_of(extractor)
        walks, meshes_read = extractor.full_walks, extractor.meshes_read
        bpy.context.scene.frame_set(12)
        second = snapshot_of(extractor)
    finally:
        bpy.app.handlers.frame_change_post.remove(note)
    assert (extractor.full_walks, extractor.meshes_read) == (walks, meshes_read)
    assert second.version == first.version and second.time != first.time


# The optics


BOTTOM = np.array([0.8, 0.4, 0.2])
DEPTH = 2.0


def build_basin(k: float, angle: float) -> bpy.types.Object:
    """Calm water over a bottom of constant radiance, in a black world; the camera looks down at an angle."""
    scene = bpy.context.scene
    obj = water_objects.create_water("Lake", 60.0, 60.0, scene.collection)
    obj.lake_water.waves.clear()
    obj.lake_water.k = k
    mesh = bpy.data.meshes.new("Bottom")
    mesh.from_pydata(
        [(-60, -60, -DEPTH), (60, -60, -DEPTH), (60, 60, -DEPTH), (-60, 60, -DEPTH)], [], [(0, 1, 2, 3)]
    )
    glowing = bpy.data.materials.new("Bottom")
    tree = glowing.node_tree
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*BOTTOM, 1.0)
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    mesh.materials.append(glowing)
    scene.collection.objects.link(bpy.data.objects.new("Bottom", mesh))
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", 1.0
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.camera.matrix_world = Matrix.Rotation(angle, 4, "X") @ Matrix.Translation((0.0, 0.0, 12.0))
    scene.collection.objects.link(scene.camera)
    return obj


def render_center(tmp_path: Path, engine: str, size: int = 32) -> np.ndarray:
    """(3,) mean radiance of the middle of the picture."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 256, False, "CPU"
    scene.cycles.sample_clamp_indirect = 0.0
    scene.eevee.taa_render_samples, scene.eevee.use_raytracing = 8, True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(size * size * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    quarter = size // 4
    return pixels.reshape(size, size, 4)[quarter:-quarter, quarter:-quarter, :3].mean(axis=(0, 1))


def expected_radiance(obj: bpy.types.Object, angle: float, *, exact: bool = False) -> np.ndarray:
    """The model, in a black world: (1 - F) C' over the refracted ray."""
    settings = water_objects.settings_of(obj)
    n = settings.ior
    cos_air = math.cos(angle)
    cos_water = math.sqrt(1.0 - (math.sin(angle) / n) ** 2)
    if exact:
        parallel = (n * cos_air - cos_water) / (n * cos_air + cos_water)
        across = (cos_air - n * cos_water) / (cos_air + n * cos_water)
        fresnel = 0.5 * (parallel**2 + across**2)
    else:
        fresnel = float(optics.schlick(np.array(cos_air), optics.reflectance_at_normal(1.0 / n), settings.q))
    a = optics.attenuation(settings.k, DEPTH / cos_water)
    return (1.0 - fresnel) * optics.through_water(BOTTOM, np.array(settings.water_color), a)


@pytest.mark.parametrize(("k", "degrees"), [(0.0, 0.0), (0.5, 0.0), (0.5, 70.0), (3.0, 45.0)])
def test_cycles_shows_the_model_of_attenuation(tmp_path: Path, k: float, degrees: float) -> None:
    obj = build_basin(k, math.radians(degrees))
    shown = render_center(tmp_path, "CYCLES")
    np.testing.assert_allclose(shown, expected_radiance(obj, math.radians(degrees)), rtol=0.01, atol=1e-4)


def test_cycles_shows_exact_reflectance(tmp_path: Path) -> None:
    angle = math.radians(75.0)
    obj = build_basin(0.2, angle)
    obj.lake_water.q = 1.0  # far from the exact curve
    carry.material_of(obj).node_tree.nodes[material.WATER].inputs["Exact Fresnel"].default_value = True
    shown = render_center(tmp_path, "CYCLES")
    np.testing.assert_allclose(shown, expected_radiance(obj, angle, exact=True), rtol=0.01)


def test_cycles_fogs_what_a_camera_under_water_sees(tmp_path: Path) -> None:
    obj = build_basin(0.5, 0.0)
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    assert len(evaluated(obj).data.vertices) == 49 * 49
    scene.camera.matrix_world = Matrix.Translation((0.0, 0.0, -0.75))
    scene.camera.data.clip_start = 1e-3  # the path begins there
    bpy.context.view_layer.update()
    assert len(evaluated(obj).data.vertices) == 49 * 49 + 1, "Cycles would not find the volume"
    shown = render_center(tmp_path, "CYCLES")
    settings = water_objects.settings_of(obj)
    a = optics.attenuation(settings.k, DEPTH - 0.75)
    expected = optics.through_water(BOTTOM, np.array(settings.water_color), a)
    np.testing.assert_allclose(shown, expected, rtol=0.01)


def test_eevee_shows_the_model_of_attenuation(tmp_path: Path) -> None:
    angle = math.radians(40.0)
    obj = build_basin(0.5, angle)
    bpy.context.scene.camera.data.ortho_scale = 8.0  # the refracted rays stay in the picture
    shown = render_center(tmp_path, "BLENDER_EEVEE", 64)
    np.testing.assert_allclose(shown, expected_radiance(obj, angle), rtol=0.03)


def test_sunlight_reaches_the_bottom_weakened_as_in_lake_water(tmp_path: Path) -> None:
    """(1 - F) exp(-k d) of the sun, d along the refracted ray; the way up to the camera is switched off."""
    elevation, k = math.radians(35.0), 0.6
    obj = build_basin(k, 0.0)
    obj.lake_water.water_color = (0.0, 0.0, 0.0)
    scene = bpy.context.scene
    bottom = bpy.data.objects["Bottom"]
    bottom.data.materials.clear()
    white = bpy.data.materials.new("White")
    white.node_tree.nodes.clear()
    diffuse = white.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    output = white.node_tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    white.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    bottom.data.materials.append(white)
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle = 3.0, 0.0
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = (0.5 * math.pi - elevation, 0.0, 0.0)
    scene.collection.objects.link(sun)
    scene.cycles.max_bounces = 8
    scene.cycles.diffuse_bounces = 0
    obj.hide_render = True
    dry = render_center(tmp_path, "CYCLES")
    obj.hide_render = False
    wet = render_center(tmp_path, "CYCLES")
    n, q = obj.lake_water.ior, obj.lake_water.q
    f = optics.reflectance_at_normal(1.0 / n)
    up = (1.0 - float(optics.schlick(np.array(1.0), f, q))) * math.exp(-k * DEPTH)
    cos_water = math.sqrt(1.0 - (math.cos(elevation) / n) ** 2)
    down = 1.0 - float(optics.schlick(np.array(math.sin(elevation)), f, q))
    down *= math.exp(-k * DEPTH / cos_water)
    np.testing.assert_allclose(wet / dry, up * down, rtol=0.01)


def test_drivers_module_leaves_other_drivers_alone() -> None:
    obj = add_water()
    obj.driver_add("location", 0).driver.expression = "frame"
    drivers.copy("k").apply(obj, "scale", 0, obj)
    assert drivers.target_of(obj, "scale") == obj
    drivers.remove_drivers(obj, "scale")
    assert [curve.data_path for curve in obj.animation_data.drivers] == ["location"]
