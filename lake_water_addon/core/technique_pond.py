# SPDX-License-Identifier: GPL-3.0-or-later
"""Pond (Luna, 2006; MODEL section 3): the float64 twin of `gpu_shaders/technique_pond_lib.glsl`.

The mean of two normal maps, each scrolled at its own velocity, moves the lookups of both textures, the
refraction (the whole scene without the water) and the reflection. The weight of the refraction is
w = saturate(bias + max(n.E, 0)^p). The weighted colour takes the place of the material's colour under an
ambient and a directional light; a highlight is added for each pixel.

Luna's lights light the water only. Here both textures carry the scene's light already, so the ambient and
the directional light are 1: the material's colours say what each of them adds.

Impurities: the water body's colour lies over the refraction, and an image over the surface.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from . import lighting, optics, wave_maps
from .air_lookup import WaterTextures
from .cameras import UP
from .lookup import Lookup
from .screen_lookup import (
    from_water_frame,
    radiance_near,
    ramp,
    screen_coordinate,
    under_horizon,
    viewing_distance,
    water_below,
)
from .snapshot import Sky, Sun
from .surface import in_water_frame
from .technique_settings import COLOR, LENGTH, TechniqueSettings, scrolled, setting

if TYPE_CHECKING:  # the plan looks up the techniques
    from .plan import BodyPlan

MIN_BASE = 1e-30
"""What a power is taken of, at least: GLSL leaves pow(0, 0) open."""

MIN_EXTENT = 1e-6
"""m: half the width of the water that an image is stretched over, at least."""


@dataclass(frozen=True)
class PondSettings(TechniqueSettings):
    """Luna's dials. Ranges are (begin, end).

    tile_size_0, tile_size_1: m of water that each normal map covers; velocity_0, velocity_1: m/s along the
    axes of the water frame. ripple_scale: parts of the picture's width and height by which n.x and n.y
    move a lookup.

    The bias of the refraction's weight is a sum: bias, a constant; bias_map_strength times a greyscale
    image that is stretched over the water; bias_depth_strength where the water is shallow (less and less
    over bias_depth_range, m); bias_distance_strength near the camera (bias_distance_range, m). power: p.

    ambient, diffuse, specular: of the material; shininess: exponent of the highlight.
    impurity: part of the refraction that the water colour covers. impurity_map_strength: opacity of the
    impurities' image, whose alpha counts; impurity_tile_size: m of water that it covers.
    geometric_waves: whether the waves raise the surface. The plan reads it, not the shader.
    """

    tile_size_0: float = setting(
        4.0,
        "Tile Size 1",
        "Metres of water that the first normal map covers. Raise it for longer ripples",
        min=0.01,
        max=10000.0,
        soft_max=20.0,
        **LENGTH,
    )
    velocity_0: tuple[float, float] = setting(
        (0.15, 0.06),
        "Velocity 1",
        "How fast the first normal map moves along X and Y of the water object, m/s",
        min=-100.0,
        max=100.0,
        soft_min=-2.0,
        soft_max=2.0,
    )
    tile_size_1: float = setting(
        2.7,
        "Tile Size 2",
        "Metres of water that the second normal map covers. No multiple of the first hides that they repeat",
        min=0.01,
        max=10000.0,
        soft_max=20.0,
        **LENGTH,
    )
    velocity_1: tuple[float, float] = setting(
        (-0.04, 0.1),
        "Velocity 2",
        "How fast the second normal map moves along X and Y of the water object, m/s",
        min=-100.0,
        max=100.0,
        soft_min=-2.0,
        soft_max=2.0,
    )
    ripple_scale: tuple[float, float] = setting(
        (0.06, 0.03),
        "Ripple Scale",
        "How far ripples move what is seen in the water, as parts of the picture's width and height",
        min=-1.0,
        max=1.0,
        soft_min=0.0,
        soft_max=0.2,
        precision=3,
        section=True,
    )
    bias: float = setting(
        0.2,
        "Bias",
        "Added to the weight of what is seen through the water: raise it for clearer, less mirroring water",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    bias_map_strength: float = setting(
        0.0,
        "Bias Map Strength",
        "How much the greyscale image over the whole water adds to the bias, where it is white",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        label="Map Bias",
    )
    bias_depth_strength: float = setting(
        0.0,
        "Shallow Bias",
        "What shallow water adds to the bias, so that the bottom shows at the shore",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    bias_depth_range: tuple[float, float] = setting(
        (0.0, 2.0),
        "Shallow Range",
        "Depths between which the shallow bias fades away",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )
    bias_distance_strength: float = setting(
        0.0,
        "Near Bias",
        "What water near the camera adds to the bias",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    bias_distance_range: tuple[float, float] = setting(
        (5.0, 60.0),
        "Near Range",
        "Distances between which the near bias fades away",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )
    power: float = setting(
        0.7,
        "Power",
        "How fast the mirror takes over towards grazing view: lower keeps the water clear for longer",
        min=0.0,
        max=100.0,
        soft_max=5.0,
        section=True,
    )
    ambient: tuple[float, float, float] = setting(
        (0.5, 0.5, 0.5),
        "Ambient",
        "Part of the water's picture that shows without sunlight",
        min=0.0,
        max=1000.0,
        size=3,
        **COLOR,
        section=True,
    )
    diffuse: tuple[float, float, float] = setting(
        (0.6, 0.6, 0.6),
        "Diffuse",
        "Part of the water's picture that sunlight adds where the ripples face the sun",
        min=0.0,
        max=1000.0,
        size=3,
        **COLOR,
    )
    specular: tuple[float, float, float] = setting(
        (0.8, 0.8, 0.8),
        "Specular",
        "Brightness of the sun's highlight, relative to the sun",
        min=0.0,
        max=1000.0,
        size=3,
        **COLOR,
    )
    shininess: float = setting(
        64.0,
        "Shininess",
        "How small the sun's highlight is. Raise it for fewer, smaller sparks",
        min=0.0,
        max=100000.0,
        soft_max=1000.0,
        precision=0,
    )
    impurity: float = setting(
        0.15,
        "Impurity",
        "Part of what is seen through the water that the water color covers",
        min=0.0,
        max=1.0,
        section=True,
    )
    impurity_map_strength: float = setting(
        0.0,
        "Impurity Map Strength",
        "Opacity of the image that floats on the water, such as pollen or leaves",
        min=0.0,
        max=1.0,
        label="Map Opacity",
    )
    impurity_tile_size: float = setting(
        6.0,
        "Impurity Tile Size",
        "Metres of water that the image of impurities covers",
        min=0.01,
        max=10000.0,
        soft_max=20.0,
        **LENGTH,
        label="Map Tile Size",
    )
    geometric_waves: bool = setting(
        False,
        "Geometric Waves",
        "Raise the surface by the waves, too, beside the ripples of the normal maps",
        section=True,
    )

    maps: ClassVar = {
        "normal_map_0": "NORMAL",
        "normal_map_1": "NORMAL",
        "bias_map": "COLOR",
        "impurity_map": "COLOR",
    }

    @property
    def displaces(self) -> bool:
        """As the person chose."""
        return self.geometric_waves

    def moving(self, time: float) -> tuple[tuple[float, ...], ...]:
        """How far each normal map has moved, in its tiles: x, y of the first, x, y of the second."""
        first = scrolled(self.velocity_0, time, self.tile_size_0)
        return (first + scrolled(self.velocity_1, time, self.tile_size_1),)


@dataclass(frozen=True, eq=False)
class PondMaps:
    """Images by the names of `PondSettings.maps`: coordinates (n, 2) -> texels (n, 4).

    bias_map runs over the water once, from 0 to 1; the others repeat.
    """

    normal_map_0: Lookup
    normal_map_1: Lookup
    bias_map: Lookup
    impurity_map: Lookup


def ripple_normal(p: np.ndarray, settings: PondSettings, time: float, maps: PondMaps) -> np.ndarray:
    """(n, 3) unit mean of both maps' normals, in the water frame; p: (n, 2) m in it."""
    (moved,) = settings.moving(time)
    n0 = wave_maps.decode_normal(maps.normal_map_0(p / settings.tile_size_0 - np.array(moved[:2])))
    n1 = wave_maps.decode_normal(maps.normal_map_1(p / settings.tile_size_1 - np.array(moved[2:])))
    mean = 0.5 * (n0 + n1)
    return mean / np.linalg.norm(mean, axis=1, keepdims=True)


