# SPDX-License-Identifier: GPL-3.0-or-later
"""What a water object carries for Blender's own engines: a nodes modifier and a material.

Two things can be switched. *Waves*: whether the modifier and the material are driven by the time
at all; without them neither is evaluated because a frame went by. *Visibility*: whether Blender
evaluates the modifier, for renders and for viewports.
"""

from __future__ import annotations

import bpy

from ..core.waves import MAX_WAVES
from . import drivers, material
from .lake_water import LAKE_WATER, WAVE_SLOPE, WAVES_NORMAL
from .sine_waves import SINE_WAVES, phase_socket, wave_socket
from .trees import GROUP, VERSION, ensure_group, upgrade

MODIFIER = "Lake Water"
GROUPS = (SINE_WAVES, LAKE_WATER, WAVE_SLOPE, WAVES_NORMAL)


def modifier_of(obj: bpy.types.Object) -> bpy.types.NodesModifier | None:
    """The object's modifier with *Sine Waves*; None if it has none."""
    for modifier in obj.modifiers:
        if modifier.type == "NODES" and modifier.node_group is not None:
            if modifier.node_group.get(GROUP) == SINE_WAVES.name:
                return modifier
    return None


def material_of(obj: bpy.types.Object) -> bpy.types.Material | None:
    """The water material in the object's slots; None if it has none."""
    return next((slot.material for slot in obj.material_slots if material.is_ours(slot.material)), None)


def is_editable(obj: bpy.types.Object) -> bool:
    """Whether modifier, slots and drivers of the object can be changed: no linked object, no override."""
    return obj.library is None and obj.override_library is None


def upgrade_groups() -> None:
    """Bring the file's node groups up to date, those that nothing uses too. Users keep their links."""
    for spec in GROUPS:
        upgrade(spec)


def dress(obj: bpy.types.Object) -> None:
    """Give a water object modifier and material, or bring up to date those it has.

    The modifier comes last, and switched off: `set_waves` and `set_visibility` follow the engine.
    """
    if not is_editable(obj):
        return
    modifier = modifier_of(obj)
    if modifier is None:
        modifier = obj.modifiers.new(MODIFIER, "NODES")
        modifier.show_viewport = modifier.show_render = False
        modifier.show_expanded = False
        modifier.node_group = ensure_group(SINE_WAVES)
    _dress_in_material(obj, modifier)
    obj.visible_raycast = False  # EEVEE: a ray cast from the surface would hit the surface


def _dress_in_material(obj: bpy.types.Object, modifier: bpy.types.NodesModifier) -> None:
    worn = material_of(obj)
    if worn is None:
        worn = material.new_material(obj)
        _put_into_slot(obj, worn)
    elif material.owner_of(worn) not in {obj, None}:  # the object was duplicated
        worn = material.copy_for(worn, obj)
        _put_into_slot(obj, worn)
    elif worn[VERSION] < material.MATERIAL_VERSION:
        material.build(worn, obj)
    socket = input_of(modifier, "Material")
    if socket.value != worn:
        socket.value = worn


def _put_into_slot(obj: bpy.types.Object, worn: bpy.types.Material) -> None:
    """Into the slot of a water material, else a new one; on the object, as the mesh may have other users."""
    slot = next((s for s in obj.material_slots if material.is_ours(s.material)), None)
    if slot is None:
        if obj.data.library is not None:
            return  # the modifier sets the material by itself; only the slot is missing
        obj.data.materials.append(None)
        slot = obj.material_slots[-1]
        slot.link = "OBJECT"
    slot.material = worn


def undress(obj: bpy.types.Object) -> None:
    """Take away what `dress` gave, if it is there."""
    if not is_editable(obj):
        return
    set_waves(obj, wanted=False)
    modifier = modifier_of(obj)
    if modifier is not None:
        input_of(modifier, "Material").value = None  # Blender does not release it with the modifier
        obj.modifiers.remove(modifier)
    obj.visible_raycast = True
    worn = material_of(obj)
    if worn is None:
        return
    index = next(i for i, slot in enumerate(obj.material_slots) if slot.material == worn)
    obj.material_slots[index].material = None
    obj.material_slots[index].link = "DATA"
    if (
        obj.data.users == 1 and obj.data.library is None
    ):  # a slot belongs to the mesh, and so to all its users
        obj.data.materials.pop(index=index)
        obj.data = obj.data  # only this tells the object that a slot is gone
    if not worn.users:
        bpy.data.materials.remove(worn)


