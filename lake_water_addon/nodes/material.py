# SPDX-License-Identifier: GPL-3.0-or-later
"""The material of one water object, for Cycles and EEVEE.

Each water object has a material of its own, because its drivers read that object's settings. (One
material for all could read them with Attribute nodes, but then Cycles takes the volume for one that
varies from place to place, and marches through it: noise, and four times the time.)

A person may change the material; only the nodes that are named here are made anew.
"""

from __future__ import annotations

import bpy

from . import drivers
from .lake_water import LAKE_WATER, WAVE_SLOPE, WAVES_NORMAL
from .sine_waves import FRAME_ATTRIBUTE, SLOPE_ATTRIBUTE
from .trees import VERSION, Tree, ensure_group

MATERIAL_VERSION = 1
WATER, NORMAL, POSITION, SLOPE = "Lake Water", "Sine Waves Normal", "Water Frame", "Mesh Slope"
WAVES = 'nodes["Wave '
SETTINGS = {"k": "k", "q": "q", "Index of Refraction": "ior", "Water Color": "water_color"}


def is_ours(material: bpy.types.Material | None) -> bool:
    """Whether a material is a water object's, made here."""
    return material is not None and VERSION in material


def is_ours_node_tree(tree: bpy.types.NodeTree) -> bool:
    """Whether a node tree is that of such a material. Works for evaluated data-blocks too."""
    return tree.is_embedded_data and VERSION in tree


def new_material(obj: bpy.types.Object) -> bpy.types.Material:
    """A material for the object, driven by its settings; the waves are not in it yet."""
    material = bpy.data.materials.new(f"{obj.name} Water")
    build(material, obj)
    return material


def build(material: bpy.types.Material, obj: bpy.types.Object) -> None:
    """Make the whole node tree of a material anew."""
    drivers.remove_drivers(material.node_tree, "nodes[")
    material.surface_render_method = "DITHERED"
    material.use_raytrace_refraction = True  # or EEVEE refracts its light probes only
    material.thickness_mode = "SLAB"
    material.use_transparent_shadow = True
    color = tuple(obj.lake_water.water_color)
    material.diffuse_color = (*color, 1.0)  # Solid mode
    tree = material.node_tree
    tree.nodes.clear()
    t = Tree(tree)
    t.node("ShaderNodeAttribute", name=POSITION, attribute_type="GEOMETRY", attribute_name=FRAME_ATTRIBUTE)
    slope = t.node(
        "ShaderNodeAttribute", name=SLOPE, attribute_type="GEOMETRY", attribute_name=SLOPE_ATTRIBUTE
    )
    normal = t.group(ensure_group(WAVES_NORMAL), slope["Vector"], name=NORMAL)
    water = t.group(ensure_group(LAKE_WATER), name=WATER)
    t.plug(water.made.inputs["Normal"], normal["Normal"])
    cycles = t.node("ShaderNodeOutputMaterial", target="CYCLES", name="Cycles")
    cycles.plug(water["Cycles Surface"], water["Cycles Volume"])
    eevee = t.node("ShaderNodeOutputMaterial", target="EEVEE", name="EEVEE")
    t.plug(eevee.made.inputs["Surface"], water["EEVEE Surface"])
    t.plug(eevee.made.inputs["Thickness"], water["EEVEE Thickness"])
    t.arrange()
    drive_settings(material, obj)
    material[VERSION] = tree[VERSION] = MATERIAL_VERSION


def drive_settings(material: bpy.types.Material, obj: bpy.types.Object) -> None:
    """Drive the inputs of the node Lake Water by the object's settings."""
    tree = material.node_tree
    water = tree.nodes.get(WATER)
    if water is None:  # the person has another idea
        return
    remove_setting_drivers(material)
    for name, setting in SETTINGS.items():
        path = f'nodes["{WATER}"].inputs["{name}"].default_value'
        if setting == "water_color":
            for component in range(3):
                drivers.copy(f"{setting}[{component}]").apply(tree, path, component, obj)
        else:
            drivers.copy(setting).apply(tree, path, -1, obj)


def remove_setting_drivers(material: bpy.types.Material) -> None:
    """The opposite of `drive_settings`: the values stay as they are."""
    drivers.remove_drivers(material.node_tree, f'nodes["{WATER}"]')


def note_settings(material: bpy.types.Material) -> None:
    """Keep the present settings in their drivers: see `drivers`."""
    drivers.note_values(material.node_tree, f'nodes["{WATER}"]')


def note_waves(material: bpy.types.Material) -> None:
    """Keep the present waves in their drivers; all must be there."""
    drivers.note_values(material.node_tree, WAVES)


def owner_of(material: bpy.types.Material) -> bpy.types.Object | None:
    """The object whose settings drive the material; None if none does."""
    return drivers.target_of(material.node_tree, f'nodes["{WATER}"]')


def copy_for(material: bpy.types.Material, obj: bpy.types.Object) -> bpy.types.Material:
    """A copy that another object's settings drive, for an object that was duplicated."""
    copied = material.copy()
    copied.name = f"{obj.name} Water"
    drivers.retarget(copied.node_tree, "nodes[", obj)
    return copied


def wave_count(material: bpy.types.Material) -> int:
    """How many waves are driven in the material."""
    return len(drivers.drivers_on(material.node_tree, WAVES)) // 4


def set_waves(material: bpy.types.Material, obj: bpy.types.Object, count: int) -> None:
    """Put the object's first `count` waves into the material, driven: a chain of nodes, one a wave.

    With 0 nothing in the material depends on the time.
    """
    tree = material.node_tree
    drivers.remove_drivers(tree, WAVES)
    for node in [n for n in tree.nodes if n.name.startswith("Wave ")]:
        tree.nodes.remove(node)
    position, slope, normal = (tree.nodes.get(name) for name in (POSITION, SLOPE, NORMAL))
    if position is None or slope is None or normal is None:  # the person has another idea
        return
    group = ensure_group(WAVE_SLOPE)
    last = slope.outputs["Vector"]
    for index in range(count):
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.name = node.label = f"Wave {index + 1}"
        node.location = (position.location.x, position.location.y + 220.0 * (count - index))
        tree.links.new(last, node.inputs["Slope"])
        tree.links.new(position.outputs["Vector"], node.inputs["Position"])
        last = node.outputs["Slope"]
        for name, component, drive in drivers.wave_drives(index):
            path = f'nodes["{node.name}"].inputs["{name}"].default_value'
            drive.apply(tree, path, component, obj)
    tree.links.new(last, normal.inputs["Slope"])
