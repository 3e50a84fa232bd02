# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender images of normal maps and dudv maps: made here, or checked when they are a person's own."""

from __future__ import annotations

import bpy
import numpy as np

from .core.wave_maps import MapKind, classify, make_map
from .extraction.materials import image_problem

DEFAULT_SIZE = 256
"""Texels a side: six for the shortest wave of `wave_maps.POND_RIPPLES`, and 0.8 MB in the saved file."""

LABELS: dict[MapKind, str] = {"NORMAL": "normal map", "DUDV": "dudv map"}

_MADE_AS = "lake_water_map"
"""Custom property of an image that was made here: a person may rename it."""


def wave_map(kind: MapKind, seed: int, size: int = DEFAULT_SIZE) -> bpy.types.Image:
    """The image of a tile of waves, made now if there is none: float, Non-Color, packed into the file.

    One that lost its pixels is made again, and takes its place wherever it is used. Adds to bpy.data, so that
    it must not be called while Blender draws or renders.
    """
    made_as = f"{kind} {seed} {size}"
    found = [image for image in bpy.data.images if image.get(_MADE_AS) == made_as]
    for image in found:
        if image_problem(image) is None and _is_kept(image):
            return image
    made = _make(kind, seed, size)
    made[_MADE_AS] = made_as
    for image in found:
        name = image.name
        image.user_remap(made)
        bpy.data.images.remove(image)
        made.name = name
    return made


def _is_kept(image: bpy.types.Image) -> bool:
    """Whether its pixels are still those that were packed (or painted), and not Blender's blank ones."""
    return image.packed_file is not None or image.source == "FILE" or image.is_dirty


def _make(kind: MapKind, seed: int, size: int) -> bpy.types.Image:
    name = f"Lake Water {LABELS[kind].title()} {seed} {size}"
    image = bpy.data.images.new(name, size, size, float_buffer=True, is_data=True)
    pixels = np.ones((size, size, 4), dtype=np.float32)
    pixels[..., :3] = make_map(kind, seed, size)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def image_messages(image: bpy.types.Image | None, expected: MapKind) -> tuple[str, ...]:
    """What is wrong with an image that is to serve as a map, in words for a person; empty when nothing is.

    Reads all of its pixels (a tenth of a second for 2048 x 2048): to be asked when the choice changes.
    """
    if image is None:
        return ()
    problem = image_problem(image)
    if problem is not None:
        return (f"Image {problem}",)
    messages = []
    color_space = image.colorspace_settings
    if not color_space.is_data:
        messages.append(
            f'Image "{image.name}": its color space is {color_space.name}, which bends the directions in it. '
            "Set its Color Space to Non-Color"
        )
        if image.is_float:
            return tuple(messages)  # its pixels are already bent: what they were cannot be told
    kind = _kind_of(image)
    if kind is None:
        messages.append(f'Image "{image.name}" does not look like a {LABELS[expected]}')
    elif kind != expected:
        messages.append(
            f'Image "{image.name}" looks like a {LABELS[kind]}, but a {LABELS[expected]} is needed here: '
            "choose another image"
        )
    return tuple(messages)


def _kind_of(image: bpy.types.Image) -> MapKind | None:
    channels = image.channels
    if channels < 3:
        return None
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    texels = pixels.reshape(-1, channels)
    # A million texels say as much as all of them; an odd step meets every column.
    return classify(texels[:: len(texels) // 1_000_000 | 1])
