# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand somebody's OBJ file in the lake, half under water."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .geometry import box, build_mesh
from .materials import image_material

_IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tga", ".tif", ".tiff")
_SEARCH_RADIUS = 10.0  # m around the wanted spot
_CLEARANCE = 0.05  # m by which the bottom may lie too high or too low


def place_obj(
    scene: bpy.types.Scene,
    path: str | Path,
    *,
    location: Sequence[float],
    water_level: float = 0.0,
    height: float = 2.5,
    heading: float = 0.0,
    collection: bpy.types.Collection | None = None,
) -> bpy.types.Object:
    """Import an OBJ file (Y up) and stand it in the water with half of its height under `water_level`.

    location: (x, y) wanted, world space, m; where the bottom is too shallow there, the nearest spot that is
    deep enough is taken, and where it is deeper, a stone plinth carries the object. height: of the object in
    m. heading: turn about Z in radians. A file without a material image gets the image that stands beside it
    and begins with the same word (spot_triangulated.obj, spot_texture.png).

    ValueError, with nothing imported, for a file that cannot be read, has no vertices or faces, or is
    damaged.
    """
    path = Path(path)
    if not (math.isfinite(height) and height > 0.0):
        raise ValueError(f"The object's height must be positive, not {height:g} m.")
    has_normals, has_uv = _check(path)
    target = collection or scene.collection
    obj = _import(scene, path)
    try:
        mesh = obj.data
        # The importer turns Y up into Z up by the object's matrix; the mesh takes that over.
        mesh.transform(obj.matrix_basis)
        obj.matrix_basis = Matrix.Identity(4)
        low, high = _bounds(mesh)
        extent = high - low
        if extent.max() <= 0.0:
            raise ValueError(f"{path} has all its vertices in one point: export it again with its faces.")
        # Something flat has no height of its own: its longest side is fitted instead.
        scale = height / (extent[2] if extent[2] > 1e-4 * extent.max() else extent.max())
        foot = Vector((-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2]))
        mesh.transform(Matrix.Rotation(heading, 4, "Z") @ Matrix.Scale(scale, 4) @ Matrix.Translation(foot))
        if not has_normals:
            mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), dtype=bool))
        mesh.update()
        _dress(mesh, path, has_uv)
    except ValueError:
        _discard(obj)
        raise
    for user in tuple(obj.users_collection):
        user.objects.unlink(obj)
    feet = water_level - 0.5 * height
    obj.hide_set(False)
    x, y, bottom = _find_spot(scene, location, feet)
    target.objects.link(obj)
    obj.location = (x, y, feet)
    if bottom is not None and bottom < feet - _CLEARANCE:
        low, high = _bounds(mesh)
        _plinth(obj.name, (x, y), np.maximum(high - low, 0.4)[:2] + 0.3, bottom - 0.4, feet, target)
    return obj


