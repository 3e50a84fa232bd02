# SPDX-License-Identifier: GPL-3.0-or-later
"""Water objects: made, changed and read, with no user interface.

A water object is a mesh object whose `lake_water.enabled` is set. Its surface is the
horizontal plane through the object's origin; heading, location and scale are used.
Blender's viewport shows it as wires only, because Lake Water draws its faces. For Cycles and
EEVEE it carries a modifier and a material (`nodes/`).
"""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .core.snapshot import WaterSettings
from .core.technique_settings import TechniqueSettings
from .core.techniques import TECHNIQUES
from .core.waves import MAX_WAVES, SineWave
from .nodes import carry

MAX_TILT = math.radians(1.0)
MAX_UNEVENNESS = 0.1  # height of a water mesh over its horizontal size


class WaterError(ValueError):
    """Why an object cannot be water, in words for a person: the thing and the remedy."""


def default_waves(
    wind_direction: float = math.radians(20.0),
    *,
    count: int = 6,
    height: float = 0.1,
    longest: float = 4.0,
    shortest: float = 0.5,
    spread: float = math.radians(110.0),
    seed: int = 1,
) -> tuple[SineWave, ...]:
    """The ripples of a lake in a light breeze.

    Wavelengths fall geometrically from `longest` to `shortest` (m), each moved a little
    so that no two are multiples; amplitudes are proportional to them, so that all are
    equally steep, and sum to `height` (m). Directions are spread evenly, in mixed order,
    over `spread` about `wind_direction` (radians in the water frame); phases are
    pseudo-random by `seed`.
    """
    rng = random.Random(seed)
    ratio = (shortest / longest) ** (1.0 / max(count - 1, 1))
    wavelengths = [longest * ratio**i * rng.uniform(0.94, 1.06) for i in range(count)]
    offsets = [(i + 0.5) / count - 0.5 for i in range(count)]
    rng.shuffle(offsets)
    scale = height / sum(wavelengths)
    return tuple(
        SineWave(
            amplitude=scale * wavelength,
            wavelength=wavelength,
            direction=wind_direction + spread * offset,
            phase=rng.uniform(0.0, 2.0 * math.pi),
        )
        for wavelength, offset in zip(wavelengths, offsets, strict=True)
    )


def set_waves(obj: bpy.types.Object, waves: Iterable[SineWave]) -> None:
    """Replace the object's waves."""
    collection = obj.lake_water.waves
    collection.clear()
    for wave in waves:
        item = collection.add()
        item.amplitude = wave.amplitude
        item.wavelength = wave.wavelength
        item.direction = wave.direction
        item.phase = wave.phase
    obj.lake_water.active_wave = 0
    obj.update_tag()  # an emptied list tags nothing by itself


def add_wave(obj: bpy.types.Object) -> None:
    """Append a wave like the active one, 0.7 times as long and high, turned by 40 degrees; make it active.

    Raises WaterError when the surface has as many waves as the shader can sum.
    """
    settings = obj.lake_water
    count = len(settings.waves)
    if count >= MAX_WAVES:
        raise WaterError(f'"{obj.name}" has {count} waves, and no more can be summed: remove one first')
    wave = settings.waves.add()
    if count:
        source = settings.waves[min(settings.active_wave, count - 1)]
        wave.amplitude = 0.7 * source.amplitude
        wave.wavelength = 0.7 * source.wavelength
        wave.direction = source.direction + math.radians(40.0)
        wave.phase = math.fmod(source.phase + 2.4, 2.0 * math.pi)  # any other place in the cycle
    settings.active_wave = count
    obj.update_tag()


def remove_active_wave(obj: bpy.types.Object) -> None:
    """Remove the active wave and make its successor active. Raises WaterError when there is none."""
    settings = obj.lake_water
    if not settings.waves:
        raise WaterError(f'"{obj.name}" has no waves')
    settings.waves.remove(min(settings.active_wave, len(settings.waves) - 1))
    settings.active_wave = max(0, min(settings.active_wave, len(settings.waves) - 1))
    obj.update_tag()


def settings_of(obj: bpy.types.Object) -> WaterSettings:
    """The settings of a water object as plain data; give the evaluated object for animated values."""
    s = obj.lake_water
    return WaterSettings(
        k=s.k,
        q=s.q,
        c=s.c,
        ior=s.ior,
        water_color=tuple(s.water_color),
        waves=tuple(SineWave(w.amplitude, w.wavelength, w.direction, w.phase) for w in s.waves),
        depth=s.depth,
        own=tuple(own_settings(obj, key) for key, t in TECHNIQUES.items() if t.settings is not None),
        images=tuple(
            (technique.settings, sampler, image.name)
            for key, technique in TECHNIQUES.items()
            if technique.settings is not None
            for sampler in technique.settings.maps
            if (image := getattr(getattr(s, key.lower()), sampler)) is not None
        ),
    )


