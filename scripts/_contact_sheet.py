# SPDX-License-Identifier: GPL-3.0-or-later
"""A contact sheet: frames of a render side by side in one PNG, with numpy and Blender's own image files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from _frame_files import RenderProblem, disk_full, is_whole_picture

MAX_WIDTH = 1920  # of the sheet, pixels
GAP = 4  # pixels between frames
BACKGROUND = 0.08  # display-referred grey


def choose(frames: Sequence[int], rows: int, columns: int) -> list[int]:
    """rows x columns frames, evenly spaced and starting with the first; all of them where there are fewer.

    The last one is left out where frames are left out anyway: the next after the last frame of a
    turntable is the first, so that an even share of the circle is shown.
    """
    cells = rows * columns
    if len(frames) <= cells:
        return list(frames)
    return [frames[i * len(frames) // cells] for i in range(cells)]


def layout(count: int, rows: int, columns: int) -> tuple[int, int]:
    """(rows, columns) without empty rows, and without empty columns where one row is enough."""
    columns = min(columns, count)
    return min(rows, -(-count // columns)), columns


def area_weights(size: int, target: int) -> np.ndarray:
    """(target, size) matrix that averages `size` pixels into `target` pixels by the area they share."""
    edges = np.linspace(0.0, size, target + 1)
    cells = np.arange(size)
    overlap = np.minimum(edges[1:, None], cells + 1.0) - np.maximum(edges[:-1, None], cells)
    weights = np.clip(overlap, 0.0, None)
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def shrink(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    """(h, w, 3) display-referred sRGB to (height, width, 3), averaged in linear light. Never enlarges."""
    h, w = pixels.shape[:2]
    if (h, w) == (height, width):
        return pixels
    linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    rows, columns = area_weights(h, height), area_weights(w, width)
    small = np.einsum("ya,xb,abc->yxc", rows, columns, linear, optimize=True)
    small = np.clip(small, 0.0, 1.0)
    return np.where(small <= 0.0031308, small * 12.92, 1.055 * small ** (1 / 2.4) - 0.055)


def read_display(path: Path, scene: bpy.types.Scene) -> np.ndarray:
    """(h, w, 3) float32 of a picture file as the scene's view transform shows it, top row first.

    PNG frames are display-referred already; OpenEXR goes through the scene's colour management.
    """
    image = bpy.data.images.load(str(path))
    shown = path.with_name(f".{path.name}.sheet.png")
    try:
        if path.suffix.lower() == ".exr":
            before = scene.render.image_settings.file_format
            scene.render.image_settings.file_format = "PNG"
            image.save_render(str(shown), scene=scene)
            scene.render.image_settings.file_format = before
            bpy.data.images.remove(image)
            image = bpy.data.images.load(str(shown))
        width, height = image.size
        if not width or not height:
            raise RenderProblem(f"{path} cannot be read for the contact sheet: render it again")
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)  # the bytes of the file / 255, whatever the colour space
    finally:
        bpy.data.images.remove(image)
        shown.unlink(missing_ok=True)
    rgba = pixels.reshape(height, width, 4)[::-1]
    return rgba[..., :3] * rgba[..., 3:] + BACKGROUND * (1.0 - rgba[..., 3:])


def write(target: Path, files: Sequence[Path], grid: tuple[int, int], scene: bpy.types.Scene) -> None:
    """Put the pictures on one sheet of grid = (rows, columns), in reading order. Raises RenderProblem."""
    rows, columns = layout(len(files), *grid)
    sheet: np.ndarray | None = None
    for i, path in enumerate(files):
        picture = read_display(path, scene)
        if sheet is None:
            h, w = picture.shape[:2]
            width = max(min(w, (MAX_WIDTH - GAP * (columns + 1)) // columns), 1)
            height = max(round(h * width / w), 1)
            sheet = np.full(
                (rows * (height + GAP) + GAP, columns * (width + GAP) + GAP, 3), BACKGROUND, dtype=np.float32
            )
        row, column = divmod(i, columns)
        y, x = GAP + row * (height + GAP), GAP + column * (width + GAP)
        sheet[y : y + height, x : x + width] = shrink(picture, width, height)
    if sheet is None:
        raise RenderProblem("a contact sheet needs at least one frame")
    save_png(target, sheet)


def save_png(target: Path, pixels: np.ndarray) -> None:
    """Write (h, w, 3) display-referred pixels, top row first; whole or not at all. Raises RenderProblem."""
    h, w = pixels.shape[:2]
    part = target.with_name(f".{target.name}.part.png")
    image = bpy.data.images.new("contact sheet", w, h)
    try:
        rgba = np.ones((h, w, 4), dtype=np.float32)
        rgba[..., :3] = pixels[::-1]
        image.pixels.foreach_set(rgba.ravel())
        image.filepath_raw = str(part)
        image.file_format = "PNG"
        try:
            image.save()
        except RuntimeError as error:
            raise RenderProblem(f"{target} cannot be written: {str(error).strip()}") from None
        if not is_whole_picture(part):
            raise RenderProblem(disk_full(target))
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
        bpy.data.images.remove(image)
