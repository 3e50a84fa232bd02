# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures as arrays: read from Blender once, then looked up with numpy alone."""

from __future__ import annotations

import numpy as np

from lake_water_addon.core import sky as sky_math
from lake_water_addon.core.snapshot import SceneSnapshot, Sky

Images = dict[str, np.ndarray]
"""Name -> (h, w, 4) float32 scene-linear pixels with straight alpha, first row at the bottom."""


def read_images(snapshot: SceneSnapshot) -> Images:
    """The pixels of all images that a snapshot names, from the open Blender file.

    KeyError for an image that is not there.
    """
    import bpy

    names = {material.image for material in snapshot.materials.values()} | {snapshot.sky.image}
    return {name: _pixels(bpy.data.images[name]) for name in names - {None}}


def _pixels(image) -> np.ndarray:
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, 4)
    # Blender gives the bytes of a file as they are, and floats scene-linear.
    if not image.is_float and image.colorspace_settings.name == "sRGB":
        pixels[..., :3] = sky_math.linear_from_srgb(pixels[..., :3])
    return pixels


def bilinear(pixels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(n, channels) of an image that repeats, at texture coordinates (n, 2)."""
    height, width = pixels.shape[:2]
    at = uv * (width, height) - 0.5
    low = np.floor(at)
    part = at - low
    x, y = low.astype(np.int64).T
    x0, x1, y0, y1 = x % width, (x + 1) % width, y % height, (y + 1) % height
    px, py = part[:, :1], part[:, 1:]
    lower = pixels[y0, x0] * (1.0 - px) + pixels[y0, x1] * px
    upper = pixels[y1, x0] * (1.0 - px) + pixels[y1, x1] * px
    return lower * (1.0 - py) + upper * py


def sky_radiance(sky: Sky, images: Images, direction: np.ndarray) -> np.ndarray:
    """(n, 3) radiance of the world in unit directions (n, 3); twin of `sky_lib.glsl`."""
    if sky.image is None:
        return np.broadcast_to(np.asarray(sky.radiance, dtype=np.float64), direction.shape)
    pixels = images[sky.image]
    uv = sky_math.equirectangular_uv(direction, sky.rotation)
    # The image repeats: at a pole its two edges must not mix.
    half_texel = 0.5 / len(pixels)
    uv[:, 1] = np.clip(uv[:, 1], half_texel, 1.0 - half_texel)
    return bilinear(pixels[..., :3], uv) * sky.strength