def own_settings(obj: bpy.types.Object, technique: str) -> TechniqueSettings:
    """The settings that only one technique has, as plain data; technique: a key of TECHNIQUES."""
    group, kind = getattr(obj.lake_water, technique.lower()), TECHNIQUES[technique].settings
    values = {}
    for field in dataclasses.fields(kind):
        value = getattr(group, field.name)
        values[field.name] = tuple(value) if isinstance(field.default, tuple) else value
    return kind(**values)


def is_water(obj: bpy.types.Object | None) -> bool:
    """Whether the object is a water surface."""
    return obj is not None and obj.type == "MESH" and obj.lake_water.enabled


def waters_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The water objects of a scene, in the scene's order. Looks at every object: not for draw code."""
    return [obj for obj in scene.objects if is_water(obj)]


class WaterFinder:
    """Remembers each scene's water objects, so that handlers and panels need not look at every object.

    (Any look-up by name looks at every object, too.) The references are kept only while
    Blender keeps the objects in place: `forget` them before and after loading and undo.
    Deleted ones are noticed when asked for; new ones, and those linked to the scene or
    unlinked from it, by what the depsgraph reports as changed.
    """

    def __init__(self) -> None:
        self._waters: dict[int, list[bpy.types.Object]] = {}  # by the scene's session_uid

    def forget(self) -> None:
        """Look at every object again at the next question."""
        self._waters.clear()

    def waters(self, scene: bpy.types.Scene) -> list[bpy.types.Object]:
        """The water objects of the scene, in the scene's order."""
        uid = scene.session_uid
        known = self._waters.get(uid)
        if known is not None and all(_is_still_water(obj) for obj in known):
            return list(known)
        self._waters[uid] = waters_of(scene)
        return list(self._waters[uid])

    def changed(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> bool:
        """Whether the scene has water after the depsgraph's latest updates, or has just lost its last."""
        uid = scene.session_uid
        known = self._waters.get(uid)
        if known is not None:
            relinked = depsgraph.id_type_updated("COLLECTION")
            if relinked or (depsgraph.id_type_updated("OBJECT") and _has_new_water(depsgraph, known)):
                del self._waters[uid]
        return bool(self.waters(scene)) or bool(known)


def _is_still_water(obj: bpy.types.Object) -> bool:
    try:
        return is_water(obj)
    except ReferenceError:  # deleted
        return False


def _has_new_water(depsgraph: bpy.types.Depsgraph, known: list[bpy.types.Object]) -> bool:
    return any(
        isinstance(update.id, bpy.types.Object) and is_water(update.id) and update.id.original not in known
        for update in depsgraph.updates
    )


def create_water(
    name: str,
    size_x: float,
    size_y: float,
    collection: bpy.types.Collection,
    location: tuple[float, float, float] | Vector = (0.0, 0.0, 0.0),
) -> bpy.types.Object:
    """A new rectangular water surface of size_x by size_y metres, centred at `location`, in `collection`.

    Raises WaterError for a size that is not positive.
    """
    if not (size_x > 0.0 and size_y > 0.0):
        raise WaterError(f"The size of the water is {size_x:g} m by {size_y:g} m: it must be greater than 0")
    hx, hy = 0.5 * size_x, 0.5 * size_y
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-hx, -hy, 0.0), (hx, -hy, 0.0), (hx, hy, 0.0), (-hx, hy, 0.0)], [], [(0, 1, 2, 3)])
    obj = bpy.data.objects.new(name, mesh)
    obj.location = location
    collection.objects.link(obj)
    make_water(obj)
    return obj


def make_water(obj: bpy.types.Object) -> None:
    """Turn a mesh object into water with default waves; settings it has from an earlier time are kept.

    The surface is a GRID where the mesh is one flat rectangle, else the MESH itself.
    Reads `obj.matrix_world`: update the view layer first if you have just moved the object.
    Raises WaterError, and changes nothing, for an object that cannot be water.
    """
    surface = _surface_for(obj)
    settings = obj.lake_water
    settings.surface = surface
    if not settings.waves:
        set_waves(obj, default_waves())
    for key, technique in TECHNIQUES.items():
        if technique.settings is not None:
            # Blender keeps a group from when it is first asked for, and loses overrides of one that it lacks.
            getattr(settings, key.lower())
    settings.previous_display_type = obj.display_type
    obj.display_type = "WIRE"
    settings.enabled = True
    carry.dress(obj)


def remove_water(obj: bpy.types.Object) -> None:
    """Make a water object an ordinary mesh again, shown as before; its settings stay for the next time.

    Raises WaterError if it is no water.
    """
    if not is_water(obj):
        raise WaterError(f'"{obj.name}" is not water')
    settings = obj.lake_water
    settings.enabled = False
    carry.undress(obj)
    obj.display_type = settings.previous_display_type or "TEXTURED"
    settings.previous_display_type = ""


