# SPDX-License-Identifier: GPL-3.0-or-later
"""A snapshot as a Cycles scene of its own: diffuse surfaces, glass waves on a fine mesh, sun and even sky.

Nothing of the extension's own nodes is used: this checks the reference, and they are another model.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from lake_water_addon.core import waves
from lake_water_addon.core.snapshot import Camera, Mesh, SceneSnapshot, WaterBody

WATER_VERTICES = 300


def cycles_picture(
    bpy, snapshot: SceneSnapshot, camera: Camera, size: tuple[int, int], samples: int, sun_angle: float = 0.0
) -> np.ndarray:
    """(h, w, 3) radiance, first row at the bottom. sun_angle: diameter of the sun, radians.

    Settings: one diffuse bounce (that is, direct light only), 16 specular ones, no clamping, no filtering of
    glossy light, caustics on, no denoiser, a box filter of one pixel, every pixel with all samples.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for number, draw in enumerate(snapshot.draws):
        mesh = _mesh(bpy, f"draw {number}", snapshot.meshes[draw.mesh])
        mesh.materials.append(_diffuse(bpy, snapshot.materials[draw.material]))
        for matrix in draw.matrices:
            placed = bpy.data.objects.new(mesh.name, mesh)
            placed.matrix_world = matrix.T.tolist()
            scene.collection.objects.link(placed)
    for body in snapshot.waters:
        mesh = _mesh(bpy, body.name, _waves(body, snapshot.time))
        mesh.materials.append(_glass(bpy, body))
        placed = bpy.data.objects.new(body.name, mesh)
        placed.matrix_world = body.matrix.T.tolist()
        scene.collection.objects.link(placed)
    _add_sky(bpy, scene, snapshot)
    if snapshot.sun is not None:
        _add_sun(bpy, scene, snapshot, sun_angle)
    _add_camera(bpy, scene, camera, size)
    _set_up(scene, size, samples)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(path))
        pixels = np.array(image.pixels[:]).reshape(size[1], size[0], -1)[..., :3]
        bpy.data.images.remove(image)
    return pixels


def _mesh(bpy, name: str, mesh: Mesh):
    made = bpy.data.meshes.new(name)
    triangles = np.concatenate([part.triangles for part in mesh.parts])
    made.from_pydata(mesh.positions.tolist(), [], triangles.tolist(), shade_flat=False)
    if mesh.colors is not None:
        colors = made.color_attributes.new("Color", "FLOAT_COLOR", "POINT")
        colors.data.foreach_set("color", mesh.colors.astype(np.float32).ravel())
    made.normals_split_custom_set_from_vertices(mesh.normals.tolist())
    return made


def _waves(body: WaterBody, time: float) -> Mesh:
    from tests.gpu.scenes import grid_mesh

    packed = waves.pack(body.settings.waves, time, body.settings.depth)
    half = body.grid[1]
    surface = grid_mesh(
        "water", WATER_VERTICES, half, lambda x, y: waves.height(packed, np.stack([x, y], axis=-1))
    )
    line = np.linspace(-half, half, WATER_VERTICES)
    x, y = np.meshgrid(line, line)
    surface.normals[:] = waves.normal(packed, np.stack([x.ravel(), y.ravel()], axis=-1))
    return surface


def _nodes(bpy, name: str):
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def _diffuse(bpy, material):
    made, tree, output = _nodes(bpy, str(material.key))
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*material.base_color, 1.0)
    if material.use_color_attribute:
        color = tree.nodes.new("ShaderNodeVertexColor")
        color.layer_name = "Color"
        tree.links.new(color.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return made


def _glass(bpy, body: WaterBody):
    made, tree, output = _nodes(bpy, body.name)
    shader = tree.nodes.new("ShaderNodeBsdfGlass")
    shader.inputs["Roughness"].default_value = 0.0
    shader.inputs["IOR"].default_value = body.settings.ior
    shader.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    if body.settings.k > 0.0:
        volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        volume.inputs["Density"].default_value = body.settings.k
        tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])
    return made


def _add_sky(bpy, scene, snapshot: SceneSnapshot) -> None:
    world = bpy.data.worlds.new("Sky")
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*snapshot.sky.radiance, 1.0)
    background.inputs["Strength"].default_value = 1.0
    scene.world = world


def _add_sun(bpy, scene, snapshot: SceneSnapshot, angle: float) -> None:
    from mathutils import Vector

    lamp = bpy.data.lights.new("Sun", "SUN")
    strength = float(snapshot.sun.irradiance.max())
    lamp.energy, lamp.color, lamp.angle = strength, snapshot.sun.irradiance / strength, angle
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = Vector(snapshot.sun.direction).to_track_quat("Z", "Y").to_euler()
    sun.visible_glossy = False  # the sun's own mirror image is no part of the reference
    scene.collection.objects.link(sun)


def _add_camera(bpy, scene, camera: Camera, size: tuple[int, int]) -> None:
    data = bpy.data.cameras.new("Camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.angle = 2.0 * math.atan(1.0 / camera.projection[0, 0])
    data.clip_start, data.clip_end = 0.1, 1000.0
    placed = bpy.data.objects.new("Camera", data)
    placed.matrix_world = np.linalg.inv(camera.view).T.tolist()
    scene.collection.objects.link(placed)
    scene.camera = placed


def _set_up(scene, size: tuple[int, int], samples: int) -> None:
    scene.render.engine = "CYCLES"
    render, cycles = scene.render, scene.cycles
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filter_size = 1.0
    cycles.pixel_filter_type = "BOX"
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = (
        "CPU",
        samples,
        False,
        False,
    )
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces, cycles.transmission_bounces = (
        16,
        1,
        16,
        16,
    )
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