def _check(path: Path) -> tuple[bool, bool]:
    """Whether the file has (normals, texture coordinates); ValueError unless it holds vertices and faces."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        reason = error.strerror or error
        raise ValueError(
            f"Cannot read the OBJ file {path} ({reason}): check the path and its permissions."
        ) from None
    vertices = faces = highest = 0
    has_normals = has_uv = False
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            try:
                sound = len(words) >= 4 and all(math.isfinite(float(w)) for w in words[1:4])
            except ValueError:
                sound = False
            if not sound:
                raise ValueError(
                    f"{path}, line {number}: not a vertex ('{line.strip()[:40]}'). Export the file again."
                )
            vertices += 1
        elif words[0] == "vn":
            has_normals = True
        elif words[0] == "vt":
            has_uv = True
        elif words[0] == "f":
            try:
                indices = [int(w.split("/")[0]) for w in words[1:]]
            except ValueError:
                indices = []
            # Indices count from 1, negative ones backwards from the vertices read so far.
            if len(indices) < 3 or any(i == 0 or i < -vertices for i in indices):
                raise ValueError(
                    f"{path}, line {number}: not a face ('{line.strip()[:40]}'). Export the file again."
                )
            faces += 1
            highest = max(highest, *indices)
    if vertices == 0:
        raise ValueError(
            f"{path} holds no vertices: it is empty or no OBJ file. Choose a Wavefront OBJ mesh."
        )
    if faces == 0:
        raise ValueError(
            f"{path} holds no faces, so there is nothing to draw: export it as a mesh with faces."
        )
    if highest > vertices:
        raise ValueError(f"{path}: a face uses vertex {highest} of {vertices}. Export the file again.")
    return has_normals, has_uv


def _import(scene: bpy.types.Scene, path: Path) -> bpy.types.Object:
    before = set(bpy.data.objects)
    selected = [o for o in bpy.context.selected_objects] if bpy.context.view_layer else []
    active = bpy.context.view_layer.objects.active if bpy.context.view_layer else None
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        try:
            bpy.ops.wm.obj_import(
                filepath=str(path),
                forward_axis="NEGATIVE_Z",
                up_axis="Y",
                use_split_objects=False,
                use_split_groups=False,
                validate_meshes=True,
            )
        except RuntimeError as error:
            for obj in set(bpy.data.objects) - before:
                _discard(obj)
            raise ValueError(f"Blender could not import {path}: {str(error).strip()}") from None
    new = [o for o in bpy.data.objects if o not in before]
    meshes = [o for o in new if o.type == "MESH" and len(o.data.polygons) > 0]
    for obj in new:
        if obj not in meshes[:1]:
            _discard(obj)
    if not meshes:
        raise ValueError(f"{path} gave no mesh with faces: export it as a mesh with faces.")
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for obj in selected:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = active
    return meshes[0]


def _discard(obj: bpy.types.Object) -> None:
    data = obj.data
    materials = [m for m in data.materials if m] if isinstance(data, bpy.types.Mesh) else []
    bpy.data.objects.remove(obj)
    if isinstance(data, bpy.types.Mesh):
        bpy.data.meshes.remove(data)
    for material in materials:
        if material.users == 0:
            bpy.data.materials.remove(material)


def _bounds(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    co = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
    mesh.vertices.foreach_get("co", co)
    co = co.reshape(-1, 3).astype(np.float64)
    return co.min(axis=0), co.max(axis=0)


def _dress(mesh: bpy.types.Mesh, path: Path, has_uv: bool) -> None:
    """Give the mesh a material with the image beside the file, unless its own materials have one."""
    for material in mesh.materials:
        if (
            material
            and material.node_tree
            and any(n.type == "TEX_IMAGE" and n.image and n.image.has_data for n in material.node_tree.nodes)
        ):
            return
    picture = _image_beside(path) if has_uv else None
    if picture is not None:
        try:
            image = bpy.data.images.load(str(picture), check_existing=True)
        except RuntimeError:
            raise ValueError(f"Cannot read the image {picture} beside {path}: repair or remove it.") from None
        mesh.materials.clear()
        mesh.materials.append(image_material(path.stem, image))
    elif not any(mesh.materials):
        material = bpy.data.materials.new(path.stem)
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = (0.55, 0.50, 0.42, 1.0)
        mesh.materials.clear()
        mesh.materials.append(material)


def _image_beside(path: Path) -> Path | None:
    """The image in the file's folder with the same stem, else with the same first word."""

    def first_word(stem: str) -> str:
        return re.split(r"[_\-. ]", stem.lower())[0]

    images = sorted(p for p in path.parent.iterdir() if p.suffix.lower() in _IMAGE_SUFFIXES)
    same = [p for p in images if p.stem.lower() == path.stem.lower()]
    alike = [p for p in images if first_word(p.stem) == first_word(path.stem)]
    return next(iter(same + alike), None)


def _bottom(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, x: float, y: float, top: float
) -> float | None:
    """World z of the highest surface at (x, y) below `top`, water excepted; None: there is nothing."""
    origin = Vector((x, y, top))
    for _ in range(32):
        hit, point, _normal, _index, obj, _matrix = scene.ray_cast(
            depsgraph, origin, Vector((0.0, 0.0, -1.0))
        )
        if not hit:
            return None
        settings = getattr(obj, "lake_water", None)
        if settings is None or not settings.enabled:
            return float(point.z)
        origin = point - Vector((0.0, 0.0, 1e-3))
    return None


def _find_spot(
    scene: bpy.types.Scene, location: Sequence[float], feet: float
) -> tuple[float, float, float | None]:
    """(x, y, z of the bottom) nearest to `location` where nothing stands higher than `feet`."""
    depsgraph = scene.view_layers[0].depsgraph
    depsgraph.update()
    for x, y in _spiral(float(location[0]), float(location[1])):
        bottom = _bottom(scene, depsgraph, x, y, feet + 100.0)
        if bottom is None or bottom <= feet + _CLEARANCE:
            return x, y, bottom
    raise ValueError(
        f"Within {_SEARCH_RADIUS:g} m of ({location[0]:g}, {location[1]:g}) the water is nowhere deep "
        "enough for half of the object: choose another place or a smaller height."
    )


def _spiral(x: float, y: float) -> Iterator[tuple[float, float]]:
    yield x, y
    step = 0.4
    for ring in range(1, int(_SEARCH_RADIUS / step) + 1):
        count = 6 * ring
        for n in range(count):
            a = 2.0 * math.pi * n / count
            yield x + ring * step * math.cos(a), y + ring * step * math.sin(a)


def _plinth(
    name: str,
    place: tuple[float, float],
    size: np.ndarray,
    bottom: float,
    top: float,
    collection: bpy.types.Collection,
) -> None:
    material = bpy.data.materials.new(f"{name} Plinth")
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (0.36, 0.33, 0.28, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    block = box((float(size[0]), float(size[1]), top - bottom))
    plinth = bpy.data.objects.new(f"{name} Plinth", build_mesh(f"{name} Plinth", block, [material]))
    plinth.location = (place[0], place[1], 0.5 * (bottom + top))
    collection.objects.link(plinth)