def on_waves(normal: np.ndarray, ripple: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 3) unit normal of ripples on waves: their slopes add; `normal` is in render space."""
    turned = from_water_frame(ripple[:, :2], body)
    level = normal[:, :2] * ripple[:, 2:] + turned * normal[:, 2:]
    n = np.concatenate([level, normal[:, 2:] * ripple[:, 2:]], axis=1)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def lookup_shift(ripple: np.ndarray, own: np.ndarray, settings: PondSettings) -> np.ndarray:
    """(n, 2) how far a ripple moves the lookup of a fragment whose own coordinates are (n, 2).

    Luna's v runs down: the factor 1 - v^10 lets the shift vanish at the bottom edge of the picture, beyond
    which there is nothing to look up.
    """
    v = np.clip(1.0 - own[:, 1], 0.0, 1.0)
    factor = np.stack([np.ones_like(v), 1.0 - v**10], axis=1)
    return ripple[:, :2] * np.array(settings.ripple_scale) * factor


def over_the_water(p: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 2) coordinates that run from 0 to 1 over the rectangle around the water; p: m in its frame."""
    half, center = np.array(body.extent[:2]), np.array(body.extent[2:])
    return 0.5 * (p - center) / np.maximum(half, MIN_EXTENT) + 0.5


def refraction_bias(
    depth: np.ndarray, distance: np.ndarray, grey: np.ndarray, settings: PondSettings
) -> np.ndarray:
    """(n,) bias of the refraction's weight; depth of the water, distance from the camera: (n,) m."""
    bias = settings.bias + settings.bias_map_strength * grey
    bias = bias + settings.bias_depth_strength * (1.0 - ramp(depth, *settings.bias_depth_range))
    return bias + settings.bias_distance_strength * (1.0 - ramp(distance, *settings.bias_distance_range))


