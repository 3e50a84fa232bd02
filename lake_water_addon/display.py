# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes a scene's view transform (Standard, AgX, Filmic, …, with look and exposure) into a table.

Draw handlers draw into the display-referred overlay, after Blender's colour management, so they
have to apply it themselves. Blender fills the table: a picture of the lattice is saved through the
scene's colour management and read back.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from .core import view_transform

# Each after those that limit its choices.
SETTINGS = (
    "display_device",
    "emulation",
    "view_transform",
    "look",
    "exposure",
    "gamma",
    "use_curve_mapping",
    "use_white_balance",
    "white_balance_temperature",
    "white_balance_tint",
)
CURVE_SETTINGS = (
    "black_level",
    "white_level",
    "clip_min_x",
    "clip_min_y",
    "clip_max_x",
    "clip_max_y",
    "use_clip",
)


def view_settings_key(scene: bpy.types.Scene) -> tuple:
    """Equal keys give equal tables."""
    return (
        *_settings(scene.display_settings),
        *_settings(scene.view_settings),
        *_curves(scene.view_settings),
    )


def _settings(owner: bpy.types.bpy_struct) -> tuple:
    return tuple((name, getattr(owner, name)) for name in SETTINGS if name in owner.bl_rna.properties)


def _curves(view: bpy.types.ColorManagedViewSettings) -> tuple:
    if not view.use_curve_mapping:
        return ()
    mapping = view.curve_mapping
    values = [value for name in CURVE_SETTINGS for value in np.atleast_1d(getattr(mapping, name)).tolist()]
    for curve in mapping.curves:
        values += [(*point.location, point.handle_type) for point in curve.points]
        values.append(len(curve.points))
    return tuple(values)


def bake_view_transform(scene: bpy.types.Scene) -> tuple[np.ndarray, tuple[float, float]]:
    """((SIZE, SIZE, SIZE, 4) float32 display colours in 0..1, the lattice's range). Takes some 50 ms.

    Creates data-blocks and removes them again, so it must not be called while drawing.
    """
    lattice = view_transform.lattice_range(scene.view_settings.exposure)
    size = view_transform.SIZE
    colors = view_transform.lattice_colors(lattice).astype(np.float32)
    bake_scene = bpy.data.scenes.new("Lake Water view transform")
    image = bpy.data.images.new("Lake Water view transform", size * size, size, float_buffer=True)
    read_back = None
    try:
        _copy_settings(scene.display_settings, bake_scene.display_settings)
        _copy_settings(scene.view_settings, bake_scene.view_settings)
        if scene.view_settings.use_curve_mapping:
            _copy_curves(scene.view_settings.curve_mapping, bake_scene.view_settings.curve_mapping)
        settings = bake_scene.render.image_settings
        settings.file_format = "PNG"
        settings.color_mode = "RGB"
        settings.color_depth = "16"
        settings.compression = 0
        image.pixels.foreach_set(colors.ravel())
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "lattice.png"
            image.save_render(str(path), scene=bake_scene)
            read_back = bpy.data.images.load(str(path))
            read_back.colorspace_settings.name = "Non-Color"
            display = np.empty(size**3 * 4, np.float32)
            read_back.pixels.foreach_get(display)
    finally:
        bpy.data.images.remove(image)
        bpy.data.scenes.remove(bake_scene)
        if read_back is not None:
            bpy.data.images.remove(read_back)
    return display.reshape(size, size, size, 4), lattice


def _copy_settings(source: bpy.types.bpy_struct, target: bpy.types.bpy_struct) -> None:
    for name, value in _settings(source):
        setattr(target, name, value)


def _copy_curves(source: bpy.types.CurveMapping, target: bpy.types.CurveMapping) -> None:
    for name in CURVE_SETTINGS:
        setattr(target, name, getattr(source, name))
    for from_curve, to_curve in zip(source.curves, target.curves, strict=True):
        while len(to_curve.points) < len(from_curve.points):
            to_curve.points.new(0.5, 0.5)
        for from_point, to_point in zip(from_curve.points, to_curve.points, strict=True):
            to_point.location = from_point.location
            to_point.handle_type = from_point.handle_type
    target.update()
