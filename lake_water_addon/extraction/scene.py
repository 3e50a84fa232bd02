# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated depsgraph as a `SceneSnapshot`, in which only what changed is new.

No pointer to a Blender data-block is kept between calls: undo and loading a file free
them. What is kept is known by `session_uid`, which is never used twice in a session.

How changes are found:

- Blender evaluates an object's changed geometry into a new mesh data-block, with a new
  `session_uid`: one with a known uid is known. (Not so while a mesh is painted or sculpted:
  in these modes an object that is said to have changed is read again.) A new one is read
  and compared with the last of the same key, so that equal content keeps its version.
- Objects that draw a single instance, the sun and water grids are looked at one by one when
  `note_updates` was told of them.
- All other changes, and a depsgraph not seen before, take a *full walk* over
  `depsgraph.object_instances`: some 10 to 20 microseconds for an instance, and no geometry is
  read that is known.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core.snapshot import Draw, Material, Mesh, SceneSnapshot, Sky
from ..nodes.material import is_ours, is_ours_node_tree
from .materials import default_material, same_material
from .meshes import MeshStore
from .objects import Name, determinants, find_evaluated, is_shown, is_usable, matrix_of, name_of
from .versions import next_version
from .walk import DrawKey, Known, Predicate, Single, Walk
from .waters import WaterRecord, is_water, read_surface, refresh, same_body, water_body
from .world import WorldReader, read_sun, same_sky, same_sun

MAX_VIEWS = 8  # depsgraphs and local views remembered at once
MAX_SINGLE_UPDATES = 64  # more changed objects than this: a full walk is cheaper
# Data-blocks whose change reaches us as a change of the objects that use them, or never does.
SILENT_IDS = (
    bpy.types.Action,
    bpy.types.Armature,
    bpy.types.Camera,
    bpy.types.Curve,
    bpy.types.Key,
    bpy.types.Lattice,
    bpy.types.Mesh,
    bpy.types.MetaBall,
)
VIEW_TYPE_FILTERS = tuple(
    name
    for name in bpy.types.SpaceView3D.bl_rna.properties.keys()
    if name.startswith("show_object_viewport_")
)


@dataclass(eq=False)
class View:
    """What is remembered of one depsgraph as seen by one local view."""

    snapshot: SceneSnapshot | None = None
    known: Known = field(default_factory=Known)
    images: tuple[tuple[str, int], ...] = ()  # name and version of each that is used
    full: bool = True  # look at everything
    changed: dict[int, Name] = field(default_factory=dict)  # objects to look at, by uid

    def note_object(self, uid: int, name: Name) -> None:
        """An object changed."""
        if uid not in self.known.silent:
            self.changed[uid] = name


def view_visibility(space: bpy.types.SpaceView3D) -> tuple[Predicate | None, Hashable]:
    """Which objects one 3D view shows, for `SceneExtractor.snapshot`: (is_visible, visibility_key).

    Local view, local collections and the view's filter of object types; (None, None) if it has none of them.
    """
    types = tuple(getattr(space, name) for name in VIEW_TYPE_FILTERS)
    if space.local_view is None and not space.use_local_collections and all(types):
        return None, None
    key = (space.as_pointer(), space.local_view is not None, space.use_local_collections, types)
    return (lambda obj: obj.visible_in_viewport_get(space)), key


