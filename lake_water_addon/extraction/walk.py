# SPDX-License-Identifier: GPL-3.0-or-later
"""One walk over all object instances of a depsgraph: draws, meshes, materials, waters, the sun."""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core.snapshot import Draw, Mesh, Sun
from .geometry import default_color_name, default_uv_name, read_mesh
from .materials import ReadMaterial, read_material
from .meshes import MeshStore
from .objects import Name, determinants, has_layer_flags, is_shown, is_usable, matrix_of, name_of, slots_of
from .versions import next_version
from .waters import WaterRecord, WaterSurface, is_water, read_surface, same_body, water_body
from .world import read_sun

DEFORMING_PARENTS = {"ARMATURE", "LATTICE", "CURVE"}
SILENT_TYPES = {"CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE", "EMPTY"}
NOT_DRAWN = {
    "CURVES": "hair curves",
    "POINTCLOUD": "a point cloud",
    "VOLUME": "a volume",
    "GREASEPENCIL": "a grease pencil drawing",
}

Predicate = Callable[[bpy.types.Object], bool]
DrawKey = tuple[Hashable, int, Hashable, bool]  # mesh, part, material, mirrored
MeshId = tuple[int, str | None, str | None]  # uid of the evaluated mesh, UV map, colour attribute


@dataclass(eq=False, slots=True)
class Look:
    """How one evaluated object with one geometry is drawn, and the rows of its instances."""

    uid: int
    name: Name
    data_uid: int
    slots: tuple[int, ...]
    mesh: Mesh | None
    mesh_id: MeshId | None = None
    surface: WaterSurface | None = None
    rows: list[int] = field(default_factory=list)
    instanced: bool = False


@dataclass(slots=True)
class Single:
    """An object that draws exactly one instance: what it draws, and in which rows of which draws."""

    slots: tuple[int, ...]
    data_uid: int
    mesh: Mesh
    mesh_id: MeshId
    places: tuple[tuple[DrawKey, int], ...]
    mirrored: bool


@dataclass(eq=False)
class Known:
    """What one walk leaves for the next one and for what happens in between."""

    meshes: dict[MeshId, Mesh | None] = field(default_factory=dict)
    draws: dict[DrawKey, Draw] = field(default_factory=dict)
    singles: dict[int, Single] = field(default_factory=dict)  # by the object's uid
    silent: set[int] = field(default_factory=set)  # objects that are drawn nowhere, whatever moves
    waters: tuple[WaterRecord, ...] = ()
    sun_uid: int | None = None  # of the sun's object if that is no instance


