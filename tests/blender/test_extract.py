# SPDX-License-Identifier: GPL-3.0-or-later
"""Extraction: what Blender shows arrives in the snapshot, and what did not change keeps its version."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from lake_water_addon.core import sky
from lake_water_addon.extract import SceneExtractor, camera_from_object, camera_from_view
from lake_water_addon.water_objects import create_water

CUBE = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
CUBE_FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]


def new_mesh(name="Mesh", vertices=CUBE, faces=CUBE_FACES, *, smooth=True):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.shade_smooth() if smooth else mesh.shade_flat()
    return mesh


def new_object(name="Object", mesh=None, *, collection=None, matrix=None):
    obj = bpy.data.objects.new(name, mesh if mesh is not None else new_mesh(name))
    (collection or bpy.context.scene.collection).objects.link(obj)
    if matrix is not None:
        obj.matrix_world = matrix
    return obj


def plane(name="Plane", *, uv=False):
    mesh = new_mesh(name, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    if uv:
        layer = mesh.uv_layers.new(name="Map")
        layer.uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
    return mesh


def new_material(name="Material"):
    material = bpy.data.materials.new(name)
    return material, material.node_tree, material.node_tree.nodes["Principled BSDF"]


def new_image(name="Image", size=(4, 2), color=(0.5, 0.25, 1.0, 1.0), *, is_float=True):
    image = bpy.data.images.new(name, *size, alpha=True, float_buffer=is_float)
    image.pixels.foreach_set(np.tile(np.array(color, np.float32), size[0] * size[1]))
    return image


class Watched:
    """An extractor that hears of updates as in a running Blender."""

    def __init__(self):
        self.extractor = SceneExtractor()

    def note(self, _scene, depsgraph):
        self.extractor.note_updates(depsgraph)

    def snapshot(self, **options):
        return self.extractor.snapshot(bpy.context.evaluated_depsgraph_get(), **options)

    @property
    def walks(self):
        return self.extractor.full_walks


@pytest.fixture
def watched():
    w = Watched()
    handlers = (bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.frame_change_post)
    for handler in handlers:
        handler.append(w.note)
    yield w
    for handler in handlers:
        if w.note in handler:  # loading a file removes it
            handler.remove(w.note)


def snapshot():
    return SceneExtractor().snapshot(bpy.context.evaluated_depsgraph_get())


def only_draw(snap):
    assert len(snap.draws) == 1, f"expected one draw, got {[(d.mesh, d.material) for d in snap.draws]}"
    return snap.draws[0]


def only_mesh(snap):
    assert len(snap.meshes) == 1, f"expected one mesh, got {list(snap.meshes)}"
    return next(iter(snap.meshes.values()))


def locations(snap):
    return sorted(tuple(map(float, m[:3, 3])) for draw in snap.draws for m in draw.matrices)


# Geometry


def test_smooth_cube_shares_its_vertices():
    new_object(mesh=new_mesh())
    mesh = only_mesh(snapshot())
    np.testing.assert_array_equal(mesh.positions, np.array(CUBE, np.float32))
    np.testing.assert_allclose(mesh.normals, np.array(CUBE) / math.sqrt(3.0), atol=1e-6)
    assert mesh.positions.dtype == mesh.normals.dtype == np.float32
    assert (mesh.uvs, mesh.colors) == (None, None)
    (part,) = mesh.parts
    assert part.triangles.shape == (12, 3) and part.triangles.dtype == np.int32
    assert mesh.solid


def test_flat_cube_has_a_vertex_for_each_corner_and_stays_solid():
    new_object(mesh=new_mesh(smooth=False))
    mesh = only_mesh(snapshot())
    assert len(mesh.positions) == 24
    (part,) = mesh.parts
    a, b, c = (mesh.positions[part.triangles[:, i]] for i in range(3))
    face_normals = np.cross(b - a, c - a)
    face_normals /= np.linalg.norm(face_normals, axis=1, keepdims=True)
    for corner in range(3):
        np.testing.assert_allclose(mesh.normals[part.triangles[:, corner]], face_normals, atol=1e-6)
    assert mesh.solid


def test_custom_normals_are_taken():
    mesh = plane()
    tilted = np.array([0.6, 0.0, 0.8])
    mesh.normals_split_custom_set([tilted] * 4)
    new_object(mesh=mesh)
    np.testing.assert_allclose(only_mesh(snapshot()).normals, np.tile(tilted, (4, 1)), atol=1e-4)


@pytest.mark.parametrize(
    ("name", "faces"),
    [
        ("open", CUBE_FACES[:5]),
        ("inside out", [face[::-1] for face in CUBE_FACES]),
        ("one face flipped", [CUBE_FACES[0][::-1], *CUBE_FACES[1:]]),
    ],
)
def test_only_a_closed_outward_surface_is_solid(name, faces):
    new_object(mesh=new_mesh(faces=faces))
    assert not only_mesh(snapshot()).solid, name


def test_modifiers_are_applied():
    obj = new_object()
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    assert len(only_mesh(snapshot()).positions) == 26


@pytest.mark.parametrize("kind", ["text", "curve", "metaball", "surface"])
def test_objects_that_are_no_meshes(kind):
    adders = {
        "text": bpy.ops.object.text_add,
        "curve": bpy.ops.curve.primitive_bezier_circle_add,
        "metaball": bpy.ops.object.metaball_add,
        "surface": bpy.ops.surface.primitive_nurbs_surface_sphere_add,
    }
    adders[kind](location=(1, 2, 3))
    if kind == "curve":
        bpy.context.object.data.bevel_depth = 0.1
    snap = snapshot()
    np.testing.assert_allclose(only_draw(snap).matrices[0][:3, 3], (1, 2, 3))
    assert len(only_mesh(snap).positions) > 50


def test_mesh_without_faces_is_left_out():
    new_object(mesh=new_mesh("Points", [(0, 0, 0), (1, 0, 0)], []))
    snap = snapshot()
    assert (snap.draws, snap.meshes) == ((), {})


def test_mesh_in_edit_mode_is_the_one_being_edited(watched):
    import bmesh

    obj = new_object()
    watched.snapshot()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    edited.verts.ensure_lookup_table()
    for z in (-5.0, -6.0):
        edited.verts[0].co.z = z
        bmesh.update_edit_mesh(obj.data)
        assert only_mesh(watched.snapshot()).positions[0, 2] == z


# Instances and visibility


def test_collection_instances_share_one_mesh_and_draw():
    collection = bpy.data.collections.new("Stones")
    new_object("Stone", collection=collection, matrix=Matrix.Translation((0, 0, 1)))
    for x in range(3):
        empty = bpy.data.objects.new("Place", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location.x = x
        bpy.context.scene.collection.objects.link(empty)
    snap = snapshot()
    draw = only_draw(snap)
    assert draw.matrices.shape == (3, 4, 4) and draw.matrices.dtype == np.float64
    assert locations(snap) == [(0, 0, 1), (1, 0, 1), (2, 0, 1)]


def test_geometry_nodes_instances_of_own_geometry():
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given, result = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points, cube = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeMeshCube")
    tree.links.new(given.outputs[0], points.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], points.inputs["Instance"])
    tree.links.new(points.outputs[0], result.inputs[0])
    for name in "AB":
        new_object(name, plane(name)).modifiers.new("Scatter", "NODES").node_group = tree
    snap = snapshot()
    assert [len(draw.matrices) for draw in snap.draws] == [4, 4]
    assert len(snap.meshes) == 2, "each object's geometry has a key of its own"


def test_particle_instances():
    stone = new_object("Stone")
    emitter = new_object("Emitter", plane())
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 5
    settings.render_type, settings.instance_object = "OBJECT", stone
    counts = {draw.mesh[1]: len(draw.matrices) for draw in snapshot().draws}
    assert counts == {stone.data.session_uid: 6, emitter.session_uid: 1}
    emitter.show_instancer_for_viewport = False
    counts = {draw.mesh[1]: len(draw.matrices) for draw in snapshot().draws}
    assert counts == {stone.data.session_uid: 6}, "the emitter itself is hidden"


@pytest.mark.parametrize("switch", ["hide_viewport", "hide_set", "exclude", "visible_camera", "is_holdout"])
def test_hidden_objects_are_left_out(watched, switch):
    collection = bpy.data.collections.new("C")
    bpy.context.scene.collection.children.link(collection)
    obj = new_object("Hidden", collection=collection)
    new_object("Shown")
    assert sum(len(d.matrices) for d in watched.snapshot().draws) == 2
    if switch == "hide_set":
        obj.hide_set(True)
    elif switch == "exclude":
        bpy.context.view_layer.layer_collection.children["C"].exclude = True
    else:
        setattr(obj, switch, switch != "visible_camera")
    draw = only_draw(watched.snapshot())
    assert draw.matrices.shape == (1, 4, 4)
    assert draw.mesh[1] == bpy.data.objects["Shown"].data.session_uid


def test_predicate_hides_objects_of_a_local_view(watched):
    new_object("A")
    new_object("B", matrix=Matrix.Translation((1, 0, 0)))
    assert len(watched.snapshot().draws) == 2
    local = watched.snapshot(is_visible=lambda obj: obj.name == "B", visibility_key="local")
    assert locations(local) == [(1, 0, 0)]
    walks = watched.walks
    assert watched.snapshot(is_visible=lambda obj: obj.name == "B", visibility_key="local") is local
    assert len(watched.snapshot().draws) == 2
    assert watched.walks == walks, "either view is remembered"


def test_mirrored_instances_have_a_draw_of_their_own():
    mesh = new_mesh()
    new_object("Plain", mesh)
    new_object("Mirrored", mesh, matrix=Matrix.Diagonal((-1, 1, 1, 1)))
    signs = [np.sign(np.linalg.det(draw.matrices[:, :3, :3])).tolist() for draw in snapshot().draws]
    assert signs == [[1.0], [-1.0]]


def test_zero_scale_is_left_out_and_noted():
    new_object("Flat", matrix=Matrix.Diagonal((1, 1, 0, 1)))
    snap = snapshot()
    assert snap.draws == ()
    assert any("Flat" in note and "scale of zero" in note for note in snap.notes)


# Materials


def color_of(material):
    obj = new_object(material.name, plane(uv=True))
    obj.data.materials.append(material)
    snap = snapshot()
    return snap.materials[only_draw(snap).material], snap


def test_principled_constant():
    material, _tree, shader = new_material()
    shader.inputs["Base Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    material.use_backface_culling = True
    read, snap = color_of(material)
    np.testing.assert_allclose(read.base_color, (0.1, 0.2, 0.3), atol=1e-7)
    assert (read.image, read.use_color_attribute, read.alpha_threshold) == (None, False, None)
    assert read.cull_back_faces
    assert snap.notes == ()


def test_diffuse_constant_inside_a_node_group_and_a_reroute():
    material, tree, _shader = new_material()
    group = bpy.data.node_groups.new("G", "ShaderNodeTree")
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inner = group.nodes.new("ShaderNodeBsdfDiffuse")
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], inner.inputs["Color"])
    group.links.new(inner.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    node, reroute = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("NodeReroute")
    node.node_tree = group
    node.inputs[0].default_value = (0.7, 0.6, 0.5, 1.0)
    tree.links.new(node.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    np.testing.assert_allclose(color_of(material)[0].base_color, (0.7, 0.6, 0.5), atol=1e-6)


def test_mix_of_constants():
    material, tree, shader = new_material()
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    mix.inputs[0].default_value = 0.25
    mix.inputs[6].default_value, mix.inputs[7].default_value = (1, 0, 0, 1), (0, 1, 0, 1)
    tree.links.new(mix.outputs[2], shader.inputs["Base Color"])
    np.testing.assert_allclose(color_of(material)[0].base_color, (0.75, 0.25, 0.0), atol=1e-6)


def image_material(*, uv_map=None, alpha=None):
    """alpha: None, 'direct', or the name of a Math operation with the threshold 0.3."""
    material, tree, shader = new_material()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = new_image("Leaves")
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    if uv_map is not None:
        node = tree.nodes.new("ShaderNodeUVMap")
        node.uv_map = uv_map
        tree.links.new(node.outputs[0], texture.inputs["Vector"])
    if alpha == "direct":
        tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    elif alpha is not None:
        math_node = tree.nodes.new("ShaderNodeMath")
        math_node.operation = alpha
        tested, limit = (0, 1) if alpha == "GREATER_THAN" else (1, 0)
        math_node.inputs[limit].default_value = 0.3
        tree.links.new(texture.outputs["Alpha"], math_node.inputs[tested])
        tree.links.new(math_node.outputs[0], shader.inputs["Alpha"])
    return material


def test_image_through_a_named_uv_map():
    material = image_material(uv_map="Second")
    mesh = plane(uv=True)
    second = mesh.uv_layers.new(name="Second")
    second.uv.foreach_set("vector", [0.5, 0.5, 0, 0, 0, 1, 1, 1])
    new_object(mesh=mesh).data.materials.append(material)
    snap = snapshot()
    assert snap.materials[only_draw(snap).material].image == "Leaves"
    np.testing.assert_array_equal(only_mesh(snap).uvs, [[0.5, 0.5], [0, 0], [0, 1], [1, 1]])


def test_uv_seams_split_only_their_vertices():
    """Two quads that disagree about the UV of one of the two vertices that they share: 6 + 1 vertices."""
    mesh = new_mesh("Seam", [(x, y, 0) for y in (0, 1) for x in (0, 1, 2)], [(0, 1, 4, 3), (1, 2, 5, 4)])
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [1, 0], [1, 1], [1, 1]], np.float32)
    mesh.uv_layers.new(name="Map").uv.foreach_set("vector", uvs.ravel())
    new_object(mesh=mesh).data.materials.append(image_material())
    read = only_mesh(snapshot())
    assert len(read.positions) == 7
    corners = {}
    (part,) = read.parts
    for vertex in np.unique(part.triangles):
        corners.setdefault(tuple(map(float, read.positions[vertex])), set()).add(tuple(read.uvs[vertex]))
    assert corners[(1, 0, 0)] == {(1, 0), (0, 0)}
    assert corners[(1, 1, 0)] == {(1, 1)}


@pytest.mark.parametrize(
    ("alpha", "threshold"), [(None, None), ("direct", 0.5), ("GREATER_THAN", 0.3), ("LESS_THAN", 0.3)]
)
def test_alpha_clip(alpha, threshold):
    read, snap = color_of(image_material(alpha=alpha))
    assert read.alpha_threshold == (None if threshold is None else pytest.approx(threshold, abs=1e-7))
    assert snap.notes == ()


def test_transparent_mixed_in_by_alpha():
    material, tree, shader = new_material()
    texture, mix = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMixShader")
    texture.image = new_image("Leaves")
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    tree.links.new(shader.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    read, _snap = color_of(material)
    assert (read.image, read.alpha_threshold) == ("Leaves", 0.5)


@pytest.mark.parametrize(("kind", "domain"), [("FLOAT_COLOR", "POINT"), ("BYTE_COLOR", "CORNER")])
def test_color_attribute(kind, domain):
    material, tree, shader = new_material()
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Tint"
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    mesh = plane()
    attribute = mesh.color_attributes.new("Tint", kind, domain)
    linear = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [0.5, 0.5, 0.5, 1]], np.float32)
    attribute.data.foreach_set("color", linear.ravel())
    new_object(mesh=mesh).data.materials.append(material)
    snap = snapshot()
    assert snap.materials[only_draw(snap).material].use_color_attribute
    np.testing.assert_allclose(only_mesh(snap).colors, linear, atol=0.003)  # 8 bits, sRGB-encoded


def test_unsupported_base_color_falls_back_to_the_viewport_color_with_a_note():
    material, tree, shader = new_material("Marble")
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], shader.inputs["Base Color"])
    material.diffuse_color = (0.3, 0.4, 0.5, 1.0)
    read, snap = color_of(material)
    np.testing.assert_allclose(read.base_color, (0.3, 0.4, 0.5), atol=1e-6)
    assert any("Marble" in note for note in snap.notes)


def test_several_slots_and_object_linked_slots():
    red, green, blue = (new_material(name)[0] for name in ("Red", "Green", "Blue"))
    mesh = new_mesh()
    mesh.materials.append(red)
    mesh.materials.append(green)
    mesh.polygons[0].material_index = 1
    new_object("A", mesh)
    other = new_object("B", mesh)
    other.material_slots[1].link = "OBJECT"
    other.material_slots[1].material = blue
    snap = snapshot()
    mesh_read = only_mesh(snap)
    assert [(part.slot, len(part.triangles)) for part in mesh_read.parts] == [(0, 10), (1, 2)]
    drawn = {(draw.part, draw.material[1]): len(draw.matrices) for draw in snap.draws}
    assert drawn == {(0, red.session_uid): 2, (1, green.session_uid): 1, (1, blue.session_uid): 1}


def test_object_without_material_has_blenders_default():
    new_object()
    snap = snapshot()
    np.testing.assert_allclose(snap.materials[only_draw(snap).material].base_color, (0.8, 0.8, 0.8))


# Light


def new_sun(name="Sun", **settings):
    light = bpy.data.lights.new(name, "SUN")
    for key, value in settings.items():
        setattr(light, key, value)
    obj = bpy.data.objects.new(name, light)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_sun():
    obj = new_sun(energy=3.0, color=(1.0, 0.5, 0.25), exposure=1.0)
    obj.rotation_euler = (math.radians(60.0), 0.0, math.radians(90.0))
    sun = snapshot().sun
    # At rest it is in the zenith; tilted by 60 degrees about X towards -Y, then turned by 90 about Z.
    np.testing.assert_allclose(sun.direction, (math.sin(math.radians(60.0)), 0.0, 0.5), atol=1e-6)
    np.testing.assert_allclose(sun.irradiance, (6.0, 3.0, 1.5), rtol=1e-6)


def test_sun_temperature_tints_it():
    light = new_sun(energy=2.0, use_temperature=True, temperature=3000.0).data
    irradiance = snapshot().sun.irradiance
    np.testing.assert_allclose(irradiance, 2.0 * np.array(light.temperature_color), rtol=1e-6)
    assert irradiance[0] > 2.0 * irradiance[2]


def new_world(color=(0.2, 0.4, 0.6), strength=1.0):
    world = bpy.data.worlds.new("World")
    bpy.context.scene.world = world
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    return world, world.node_tree, background


def test_no_world_is_black():
    assert np.array_equal(snapshot().sky.radiance, np.zeros(3))


def test_constant_world():
    new_world(strength=2.0)
    read = snapshot().sky
    np.testing.assert_allclose(read.radiance, (0.4, 0.8, 1.2), rtol=1e-6)
    np.testing.assert_allclose(sky.evaluate(read.irradiance_sh, [0.0, 0.6, 0.8]), (0.4, 0.8, 1.2), rtol=1e-6)
    assert read.image is None


def test_unsupported_world_is_noted():
    world, tree, background = new_world()
    tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], background.inputs["Color"])
    world.color = (0.1, 0.2, 0.3)
    snap = snapshot()
    np.testing.assert_allclose(snap.sky.radiance, (0.1, 0.2, 0.3), rtol=1e-6)
    assert any("World" in note for note in snap.notes)


def image_world(pixels, rotation=0.0, strength=1.0, vector_type="POINT"):
    """pixels: (h, w, 3) linear, row 0 at the bottom."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.pixels.foreach_set(np.dstack([pixels, np.ones((height, width, 1))]).astype(np.float32).ravel())
    world, tree, background = new_world(strength=strength)
    texture, mapping = tree.nodes.new("ShaderNodeTexEnvironment"), tree.nodes.new("ShaderNodeMapping")
    coordinate = tree.nodes.new("ShaderNodeTexCoord")
    mapping.vector_type = vector_type
    mapping.inputs["Rotation"].default_value[2] = rotation
    texture.image = image
    tree.links.new(coordinate.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    return image, world


def colored_sky(width=32):
    """Four quarters of azimuth in four colours, darker below the horizon."""
    quarters = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], float)
    rows = np.where(np.arange(width // 2) < width // 4, 0.25, 1.0)
    return rows[:, None, None] * np.repeat(quarters, width // 4, axis=0)[None]


@pytest.mark.parametrize(
    ("rotation", "vector_type"), [(0.0, "POINT"), (0.9, "POINT"), (0.9, "TEXTURE"), (0.9, "VECTOR")]
)
def test_world_image_is_seen_where_cycles_sees_it(tmp_path, rotation, vector_type):
    """Cycles looks along several directions: `equirectangular_uv` with the read rotation finds its colour."""
    pixels = colored_sky()
    image_world(pixels, rotation, 0.5, vector_type)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.data.type = "PANO"
    camera.data.panorama_type = "EQUIRECTANGULAR"
    camera.rotation_euler = (math.pi / 2.0, 0.0, 0.0)  # its middle looks along +Y
    scene.camera, scene.render.engine = camera, "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.pixel_filter_type = 1, False, "BOX"
    scene.cycles.filter_width = 0.01
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 8, 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "sky.exr")
    read = snapshot().sky
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    seen = np.array(picture.pixels[:]).reshape(8, 16, 4)[:, :, :3]
    for column in range(16):
        azimuth = math.pi / 2.0 + 2.0 * math.pi * (0.5 - (column + 0.5) / 16)
        for row in (2, 5):
            elevation = math.pi * ((row + 0.5) / 8 - 0.5)
            flat = math.cos(elevation)
            direction = (flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation))
            u, v = sky.equirectangular_uv(direction, read.rotation)
            distance = abs((u * 4.0) % 1.0 - 0.5)
            if distance > 0.4:  # near a quarter's border the texture is filtered
                continue
            expected = read.strength * pixels[int(v * 16), int(u * 32)]
            np.testing.assert_allclose(seen[row, column], expected, atol=0.02, err_msg=f"{column}, {row}")


def test_world_image_irradiance_and_pixel_update(watched):
    image, _world = image_world(np.full((8, 16, 3), (0.5, 1.0, 2.0)), strength=2.0)
    first = watched.snapshot().sky
    assert (first.image, first.strength) == ("Sky", 2.0)
    np.testing.assert_allclose(first.radiance, (1.0, 2.0, 4.0), rtol=1e-6)
    np.testing.assert_allclose(sky.evaluate(first.irradiance_sh, [0, 0, 1.0]), (1.0, 2.0, 4.0), rtol=1e-3)
    image.pixels.foreach_set(np.full(8 * 16 * 4, 0.25, np.float32))
    image.update_tag()
    second = watched.snapshot().sky
    np.testing.assert_allclose(second.radiance, (0.5, 0.5, 0.5), rtol=1e-6)
    assert second.version != first.version
    assert watched.extractor.image_version("Sky") > 0


def test_byte_world_image_is_decoded():
    image, world = image_world(np.ones((8, 16, 3)))
    encoded = new_image("Encoded", (16, 8), (0.5, 0.5, 0.5, 1.0), is_float=False)
    next(n for n in world.node_tree.nodes if n.type == "TEX_ENVIRONMENT").image = encoded
    bpy.data.images.remove(image)
    np.testing.assert_allclose(snapshot().sky.radiance, 3 * [0.2140411], atol=0.003)


# Water


def test_grid_water():
    bpy.context.scene.render.fps = 25
    bpy.context.scene.frame_set(50, subframe=0.5)
    obj = create_water("Lake", 4.0, 6.0, bpy.context.scene.collection, (1.0, 2.0, 3.0))
    obj.rotation_euler.z = 0.3
    obj.scale = (2.0, 0.5, 1.0)
    obj.lake_water.k, obj.lake_water.grid_resolution = 0.75, 65
    snap = snapshot()
    assert snap.draws == () and snap.meshes == {}
    (water,) = snap.waters
    assert water.name == "Lake" and water.mesh is None
    np.testing.assert_allclose(water.grid, (65, 4.0, 1.5, 0.0, 0.0), atol=1e-6)
    assert water.level == 3.0
    assert water.heading == pytest.approx(0.3, abs=1e-6)
    assert water.settings.k == 0.75
    assert len(water.settings.waves) == len(obj.lake_water.waves)
    assert snap.time == pytest.approx(50.5 / 25.0)


def test_off_centre_grid_is_in_the_water_frame():
    obj = new_object("Lake", plane(), matrix=Matrix.Rotation(math.pi / 2.0, 4, "Z"))
    obj.lake_water.enabled = True
    np.testing.assert_allclose(snapshot().waters[0].grid[1:], (0.5, 0.5, 0.5, 0.5), atol=1e-6)


def test_mesh_water_keeps_its_vertices():
    obj = new_object("Lake", plane())
    obj.lake_water.enabled, obj.lake_water.surface = True, "MESH"
    snap = snapshot()
    assert snap.draws == ()
    (water,) = snap.waters
    assert water.grid is None
    assert len(snap.meshes[water.mesh].positions) == 4


def test_tilt_of_water_is_ignored_with_a_note():
    obj = create_water("Lake", 2.0, 2.0, bpy.context.scene.collection)
    obj.rotation_euler.x = 0.5
    snap = snapshot()
    (water,) = snap.waters
    np.testing.assert_allclose(water.matrix, np.eye(4), atol=1e-6)
    assert any("Lake" in note and "tilted" in note for note in snap.notes)


def test_water_of_zero_scale_says_why_it_is_not_drawn():
    create_water("Lake", 2.0, 2.0, bpy.context.scene.collection).scale = (0.0, 1.0, 1.0)
    snap = snapshot()
    assert snap.waters == ()
    assert any("Lake" in note for note in snap.notes)


def test_water_settings_change_without_reading_geometry(watched):
    obj = create_water("Lake", 2.0, 2.0, bpy.context.scene.collection)
    new_object()
    first = watched.snapshot()
    walks, meshes_read = watched.walks, watched.extractor.meshes_read
    obj.lake_water.k = 0.125
    second = watched.snapshot()
    assert second.waters[0].settings.k == 0.125
    assert second.version != first.version
    assert (watched.walks, watched.extractor.meshes_read) == (walks, meshes_read)
    assert second.draws == first.draws and second.meshes == first.meshes


def test_animated_water_settings(watched):
    obj = create_water("Lake", 2.0, 2.0, bpy.context.scene.collection)
    for frame, k in ((1, 1.0), (11, 2.0)):
        obj.lake_water.k = k
        obj.lake_water.keyframe_insert("k", frame=frame)
    for frame, k in ((1, 1.0), (11, 2.0)):
        bpy.context.scene.frame_set(frame)
        assert watched.snapshot().waters[0].settings.k == pytest.approx(k)


# Only what changed


def versions(snap):
    return (
        {key: mesh.version for key, mesh in snap.meshes.items()},
        {draw.mesh: draw.version for draw in snap.draws},
    )


def test_unchanged_scene_is_the_same_snapshot(watched):
    create_water("Lake", 2.0, 2.0, bpy.context.scene.collection)
    new_object()
    first = watched.snapshot()
    assert watched.snapshot() is first
    bpy.context.scene.frame_set(7)
    later = watched.snapshot()
    assert later.time != first.time and later.version == first.version
    assert later.draws is first.draws
    assert watched.walks == 1


def test_selecting_changes_nothing(watched):
    obj = new_object()
    first = watched.snapshot()
    obj.select_set(True)
    assert watched.snapshot() is first
    assert watched.walks == 2, "Blender only says that the scene changed"


def test_moved_object_changes_only_its_draw(watched):
    a, b = new_object("A"), new_object("B")
    first = watched.snapshot()
    a.location = (1.0, 2.0, 3.0)
    second = watched.snapshot()
    meshes_before, draws_before = versions(first)
    meshes_after, draws_after = versions(second)
    assert meshes_after == meshes_before
    changed = {key[1] for key in draws_after if draws_after[key] != draws_before[key]}
    assert changed == {a.data.session_uid}
    assert locations(second) == [(0, 0, 0), (1, 2, 3)]
    assert watched.walks == 1, "a moved object must not cost a walk over all"
    assert locations(first) == [(0, 0, 0), (0, 0, 0)], "an old snapshot stays as it was"
    assert b.location.x == 0.0


def test_moved_parent_takes_its_child_along(watched):
    parent, child = new_object("Parent"), new_object("Child")
    child.parent = parent
    watched.snapshot()
    parent.location.x = 5.0
    assert locations(watched.snapshot()) == [(5, 0, 0), (5, 0, 0)]


def test_moved_member_of_an_instanced_collection(watched):
    collection = bpy.data.collections.new("C")
    member = new_object("Member", collection=collection)
    empty = bpy.data.objects.new("Place", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(empty)
    watched.snapshot()
    member.location.z = 2.0
    assert locations(watched.snapshot()) == [(0, 0, 2)]
    empty.location.x = 3.0
    assert locations(watched.snapshot()) == [(3, 0, 2)]


def test_empty_that_becomes_an_instancer(watched):
    collection = bpy.data.collections.new("C")
    new_object("Member", collection=collection)
    empty = bpy.data.objects.new("Place", None)
    bpy.context.scene.collection.objects.link(empty)
    assert watched.snapshot().draws == ()
    empty.instance_type = "COLLECTION"
    empty.instance_collection = collection
    assert len(watched.snapshot().draws) == 1


def test_edited_mesh_changes_only_itself(watched):
    a, _b = new_object("A"), new_object("B")
    first = watched.snapshot()
    a.data.vertices[0].co.x = -3.0
    a.data.update()
    second = watched.snapshot()
    before, after = versions(first)[0], versions(second)[0]
    assert {key[1] for key in after if after[key] != before[key]} == {a.data.session_uid}
    assert second.meshes[("mesh", a.data.session_uid, 0, None, None)].positions[0, 0] == -3.0
    assert versions(second)[1] == versions(first)[1], "no draw has changed"
    assert (watched.walks, watched.extractor.meshes_read) == (1, 3)


def test_animated_object_and_shape(watched):
    obj = new_object("A")
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Up")
    key.data[0].co.z = 7.0
    for frame in (0, 10):
        obj.location.x = frame
        obj.keyframe_insert("location", frame=frame)
        key.value = frame / 10.0
        key.keyframe_insert("value", frame=frame)
    for frame in (0, 10, 0):
        bpy.context.scene.frame_set(frame)
        snap = watched.snapshot()
        assert locations(snap) == [(frame, 0, 0)]
        assert only_mesh(snap).positions[0, 2] == pytest.approx(-1.0 + 8.0 * frame / 10.0)
        assert len(watched.extractor._views) == 1
        assert len(next(iter(watched.extractor._views.values())).known.meshes) == 1, "old meshes pile up"


def test_moving_camera_costs_nothing(watched):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    new_object()
    first = watched.snapshot()
    camera.location.x = 3.0
    assert watched.snapshot() is first
    assert watched.walks == 1


def test_moved_sun(watched):
    obj = new_sun()
    new_object()
    first = watched.snapshot()
    obj.rotation_euler.x = math.pi / 2.0
    second = watched.snapshot()
    np.testing.assert_allclose(second.sun.direction, (0.0, -1.0, 0.0), atol=1e-6)
    assert second.version != first.version and second.draws == first.draws
    assert watched.walks == 1


def test_changed_material(watched):
    material, _tree, shader = new_material()
    new_object().data.materials.append(material)
    first = watched.snapshot()
    shader.inputs["Base Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    second = watched.snapshot()
    np.testing.assert_allclose(next(iter(second.materials.values())).base_color, (1.0, 0.0, 0.0))
    assert second.version != first.version
    assert versions(second) == versions(first)


def test_added_and_deleted_objects(watched):
    watched.snapshot()
    obj = new_object("New")
    assert len(watched.snapshot().draws) == 1
    bpy.data.objects.remove(obj)
    assert watched.snapshot().draws == ()


def test_deleted_and_renamed_water(watched):
    obj = create_water("Lake", 2.0, 2.0, bpy.context.scene.collection)
    watched.snapshot()
    obj.name = "Sea"
    assert watched.snapshot().waters[0].name == "Sea"
    bpy.data.objects.remove(obj)
    assert watched.snapshot().waters == ()


@pytest.fixture
def rendered():
    """A function that renders (F12) and returns (snapshot, full walks so far) of each frame."""
    extractor, taken = SceneExtractor(), []

    class Engine(bpy.types.RenderEngine):
        bl_idname = "LAKE_WATER_TEST"
        bl_label = "Test"
        bl_use_gpu_context = True  # as our own; it makes Blender keep the depsgraph from frame to frame

        def render(self, depsgraph):
            taken.append((extractor.snapshot(depsgraph), extractor.full_walks))

    def render(**options):
        taken.clear()
        bpy.ops.render.render(**options)
        return list(taken)

    bpy.utils.register_class(Engine)
    scene = bpy.context.scene
    scene.render.engine = Engine.bl_idname
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    yield render
    bpy.utils.unregister_class(Engine)


def test_fresh_depsgraph_with_equal_content_keeps_versions(rendered):
    """Each F12 has a depsgraph of its own, and evaluates everything again."""
    obj = new_object("A")
    obj.modifiers.new("Subdivision", "SUBSURF")
    new_object("B")
    ((first, walks),) = rendered()
    ((second, walks_again),) = rendered()
    assert walks_again > walks, "a fresh depsgraph must be looked at"
    assert versions(second)[0] == versions(first)[0]
    obj.data.vertices[0].co.x = 5.0
    obj.data.update()
    ((third, _),) = rendered()
    before, after = versions(second)[0], versions(third)[0]
    assert {key[1] for key in after if after[key] != before[key]} == {obj.session_uid}


def test_frames_of_a_rendered_animation_are_not_walked_again(rendered, tmp_path):
    obj = new_object("A")
    for frame in (1, 3):
        obj.location.x = frame
        obj.keyframe_insert("location", frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 3, str(tmp_path / "####")
    frames = rendered(animation=True)
    assert [locations(snap)[0][0] for snap, _ in frames] == [1, 2, 3]
    assert [walks for _, walks in frames] == [1, 1, 1]


def test_render_visibility_counts_in_a_render(rendered):
    hidden, shown = new_object("Not in renders"), new_object("Not in viewports")
    hidden.hide_render = shown.hide_viewport = True
    ((snap, _),) = rendered()
    assert only_draw(snap).mesh[1] == shown.data.session_uid
    assert only_draw(snapshot()).mesh[1] == hidden.data.session_uid


def test_loading_a_file_forgets_the_old_one(watched):
    new_object()
    old = watched.snapshot()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    watched.extractor.reset()
    new_object()
    new = watched.snapshot()
    assert not set(new.meshes) & set(old.meshes)
    assert new.version > old.version


def test_check_all_keeps_versions_of_equal_content(watched):
    new_object()
    first = watched.snapshot()
    watched.extractor.check_all()
    assert watched.snapshot() is first
    assert watched.extractor.meshes_read == 2


# Cameras


@pytest.mark.parametrize("lens", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize(("width", "height"), [(640, 480), (300, 700)])
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (2.0, 1.0), (1.0, 1.5)])
def test_camera_is_blenders(lens, fit, width, height, aspect):
    data = bpy.data.cameras.new("Camera")
    data.type, data.sensor_fit, data.lens, data.ortho_scale = lens, fit, 31.0, 7.0
    data.sensor_width, data.sensor_height = 30.0, 17.0
    data.shift_x, data.shift_y, data.clip_start, data.clip_end = 0.2, -0.35, 0.25, 321.0
    obj = bpy.data.objects.new("Camera", data)
    scene = bpy.context.scene
    scene.collection.objects.link(obj)
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.4, 0.5, 0.6), (2.0, 0.5, 3.0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera = camera_from_object(obj.evaluated_get(depsgraph), scene, width, height)
    blenders = obj.calc_matrix_camera(depsgraph, x=width, y=height, scale_x=aspect[0], scale_y=aspect[1])
    np.testing.assert_allclose(camera.projection, np.array(blenders), rtol=1e-5, atol=1e-6)
    unscaled = Matrix.LocRotScale(obj.location, obj.rotation_euler, None)
    np.testing.assert_allclose(camera.view, np.array(unscaled.inverted()), atol=1e-5)
    np.testing.assert_allclose(camera.view[:3, :3] @ camera.view[:3, :3].T, np.eye(3), atol=1e-14)
    assert camera.view.dtype == camera.projection.dtype == np.float64


def test_mirrored_camera_looks_the_same_way():
    obj = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(obj)
    obj.scale.x = -1.0
    camera = camera_from_object(
        obj.evaluated_get(bpy.context.evaluated_depsgraph_get()), bpy.context.scene, 4, 4
    )
    np.testing.assert_allclose(camera.view, np.eye(4), atol=1e-12)


def test_panoramic_camera_is_refused():
    data = bpy.data.cameras.new("Dome")
    data.type = "PANO"
    with pytest.raises(ValueError, match=r"Dome.*pano.*lens type"):
        camera_from_object(bpy.data.objects.new("Dome", data), bpy.context.scene, 4, 4)


def test_no_camera_is_refused():
    with pytest.raises(ValueError, match="not a camera"):
        camera_from_object(None, bpy.context.scene, 4, 4)


def test_camera_of_a_view():
    """A 3D view hands over its own matrices; only the view is made rigid to float64."""

    class Region:
        view_matrix = Matrix.LocRotScale((1, 2, 3), Matrix.Rotation(0.7, 3, (0.6, 0.0, 0.8)), None).inverted()
        window_matrix = Matrix.Diagonal((1.5, 2.0, -1.0, 1.0))

    camera = camera_from_view(Region)
    np.testing.assert_allclose(camera.view, np.array(Region.view_matrix), atol=1e-6)
    np.testing.assert_allclose(camera.view[:3, :3] @ camera.view[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_array_equal(camera.projection, np.diag([1.5, 2.0, -1.0, 1.0]))
