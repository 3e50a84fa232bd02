# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse materials in the three forms that every engine understands: attribute, image, clipped image."""

from __future__ import annotations

import bpy

from .geometry import COLOR_ATTRIBUTE


def _principled(name: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (320, 0)
    # Purely diffuse, so that path tracing and the real-time engine show the same surface.
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.0
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material, shader


def attribute_material(name: str, *, cull: bool = False) -> bpy.types.Material:
    """Base colour from the mesh's colour attribute."""
    material, shader = _principled(name)
    node = material.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = COLOR_ATTRIBUTE
    node.location = (-300, 0)
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    material.use_backface_culling = cull
    return material


def image_material(
    name: str, image: bpy.types.Image, *, clip: bool = False, cull: bool = False
) -> bpy.types.Material:
    """Base colour from an image by the mesh's uv map; `clip` drops what has an alpha of at most 0.5."""
    material, shader = _principled(name)
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    texture.location = (-560, 0)
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    if clip:
        threshold = tree.nodes.new("ShaderNodeMath")
        threshold.operation = "GREATER_THAN"
        threshold.inputs[1].default_value = 0.5
        threshold.location = (-260, -160)
        tree.links.new(texture.outputs["Alpha"], threshold.inputs[0])
        tree.links.new(threshold.outputs["Value"], shader.inputs["Alpha"])
        material.surface_render_method = "DITHERED"
    material.use_backface_culling = cull
    return material