def reset_settings(group: bpy.types.PropertyGroup, keep: Iterable[str] = ()) -> None:
    """Put every setting of a property group and of groups in it back to its default, but those in `keep`."""
    kept = {"rna_type", "name", *keep}
    for prop in group.bl_rna.properties:
        if prop.identifier in kept:
            continue
        if isinstance(value := getattr(group, prop.identifier), bpy.types.PropertyGroup):
            reset_settings(value)
        elif not prop.is_readonly:
            group.property_unset(prop.identifier)
    group.id_data.update_tag()  # property_unset tags nothing by itself


def reset_water(obj: bpy.types.Object) -> None:
    """Default settings and waves for a water object. It stays water, on the same kind of surface."""
    reset_settings(obj.lake_water, keep=("enabled", "surface", "previous_display_type", "waves"))
    set_waves(obj, default_waves())


def _surface_for(obj: bpy.types.Object) -> str:
    """'GRID' or 'MESH'. Raises WaterError for an object that cannot be water."""
    if obj.type != "MESH":
        kind = obj.bl_rna.properties["type"].enum_items[obj.type].name.lower()
        raise WaterError(f'"{obj.name}" is not a mesh but of type {kind}: choose a mesh, such as a plane')
    if obj.library is not None:
        raise WaterError(
            f'"{obj.name}" is linked from {obj.library.filepath}: make a library override of it first '
            "(Object > Library Override)"
        )
    if obj.lake_water.enabled:
        raise WaterError(f'"{obj.name}" is water already')
    _check_orientation(obj.name, obj.matrix_world)
    if not obj.modifiers:
        return _check_mesh(obj.name, obj.data, obj.matrix_world)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    try:
        _check_mesh(obj.name, mesh, obj.matrix_world)
    finally:
        evaluated.to_mesh_clear()
    return "MESH"


def _check_orientation(name: str, matrix: Matrix) -> None:
    x, y, z = (matrix.col[i].to_3d() for i in range(3))
    if min(x.length, y.length, z.length) < 1e-9:
        raise WaterError(f'"{name}" has a scale of zero: clear its scale (Alt+S)')
    normal = x.cross(y)
    if normal.length < 1e-9 * x.length * y.length:
        raise WaterError(f'"{name}" is sheared flat by its parent: clear the parent (Alt+P)')
    tilt = normal.angle(Vector((0.0, 0.0, 1.0)))
    if tilt > math.pi - MAX_TILT:
        raise WaterError(f'"{name}" is upside down: clear its rotation (Alt+R) and negative scale (Alt+S)')
    if tilt > MAX_TILT:
        raise WaterError(
            f'"{name}" is tilted by {math.degrees(tilt):.0f}° and water lies flat: clear its rotation '
            "(Alt+R); turning it about Z is fine"
        )


def _check_mesh(name: str, mesh: bpy.types.Mesh, matrix: Matrix) -> str:
    """'GRID' if the mesh is one rectangle along its own X and Y, else 'MESH'. Raises WaterError."""
    if not mesh.polygons:
        raise WaterError(f'"{name}" has no faces: water needs a surface, such as a plane')
    points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    linear = np.array(matrix.to_3x3())
    world = points @ linear.T  # relative to the origin, which is where the water plane lies
    size = np.ptp(world, axis=0)
    across = float(max(size[0], size[1]))
    if across < 1e-6:
        raise WaterError(f'"{name}" has no extent: all its vertices are at one place')
    if size[2] > MAX_UNEVENNESS * across:
        raise WaterError(
            f'"{name}" is {size[2]:.3g} m high and water lies flat: choose a flat mesh, '
            "or use Add Water for a surface of its own"
        )
    offset = 0.5 * float(world[:, 2].max() + world[:, 2].min())
    if abs(offset) > 0.5 * size[2] + 1e-3 * across:
        where = "above" if offset > 0.0 else "below"
        raise WaterError(
            f'The faces of "{name}" lie {abs(offset):.3g} m {where} its origin, and the water plane goes '
            "through the origin: use Object > Set Origin > Origin to Geometry"
        )
    x, y = linear[:, 0], linear[:, 1]
    sheared = abs(x @ y) > 1e-4 * np.linalg.norm(x) * np.linalg.norm(y)
    return "GRID" if not sheared and _is_rectangle(points, mesh) else "MESH"


def _is_rectangle(points: np.ndarray, mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh with points (V, 3) is a single quad whose corners are those of its local XY bounds."""
    if len(points) != 4 or len(mesh.polygons) != 1 or mesh.polygons[0].loop_total != 4:
        return False
    low, high = points.min(axis=0), points.max(axis=0)
    tolerance = 1e-5 * float(np.max(high - low))
    at_high = np.abs(points[:, :2] - high[:2]) <= tolerance
    at_low = np.abs(points[:, :2] - low[:2]) <= tolerance
    corners = {(bool(a), bool(b)) for a, b in at_high}
    return bool(np.all(at_high | at_low)) and len(corners) == 4 and float(high[2] - low[2]) <= tolerance