def refraction_weight(cosine: np.ndarray, bias: np.ndarray, power: float) -> np.ndarray:
    """(n,) w = saturate(bias + max(n.E, 0)^p)."""
    return np.clip(bias + np.power(np.maximum(cosine, MIN_BASE), power), 0.0, 1.0)


def light_on_material(normal: np.ndarray, settings: PondSettings, sun: Sun | None) -> np.ndarray:
    """(n, 3) what the material makes of the weighted colour: ambient + diffuse max(n.s, 0).

    Without a sun the directional light comes from above.
    """
    towards = UP if sun is None else sun.direction
    facing = np.maximum(normal @ towards, 0.0)[:, None]
    return np.array(settings.ambient) + np.array(settings.diffuse) * facing


def highlight(normal: np.ndarray, to_eye: np.ndarray, settings: PondSettings, sun: Sun | None) -> np.ndarray:
    """(n, 3) radiance of the sun's mirror image, by Phong's formula, where the normal faces the sun."""
    if sun is None:
        return np.zeros_like(normal)
    mirrored = optics.reflect_direction(np.broadcast_to(-sun.direction, normal.shape), normal)
    cosine = np.sum(mirrored * to_eye, axis=1)
    shine = np.power(np.maximum(cosine, MIN_BASE), settings.shininess)
    shine = np.where(normal @ sun.direction > 0.0, shine, 0.0)
    return shine[:, None] * np.array(settings.specular) * sun.irradiance / np.pi


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    settings: PondSettings,
    time: float,
    textures: WaterTextures,
    maps: PondMaps,
    sun: Sun | None,
    sky: Sky,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E. normal: of the waves, facing the viewer."""
    p = in_water_frame(surface, body)
    ripple = ripple_normal(p, settings, time, maps)
    n = on_waves(normal, ripple, body)
    own = screen_coordinate(surface, body)
    at = own + lookup_shift(ripple, own, settings)
    water_color = np.array(body.body.settings.water_color)
    refracted = radiance_near(textures.refraction_color, at, own, water_color)
    refracted = refracted + settings.impurity * (water_color - refracted)
    mirrored = textures.sky_radiance(optics.reflect_upwards(-to_eye, n))
    reflected = radiance_near(textures.reflection_color, under_horizon(at, body), own, mirrored)

    depth, _ = water_below(surface, body, textures.bottom_depth)
    grey = maps.bias_map(over_the_water(p, body))[:, 0]
    bias = refraction_bias(depth, viewing_distance(surface, body), grey, settings)
    w = refraction_weight(np.sum(n * to_eye, axis=1), bias, settings.power)[:, None]
    color = light_on_material(n, settings, sun) * (reflected + w * (refracted - reflected))

    layer = maps.impurity_map(p / settings.impurity_tile_size)
    light = lighting.sun_in_air(n, sun) / np.pi + lighting.sky_irradiance(sky, n)
    floating = layer[:, :3] * light
    color = color + settings.impurity_map_strength * layer[:, 3:] * (floating - color)
    return color + highlight(n, to_eye, settings, sun)