class SceneExtractor:
    """Extracts scene snapshots and remembers what it has read.

    Call `note_updates` from the handlers depsgraph_update_post and frame_change_post and
    from an engine's view_update, or changes in a depsgraph seen before go unnoticed. A
    depsgraph for rendering need not be noted: `snapshot` does that. Call `reset` when a file is loaded.

    An instance must not be used from two threads: a final render and the viewport have one each.
    """

    def __init__(self) -> None:
        self._views: OrderedDict[Hashable, View] = OrderedDict()
        self._store = MeshStore()
        self._world = WorldReader()
        self._image_versions: dict[str, int] = {}
        self.full_walks = 0
        self.meshes_read = 0

    def reset(self) -> None:
        """Forget everything: another file is open. Versions go on, so that nothing old passes for new."""
        self._views.clear()
        self._store.clear()
        self._world.reset()
        self._image_versions.clear()

    def check_all(self) -> None:
        """Read everything again at the next snapshot, after an undo for example. Content that turns out
        equal keeps its version."""
        for view in self._views.values():
            view.full = True
            view.known.meshes.clear()

    def image_version(self, name: str) -> int:
        """Grows when the pixels of an image changed, as far as Blender is told: a script that sets pixels
        calls `Image.update_tag`."""
        return self._image_versions.get(name, 0)

    def note_updates(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Take down what `depsgraph.updates` says has changed. Cheap; nothing is read yet."""
        key = _depsgraph_key(depsgraph)
        views = [view for (view_key, _), view in self._views.items() if view_key == key]
        for update in depsgraph.updates:
            block = update.id
            if isinstance(block, SILENT_IDS):
                continue
            changed = update.is_updated_transform or update.is_updated_geometry or update.is_updated_shading
            if isinstance(block, bpy.types.Object):
                if changed and views:
                    uid, name = block.original.session_uid, name_of(block)
                    for view in views:
                        view.note_object(uid, name)
            elif isinstance(block, bpy.types.Image):
                if changed:
                    self._world.forget_image(block.session_uid)
                    self._image_versions[block.name] = next_version()
                    for view in self._views.values():
                        view.full = True
            elif _is_for_other_engines(block):
                continue
            else:
                for view in views:
                    view.full = True

    def snapshot(
        self,
        depsgraph: bpy.types.Depsgraph,
        *,
        is_visible: Predicate | None = None,
        visibility_key: Hashable = None,
    ) -> SceneSnapshot:
        """The scene as it is now; the same object as last time when nothing changed.

        is_visible: takes an evaluated object and says whether to draw it, besides Blender's
        own visibility. It is asked again only in a full walk; give a `visibility_key` that
        is different for every predicate (see `view_visibility`), or it is asked every time.
        """
        if depsgraph.mode == "RENDER":  # its updates are still there, and no handler need be installed
            self.note_updates(depsgraph)
        key = (_depsgraph_key(depsgraph), visibility_key)
        view = self._views.get(key)
        if view is None:
            view = self._views[key] = View()
            while len(self._views) > MAX_VIEWS:
                self._views.popitem(last=False)
        self._views.move_to_end(key)
        if is_visible is not None and visibility_key is None:
            view.full = True
        if view.full or not self._update_singles(view, depsgraph):
            self._walk(view, depsgraph, is_visible)
        waters = refresh(view.known.waters, depsgraph)
        if waters is None:  # one is gone or has another name, and nobody told us
            self._walk(view, depsgraph, is_visible)
            waters = view.known.waters
        view.known.waters = waters
        snapshot = view.snapshot
        bodies = tuple(record.body for record in waters)
        if bodies != snapshot.waters:  # by identity
            snapshot = dataclasses.replace(snapshot, waters=bodies, version=next_version())
        time = _time(depsgraph.scene)
        if time != snapshot.time:
            snapshot = dataclasses.replace(snapshot, time=time)
        view.snapshot = snapshot
        return snapshot

    def _update_singles(self, view: View, depsgraph: bpy.types.Depsgraph) -> bool:
        """Look at the objects that changed one by one. False, and nothing done, when that is not enough."""
        if not view.changed:
            return True
        if len(view.changed) > MAX_SINGLE_UPDATES:
            return False
        known, last = view.known, view.snapshot
        walk = Walk(depsgraph, None, known, view.changed, self._store)
        sun = last.sun
        matrices: dict[DrawKey, np.ndarray] = {}
        singles: dict[int, Single] = {}
        waters = {record.uid: record for record in known.waters}
        new_waters: dict[int, WaterRecord] = {}
        for uid, name in view.changed.items():
            obj = find_evaluated(uid, name, depsgraph)
            if obj is None:
                return False
            matrix = matrix_of(obj)
            if uid == known.sun_uid and obj.type == "LIGHT" and obj.data.type == "SUN":
                new = read_sun(obj.data, matrix, obj.original.name, walk.notes.append)
                if new is None:
                    return False
                sun = sun if same_sun(new, sun) else new
                continue
            if uid in waters:
                record = _changed_water(waters[uid], walk, obj, matrix, depsgraph, last.meshes)
                if record is None:
                    return False
                new_waters[uid] = record
                continue
            single = known.singles.get(uid)
            changed = None if single is None else _changed_single(single, uid, walk, obj, matrix)
            if changed is None:
                return False
            singles[uid] = changed
            for key, row in single.places:
                if not np.array_equal(known.draws[key].matrices[row], matrix):
                    if key not in matrices:
                        matrices[key] = known.draws[key].matrices.copy()
                    matrices[key][row] = matrix
        if not set(walk.notes) <= set(last.notes):
            return False
        self.meshes_read += walk.meshes_read
        view.changed.clear()
        meshes = last.meshes
        for uid, single in singles.items():
            old = known.singles[uid]
            if single.mesh_id != old.mesh_id:
                known.meshes.pop(old.mesh_id, None)
                known.meshes[single.mesh_id] = single.mesh
            if single.mesh is not meshes[single.mesh.key]:
                meshes = meshes | {single.mesh.key: single.mesh}
        known.singles |= singles
        known.waters = tuple(new_waters.get(record.uid, record) for record in known.waters)
        for key, stacked in matrices.items():
            known.draws[key] = dataclasses.replace(known.draws[key], matrices=stacked, version=next_version())
        if matrices or meshes is not last.meshes or sun is not last.sun:
            view.snapshot = dataclasses.replace(
                last, meshes=meshes, draws=tuple(known.draws.values()), sun=sun, version=next_version()
            )
        return True

    def _walk(self, view: View, depsgraph: bpy.types.Depsgraph, is_visible: Predicate | None) -> None:
        """Look at everything. What equals the last snapshot's is taken from there."""
        elsewhere = [other.known for other in self._views.values() if other is not view]
        walk = Walk(depsgraph, is_visible, view.known, view.changed, self._store, elsewhere)
        walk.run()
        self.full_walks += 1
        self.meshes_read += walk.meshes_read
        sky = self._world.read(depsgraph.scene.world, walk.notes.append)
        draws = tuple(walk.draws.values())
        meshes = walk.used_meshes()
        materials = _materials(walk, draws)
        sun, notes = walk.sun, tuple(dict.fromkeys(walk.notes))
        images = self._images(sky, materials)
        last = view.snapshot
        if last is not None:
            for key, material in materials.items():
                old = last.materials.get(key)
                if old is not None and same_material(material, old):
                    materials[key] = old
            sun = last.sun if same_sun(sun, last.sun) else sun
        if (
            last is not None
            and same_sky(sky, last.sky)
            and (sky.image is None or dict(images)[sky.image] == dict(view.images).get(sky.image))
        ):
            sky = last.sky
        else:
            sky = dataclasses.replace(sky, version=next_version())
        if (
            last is None
            or images != view.images
            or not _same_values(meshes, last.meshes)
            or not _same_values(materials, last.materials)
            or draws != last.draws  # by identity
            or sky is not last.sky
            or sun is not last.sun
            or notes != last.notes
        ):
            view.snapshot = SceneSnapshot(
                version=next_version(),
                time=_time(depsgraph.scene),
                meshes=meshes,
                materials=materials,
                draws=draws,
                sky=sky,
                sun=sun,
                waters=last.waters if last is not None else (),
                notes=notes,
            )
        view.images = images
        view.known = walk.known()
        view.full = False
        view.changed.clear()
        self._store.keep_only(
            {mesh.key for v in self._views.values() for mesh in v.known.meshes.values() if mesh is not None}
        )

    def _images(self, sky: Sky, materials: dict[Hashable, Material]) -> tuple[tuple[str, int], ...]:
        names = {material.image for material in materials.values()} | {sky.image}
        return tuple((name, self.image_version(name)) for name in sorted(filter(None, names)))


def _materials(walk: Walk, draws: tuple[Draw, ...]) -> dict[Hashable, Material]:
    """The materials that the draws use, by key."""
    read = {m.material.key: m.material for m in walk.materials.values()}
    default = default_material()
    return {draw.material: read.get(draw.material, default) for draw in draws}


def _changed_single(
    single: Single, uid: int, walk: Walk, obj: bpy.types.Object, matrix: np.ndarray
) -> Single | None:
    """What an object draws now; None if that is not the same draws with other content."""
    determinant = determinants(matrix[None])[0]
    if not is_usable(determinant) or (determinant < 0.0) != single.mirrored:
        return None
    if obj.type != "MESH" or is_water(obj):
        return None
    look = walk.look(obj, uid, obj.data.session_uid, own_instance=False)
    if look is None or look.slots != single.slots or look.mesh.key != single.mesh.key:
        return None
    if [part.slot for part in look.mesh.parts] != [part.slot for part in single.mesh.parts]:
        return None
    return dataclasses.replace(single, data_uid=look.data_uid, mesh=look.mesh, mesh_id=look.mesh_id)


def _changed_water(
    record: WaterRecord,
    walk: Walk,
    obj: bpy.types.Object,
    matrix: np.ndarray,
    depsgraph: bpy.types.Depsgraph,
    meshes: dict[Hashable, Mesh],
) -> WaterRecord | None:
    """A water object's record now; None if more than that has to be looked at. meshes: of the snapshot."""
    if record.is_instance or not is_water(obj) or not is_shown(obj):
        return None
    surface = read_surface(obj, depsgraph)
    mesh = None
    if (surface.resolution == 0) != (record.body.grid is None):
        return None
    if surface.resolution == 0:
        look = walk.look(obj, record.uid, obj.data.session_uid, own_instance=False)
        if look is None or look.mesh is not meshes.get(record.body.mesh):
            return None
        mesh = look.mesh.key
    body = water_body(obj.original.name, record.body.key, surface, matrix, mesh, walk.notes.append)
    if body is None:
        return None
    return record if same_body(body, record.body) else dataclasses.replace(record, body=body)


def _is_for_other_engines(block: bpy.types.ID) -> bool:
    """Whether a data-block is part of what water objects carry for Blender's own engines.

    With those, it changes in every frame, and no draw uses it.
    """
    if isinstance(block, bpy.types.Material):
        return is_ours(block)
    return isinstance(block, bpy.types.NodeTree) and is_ours_node_tree(block)


def _depsgraph_key(depsgraph: bpy.types.Depsgraph) -> Hashable:
    """Tells depsgraphs apart. An address may be used again, but then all of the new one is in its updates."""
    return (
        depsgraph.as_pointer(),
        depsgraph.mode,
        depsgraph.scene.original.session_uid,
        depsgraph.view_layer.name,
    )


def _time(scene: bpy.types.Scene) -> float:
    """Seconds since frame 0."""
    render = scene.render
    return scene.frame_current_final * render.fps_base / render.fps


def _same_values(a: dict, b: dict) -> bool:
    """Whether two dicts have the same keys and, by identity, the same values."""
    return a.keys() == b.keys() and all(value is b[key] for key, value in a.items())