class Walk:
    """One walk over all instances of a depsgraph. Its public attributes are the result of `run`.

    is_visible: see `SceneExtractor.snapshot`. before: what the last walk over this
    depsgraph left. changed: the objects that may have been edited in place since, by uid.
    """

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        is_visible: Predicate | None,
        before: Known,
        changed: Container[int],
        store: MeshStore,
        elsewhere: Sequence[Known] = (),
    ) -> None:
        """elsewhere: what is known of other depsgraphs; draws equal to theirs keep the version."""
        self._before = before
        self._elsewhere = elsewhere
        self._store = store
        self._depsgraph = depsgraph
        self._is_visible = is_visible
        self._changed = changed
        self.notes: list[str] = []
        self.materials: dict[int, ReadMaterial] = {}
        self.meshes: dict[MeshId, Mesh | None] = {}
        self.meshes_read = 0
        self._looks: dict[tuple[int, int], Look | None] = {}
        self.draws: dict[DrawKey, Draw] = {}
        self.waters: list[WaterRecord] = []
        self.sun: Sun | None = None
        self._sun_uid: int | None = None
        self._silent: set[int] = set()  # objects that draw nothing
        self._parents: set[int] = set()  # objects that instance others
        self._bases: dict[Hashable, int] = {}
        self._geometries: dict[int, int] = {}  # how many geometries an object's own instances brought so far
        self._shown: dict[int, bool] = {}
        self._found: dict[tuple[int, tuple[int, ...]], tuple[MeshId, Mesh | None]] = {}
        self._places: dict[int, list[tuple[DrawKey, int]]] = {}  # by id() of the look
        self._mirrored: list[bool] = []
        self._has_layer_flags = has_layer_flags(depsgraph.view_layer.layer_collection)

    def _note(self, text: str) -> None:
        self.notes.append(text)

    def run(self) -> None:
        """Walk over the instances, then build draws and waters."""
        count = 0
        parent_uid = None
        is_visible, looks = self._is_visible, self._looks
        for row, instance in enumerate(self._depsgraph.object_instances):
            count = row + 1
            obj = instance.object
            instanced = instance.is_instance
            if instanced:
                parent = instance.parent
                parent_uid = parent.original.session_uid
                self._parents.add(parent_uid)
                if not self._is_shown(parent, parent_uid):
                    continue
            kind = obj.type
            if kind == "MESH":
                if not instance.show_self:
                    continue
                uid, data_uid = obj.original.session_uid, obj.data.session_uid
                look_key = (uid, data_uid)
                if look_key in looks:
                    look = looks[look_key]
                else:
                    look = looks[look_key] = self.look(obj, uid, data_uid, instanced and parent_uid == uid)
                if look is None or (is_visible is not None and not is_visible(obj)):
                    continue
                look.rows.append(row)
                look.instanced = look.instanced or instanced
            else:
                self._other(instance, obj, kind)
        if count == 0:
            return
        # One call for all: 0.4 us each, where matrix_world of one instance takes 2 us. Columns come first.
        matrices = np.empty(count * 16, dtype=np.float32)
        self._depsgraph.object_instances.foreach_get("matrix_world", matrices)
        stacked = matrices.reshape(count, 4, 4).transpose(0, 2, 1).astype(np.float64)
        self._make_draws(stacked)
        self._make_waters(stacked)

    def used_meshes(self) -> dict[Hashable, Mesh]:
        """The meshes that draws and water bodies refer to, by key."""
        return {
            look.mesh.key: look.mesh
            for look in self._looks.values()
            if look is not None and look.mesh is not None and look.rows
        }

    def known(self) -> Known:
        """What to keep of this walk."""
        return Known(
            meshes=self.meshes,
            draws=self.draws,
            singles=self._singles(),
            silent=self._silent - self._parents,
            waters=tuple(self.waters),
            sun_uid=self._sun_uid,
        )

    def _singles(self) -> dict[int, Single]:
        """The objects that draw one instance and are not instanced nor instance others, by uid."""
        looks = [look for look in self._looks.values() if look is not None]
        times_seen: dict[int, int] = {}
        for look in looks:
            times_seen[look.uid] = times_seen.get(look.uid, 0) + 1
        return {
            look.uid: Single(
                slots=look.slots,
                data_uid=look.data_uid,
                mesh=look.mesh,
                mesh_id=look.mesh_id,
                places=tuple(self._places[id(look)]),
                mirrored=self._mirrored[look.rows[0]],
            )
            for look in looks
            if len(look.rows) == 1
            and not look.instanced
            and look.surface is None
            and times_seen[look.uid] == 1
            and look.uid not in self._parents
            and id(look) in self._places
        }

    def _other(self, instance: bpy.types.DepsgraphObjectInstance, obj: bpy.types.Object, kind: str) -> None:
        """An object that is no mesh: the sun, or nothing to draw."""
        if kind in NOT_DRAWN:
            if instance.show_self and self._is_shown(obj, obj.original.session_uid):
                self._note(f'Object "{obj.original.name}" is {NOT_DRAWN[kind]}, which is not drawn')
            return
        if kind not in SILENT_TYPES and kind != "LIGHT":
            return  # curves, text and metaballs: their mesh comes as an instance of its own
        uid = obj.original.session_uid
        if kind == "LIGHT" and obj.data.type == "SUN" and self.sun is None:
            if self._is_visible is not None and not self._is_visible(obj):
                return
            self.sun = read_sun(obj.data, matrix_of(instance), obj.original.name, self._note)
            if self.sun is not None:
                self._sun_uid = None if instance.is_instance else uid
                return
        self._silent.add(uid)

    def _is_shown(self, obj: bpy.types.Object, uid: int) -> bool:
        """Whether the camera sees an object at all, as Cycles takes it."""
        shown = self._shown.get(uid)
        if shown is None:
            shown = is_shown(obj)
            if shown and self._has_layer_flags:
                layer = self._depsgraph.view_layer
                original = obj.original
                shown = not original.holdout_get(view_layer=layer)
                shown = shown and not original.indirect_only_get(view_layer=layer)
            if not shown and obj.type == "MESH":
                self._note(
                    f'Object "{obj.original.name}" is a holdout or not visible to the camera, not drawn'
                )
            self._shown[uid] = shown
        return shown

    def look(self, obj: bpy.types.Object, uid: int, data_uid: int, own_instance: bool) -> Look | None:
        """How an object that was not met before is drawn; None if it is not.

        own_instance: the geometry is not the object's own mesh but one that its modifiers
        instance, or the surface of a curve, text or metaball.
        """
        if not self._is_shown(obj, uid):
            return None
        slots = slots_of(obj)
        surface = None
        if is_water(obj):
            if own_instance:
                return None
            surface = read_surface(obj, self._depsgraph)
            slots = ()
            if surface.resolution:
                return Look(uid, name_of(obj), data_uid, slots, None, surface=surface)
        found = self._found.get((data_uid, slots))  # linked duplicates need not be looked at one by one
        if found is None:
            found = self._found[(data_uid, slots)] = self._mesh(obj, uid, data_uid, slots, own_instance)
        mesh_id, mesh = found
        if mesh is None:
            if surface is not None:
                self._note(f'Water "{obj.original.name}" has no faces, not drawn')
            return None
        return Look(uid, name_of(obj), data_uid, slots, mesh, mesh_id, surface)

    def _material(self, uid: int, obj: bpy.types.Object) -> ReadMaterial:
        read = self.materials.get(uid)
        if read is None:
            material = next(
                slot.material
                for slot in obj.material_slots
                if slot.material is not None and slot.material.original.session_uid == uid
            )
            read = read_material(material.evaluated_get(self._depsgraph), ("material", uid))
            self.materials[uid] = read
            self.notes.extend(read.notes)
        return read

    def _mesh(
        self, obj: bpy.types.Object, uid: int, data_uid: int, slots: tuple[int, ...], own_instance: bool
    ) -> tuple[MeshId, Mesh | None]:
        data = obj.data
        in_place = obj.mode != "OBJECT" and not own_instance
        reads = [self._material(slot, obj) for slot in slots if slot]
        uv_name = self._attribute_name(
            obj, "UV map", [read.uv_name for read in reads], data.uv_layers, lambda: default_uv_name(data)
        )
        color_name = self._attribute_name(
            obj,
            "color attribute",
            [read.color_name for read in reads],
            data.color_attributes,
            lambda: default_color_name(data),
        )
        mesh_id = (data_uid, uv_name, color_name)
        if mesh_id in self.meshes:
            return mesh_id, self.meshes[mesh_id]
        key = (*self._mesh_key(obj, uid, data_uid, own_instance), uv_name, color_name)
        mesh = self._before.meshes.get(mesh_id)
        known = mesh_id in self._before.meshes and (mesh is None or mesh.key == key)
        if not known or (in_place and uid in self._changed):
            mesh = self._read(obj, key, uv_name, color_name, in_place)
        self.meshes[mesh_id] = mesh
        return mesh_id, mesh

    def _read(
        self,
        obj: bpy.types.Object,
        key: Hashable,
        uv_name: str | None,
        color_name: str | None,
        in_place: bool,
    ) -> Mesh | None:
        self.meshes_read += 1
        if in_place:  # the evaluated mesh may only wrap what is being edited
            try:
                geometry = read_mesh(obj.to_mesh(), uv_name, color_name, flat=is_water(obj))
            finally:
                obj.to_mesh_clear()
        else:
            geometry = read_mesh(obj.data, uv_name, color_name, flat=is_water(obj))
        return None if geometry is None else self._store.intern(key, geometry)

    def _mesh_key(
        self, obj: bpy.types.Object, uid: int, data_uid: int, own_instance: bool
    ) -> tuple[str, int, int]:
        """What identifies a geometry from frame to frame and in every depsgraph.

        The mesh data-block if the object shows it as it is, else the object, with a number
        for each geometry that its modifiers instance.
        """
        if own_instance:
            self._geometries[uid] = self._geometries.get(uid, 0) + 1
            return ("object", uid, self._geometries[uid])
        original = obj.original
        data = original.data
        if (
            not original.modifiers
            and isinstance(data, bpy.types.Mesh)
            and data.shape_keys is None
            and not (original.parent is not None and original.parent_type in DEFORMING_PARENTS)
        ):
            base = ("mesh", data.session_uid, 0)
            if self._bases.setdefault(base, data_uid) == data_uid:
                return base
        return ("object", uid, 0)

    def _attribute_name(
        self,
        obj: bpy.types.Object,
        what: str,
        wanted: list[str | None],
        layers: bpy.types.bpy_prop_collection,
        default: Callable[[], str | None],
    ) -> str | None:
        """The one attribute to take along of those that an object's materials want, "" being the default."""
        names: list[str | None] = []
        for name in dict.fromkeys(wanted):
            if name is None:
                continue
            found = (name if name in layers else None) if name else default()
            if found is None:
                called = f' "{name}"' if name else ""
                self._note(f'Object "{obj.original.name}" lacks the {what}{called} of its material')
            elif found not in names:
                names.append(found)
        if len(names) > 1:
            self._note(
                f'Object "{obj.original.name}" uses several of its {what}s, only "{names[0]}" is taken'
            )
        return names[0] if names else None

    def _make_draws(self, matrices: np.ndarray) -> None:
        signed = determinants(matrices)
        mirrored = self._mirrored = (signed < 0.0).tolist()
        unusable = set(np.flatnonzero(~is_usable(signed)).tolist())
        groups: dict[DrawKey, list[int]] = {}
        for look in self._looks.values():
            if look is None or look.mesh is None or look.surface is not None:
                continue
            rows = look.rows
            if unusable and not unusable.isdisjoint(rows):
                self._note(f'Object "{look.name[0]}" has a scale of zero, not drawn')
                rows = [row for row in rows if row not in unusable]
            for flipped in sorted({mirrored[row] for row in rows}):
                chosen = rows if len(rows) == 1 else [row for row in rows if mirrored[row] == flipped]
                places = self._places.setdefault(id(look), [])
                for part, mesh_part in enumerate(look.mesh.parts):
                    # An index beyond the last slot shows the last one, as in Blender.
                    uid = look.slots[min(mesh_part.slot, len(look.slots) - 1)] if look.slots else 0
                    key = (look.mesh.key, part, ("material", uid), flipped)
                    group = groups.setdefault(key, [])
                    places.append((key, len(group)))
                    group.extend(chosen)
        for key, rows in groups.items():
            stacked = matrices[rows]
            for known in (self._before, *self._elsewhere):
                old = known.draws.get(key)
                if old is not None and np.array_equal(old.matrices, stacked):
                    self.draws[key] = old
                    break
            else:
                self.draws[key] = Draw(
                    mesh=key[0], part=key[1], material=key[2], matrices=stacked, version=next_version()
                )

    def _make_waters(self, matrices: np.ndarray) -> None:
        old_bodies = {water.body.key: water.body for water in self._before.waters}
        for look in self._looks.values():
            if look is None or look.surface is None:
                continue
            for number, row in enumerate(look.rows):
                body = water_body(
                    look.name[0],
                    ("water", look.uid, number),
                    look.surface,
                    matrices[row],
                    look.mesh and look.mesh.key,
                    self._note,
                )
                if body is None:
                    continue
                old = old_bodies.get(body.key)
                if old is not None and same_body(body, old):
                    body = old
                self.waters.append(WaterRecord(look.uid, look.name, body, look.instanced))