def input_of(modifier: bpy.types.NodesModifier, name: str) -> bpy.types.bpy_struct:
    """An input of the modifier: its `value` is what to set."""
    return getattr(modifier.properties.inputs, _identifier(modifier, name))


def _identifier(modifier: bpy.types.NodesModifier, name: str) -> str:
    return next(
        item.identifier
        for item in modifier.node_group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name
    )


def _input_prefix(modifier: bpy.types.NodesModifier) -> str:
    return f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].properties.inputs.'


def is_dressed(obj: bpy.types.Object) -> bool:
    """Whether modifier and material are there, up to date and the object's own. Cheap."""
    modifier, worn = modifier_of(obj), material_of(obj)
    return (
        modifier is not None
        and modifier.node_group.get(VERSION, 0) >= SINE_WAVES.version
        and worn is not None
        and worn[VERSION] >= material.MATERIAL_VERSION
        and material.owner_of(worn) in {obj, None}
    )


def wave_count(obj: bpy.types.Object) -> int:
    """How many waves are summed."""
    return min(len(obj.lake_water.waves), MAX_WAVES)


def waves_shown(obj: bpy.types.Object) -> int | None:
    """How many waves drive modifier and material; None when neither is driven."""
    modifier, worn = modifier_of(obj), material_of(obj)
    driven = drivers.drivers_on(obj, _input_prefix(modifier)) if modifier is not None else []
    if not driven:
        return None
    count = (len(driven) - 2) // 4
    in_material = material.wave_count(worn) if worn is not None else count
    return count if count == in_material else -1


def set_waves(obj: bpy.types.Object, *, wanted: bool) -> None:
    """Drive modifier and material by the object's settings and the time, or by nothing."""
    modifier, worn = modifier_of(obj), material_of(obj)
    count = wave_count(obj) if wanted else 0
    if worn is not None:
        material.set_waves(worn, obj, count)
    if modifier is None:
        return
    prefix = _input_prefix(modifier)
    drivers.remove_drivers(obj, prefix)
    if not wanted:
        return
    names = {
        item.name: item.identifier
        for item in modifier.node_group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT"
    }

    def drive(name: str, component: int, how: drivers.Drive) -> None:
        how.apply(obj, f"{prefix}{names[name]}.value", component, obj)

    drive("Grid", -1, drivers.Drive("s==0", {"s": "surface"}))  # GRID is the first of the two
    drive("Resolution", -1, drivers.copy("grid_resolution"))
    input_of(modifier, "Waves").value = count
    for index in range(count):
        socket = {"Wave": wave_socket(index + 1), "Phase": phase_socket(index + 1)}
        for name, component, how in drivers.wave_drives(index):
            drive(socket[name], component, how)


def set_visibility(obj: bpy.types.Object, *, render: bool, viewport: bool) -> None:
    """Let Blender evaluate the modifier or not. Nothing is tagged when nothing changes."""
    modifier = modifier_of(obj)
    if modifier is None:
        return
    if modifier.show_render != render:
        modifier.show_render = render
    if modifier.show_viewport != viewport:
        modifier.show_viewport = viewport


def note_values(obj: bpy.types.Object) -> None:
    """Keep the present values of the settings in the drivers: see `drivers`."""
    worn = material_of(obj)
    own = worn is not None and material.owner_of(worn) == obj
    if own:
        material.note_settings(worn)
    if waves_shown(obj) == wave_count(obj):  # else the drivers are of waves that are gone
        drivers.note_values(obj, _input_prefix(modifier_of(obj)))
        if own:
            material.note_waves(worn)


def drive_again(obj: bpy.types.Object) -> None:
    """Make all drivers anew. Blender found the settings of none while the extension was not enabled."""
    worn = material_of(obj)
    if worn is not None and material.owner_of(worn) in {obj, None}:
        material.drive_settings(worn, obj)
    if waves_shown(obj) is not None:
        set_waves(obj, wanted=True)
