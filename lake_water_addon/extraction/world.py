# SPDX-License-Identifier: GPL-3.0-or-later
"""The world's light and the sun lamp."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core import sky
from ..core.snapshot import Sky, Sun
from .materials import image_problem
from .nodes import Source, source_of

ENCODED_COLOR_SPACES = {"sRGB"}
LINEAR_COLOR_SPACES = {"Non-Color", "Linear Rec.709", "scene_linear"}


@dataclass
class _ImageLight:
    """A world image, reduced to what the integration needs, and its last integral."""

    signature: Hashable
    pixels: np.ndarray  # (h, w, 3) scene-linear, without strength
    notes: tuple[str, ...]
    rotation: float | None = None
    radiance_sh: np.ndarray | None = None


@dataclass
class WorldReader:
    """Reads worlds, and remembers the integral of each image until it changes."""

    images: dict[int, _ImageLight] = field(default_factory=dict)

    def forget_image(self, session_uid: int) -> None:
        """The image's pixels may have changed."""
        self.images.pop(session_uid, None)

    def reset(self) -> None:
        """Forget everything."""
        self.images.clear()

    def read(self, world: bpy.types.World | None, note: Callable[[str], None]) -> Sky:
        """The sky of an evaluated world, black for none. Its version is 0: the caller numbers it.

        `radiance` and `irradiance_sh` have the strength in them, `strength` is for the image's pixels.
        """
        if world is None:
            return _constant_sky(np.zeros(3))
        background = None
        tree = world.node_tree
        output = tree.get_output_node("ALL") if tree is not None else None
        if output is not None:
            background = source_of(output.inputs["Surface"])
        if tree is None:
            return _constant_sky(world.color)
        if background is None or background.node is None:
            return _constant_sky(np.zeros(3))  # as Blender renders it
        if background.node.type != "BACKGROUND":
            note(f'World "{world.name}": no Background node, the viewport color is taken')
            return _constant_sky(world.color)
        strength_source = background.input("Strength")
        strength = 1.0
        if strength_source.node is None:
            strength = float(strength_source.value)
        elif strength_source.node.type == "VALUE":
            strength = float(strength_source.output.default_value)
        else:
            note(f'World "{world.name}": a strength from "{strength_source.node.bl_label}" is taken as 1')
        color = background.input("Color")
        if color.node is None:
            return _constant_sky(np.array(color.value[:3], dtype=np.float64) * strength)
        if color.node.type == "RGB":
            return _constant_sky(np.array(color.output.default_value[:3], dtype=np.float64) * strength)
        problem = f'its color comes from "{color.node.bl_label}", which is not supported'
        if color.node.type == "TEX_ENVIRONMENT":
            problem = image_problem(color.node.image)
            if problem is not None:
                problem = f"its image {problem}"
            elif color.node.projection != "EQUIRECTANGULAR":
                problem = "its image is a mirror ball, which is not supported"
        if problem is not None:
            note(f'World "{world.name}": {problem}; the viewport color is taken')
            return _constant_sky(np.array(world.color, dtype=np.float64) * strength)
        rotation = _rotation(color, lambda text: note(f'World "{world.name}": {text}'))
        return self._image_sky(color.node.image, strength, rotation, note)

    def _image_sky(
        self, image: bpy.types.Image, strength: float, rotation: float, note: Callable[[str], None]
    ) -> Sky:
        signature = (
            image.name, image.filepath, image.source, tuple(image.size), image.colorspace_settings.name
        )  # fmt: skip
        light = self.images.get(image.session_uid)
        if light is None or light.signature != signature:
            pixels, notes = _read_pixels(image)
            light = self.images[image.session_uid] = _ImageLight(signature, pixels, notes)
        for text in light.notes:
            note(text)
        if light.rotation != rotation:
            light.rotation, light.radiance_sh = rotation, sky.project(light.pixels, rotation)
        return Sky(
            radiance=strength * sky.mean_radiance(light.pixels),
            irradiance_sh=sky.irradiance_sh(strength * light.radiance_sh),
            image=image.name,
            strength=strength,
            rotation=rotation,
        )


def same_sky(a: Sky, b: Sky) -> bool:
    """Whether two skies have the same content, the version apart."""
    return (
        (a.image, a.strength, a.rotation) == (b.image, b.strength, b.rotation)
        and np.array_equal(a.radiance, b.radiance)
        and np.array_equal(a.irradiance_sh, b.irradiance_sh)
    )


def read_sun(lamp: bpy.types.Light, matrix: np.ndarray, name: str, note: Callable[[str], None]) -> Sun | None:
    """A sun lamp with its object-to-world matrix (4, 4); it shines along its own -Z. None for zero scale.

    Irradiance on a surface that faces it: colour times strength times 2^exposure, tinted by
    the temperature where that is used.
    """
    length = np.linalg.norm(matrix[:3, 2])
    if length == 0.0:
        return None
    color = np.array(lamp.color, dtype=np.float64)
    if lamp.use_temperature:
        color = color * np.array(lamp.temperature_color, dtype=np.float64)
    if not lamp.normalize:
        note(f'Sun "{name}": Normalize is off, which is ignored')
    return Sun(
        direction=matrix[:3, 2] / length,
        irradiance=color * float(lamp.energy) * 2.0 ** float(lamp.exposure),
    )


def same_sun(a: Sun | None, b: Sun | None) -> bool:
    """Whether two suns are the same."""
    if a is None or b is None:
        return a is b
    return np.array_equal(a.direction, b.direction) and np.array_equal(a.irradiance, b.irradiance)


def _constant_sky(radiance: np.ndarray) -> Sky:
    radiance = np.array(radiance, dtype=np.float64)
    return Sky(radiance=radiance, irradiance_sh=sky.constant_irradiance_sh(radiance))


def _rotation(texture: Source, note: Callable[[str], None]) -> float:
    """By how much an environment texture's Mapping node turns the image about world +Z, radians.

    A Mapping of type Point, Vector or Normal turns the look-up direction, which turns the
    picture the other way; the type Texture is its inverse.
    """
    vector = texture.input("Vector")
    rotation = 0.0
    while vector.node is not None and vector.node.type == "MAPPING":
        given = {s.identifier: vector.input(s.identifier) for s in vector.node.inputs}
        angles = given["Rotation"]
        if angles.node is not None:
            note("a linked rotation of its image is ignored")
        else:
            rotation += float(angles.value[2]) * (1.0 if vector.node.vector_type == "TEXTURE" else -1.0)
            if angles.value[0] != 0.0 or angles.value[1] != 0.0:
                note("its image is turned about X or Y, which is ignored")
        for name, plain in (("Location", (0.0, 0.0, 0.0)), ("Scale", (1.0, 1.0, 1.0))):
            if name in given and (given[name].node is not None or tuple(given[name].value) != plain):
                note(f"the {name.lower()} of its image's Mapping is ignored")
        vector = given["Vector"]
    if vector.node is not None and not (
        vector.node.type == "TEX_COORD" and vector.output.identifier == "Generated"
    ):
        note(f'its image is looked up by "{vector.node.bl_label}", which is taken as the view direction')
    return rotation


def _read_pixels(image: bpy.types.Image) -> tuple[np.ndarray, tuple[str, ...]]:
    """((h, w, 3) scene-linear float64, reduced; notes) of an equirectangular image."""
    width, height = image.size
    channels = image.channels
    flat = np.empty(width * height * channels, dtype=np.float32)
    image.pixels.foreach_get(flat)
    pixels = flat.reshape(height, width, channels)[:, :, :3]
    if pixels.shape[2] < 3:
        pixels = np.repeat(pixels[:, :, :1], 3, axis=2)
    notes: tuple[str, ...] = ()
    space = image.colorspace_settings.name
    if not image.is_float and space not in LINEAR_COLOR_SPACES:  # a float image is linear in memory
        pixels = sky.linear_from_srgb(pixels)
        if space not in ENCODED_COLOR_SPACES:
            notes = (f'Image "{image.name}": its color space {space} is taken as sRGB',)
    return sky.downsample(np.nan_to_num(pixels, posinf=65504.0, neginf=0.0)), notes
