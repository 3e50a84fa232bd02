# SPDX-License-Identifier: GPL-3.0-or-later
"""Ripple (Chen; MODEL section 4): the float64 twin of `gpu_shaders/technique_ripple_lib.glsl`.

The surface is flat. A dudv map scrolled along the flow moves the lookups and tilts the normal. The
water is as opaque as alpha = distance + angle + depth: so much of the reflection lies over what is below,
which is darkened with its depth and with the water in front of it.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from . import optics, wave_maps
from .air_lookup import WaterTextures
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
from .surface import in_water_frame
from .technique_settings import ANGLE, LENGTH, TechniqueSettings, scrolled, setting

if TYPE_CHECKING:  # the plan looks up the techniques
    from .plan import BodyPlan


@dataclass(frozen=True)
class RippleSettings(TechniqueSettings):
    """Chen's dials. Ranges are (begin, end): a factor grows from 0 to its strength between the two.

    tile_size: m of water that the map covers. flow_direction: radians from the water frame's +X;
    flow_speed: m/s. reflection_distortion, refraction_distortion: parts of the picture by which a
    displacement of 1 moves the lookup; normal_strength: slope that it is.
    distance, angle and depth make the water opaque: distance_range: m from the camera; angle_range: radians
    between the line of sight and the normal; depth_range: m below the surface.
    depth_darkening, path_darkening: parts by which the depth, and the m of water on the line of sight,
    darken what is below.
    """

    tile_size: float = setting(
        4.0,
        "Tile Size",
        "Metres of water that the dudv map covers. Raise it for longer ripples",
        min=0.01,
        max=10000.0,
        soft_max=20.0,
        **LENGTH,
    )
    flow_direction: float = setting(
        0.0,
        "Flow Direction",
        "Where the ripples flow to, from the water object's X axis towards its Y axis",
        **ANGLE,
    )
    flow_speed: float = setting(
        0.25,
        "Flow Speed",
        "How fast the ripples flow, m/s",
        min=-100.0,
        max=100.0,
        soft_min=0.0,
        soft_max=2.0,
    )
    reflection_distortion: float = setting(
        0.03,
        "Reflection Distortion",
        "How far ripples move what is mirrored, as a part of the picture",
        min=-1.0,
        max=1.0,
        soft_min=0.0,
        soft_max=0.2,
        precision=3,
        label="Mirror Shift",
        section=True,
    )
    refraction_distortion: float = setting(
        0.02,
        "Refraction Distortion",
        "How far ripples move what is seen through the water, as a part of the picture",
        min=-1.0,
        max=1.0,
        soft_min=0.0,
        soft_max=0.2,
        precision=3,
        label="Bottom Shift",
    )
    normal_strength: float = setting(
        0.5,
        "Normal Strength",
        "Slope of the steepest ripples, for the angle of view and the sky's mirror image",
        min=-10.0,
        max=10.0,
        soft_min=0.0,
        soft_max=2.0,
        label="Slope",
    )
    distance_strength: float = setting(
        0.1,
        "Distance",
        "How opaque, with the mirror image, distance makes the water",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    distance_range: tuple[float, float] = setting(
        (5.0, 60.0),
        "Distance Range",
        "Distances from the camera between which the water turns opaque",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )
    angle_strength: float = setting(
        0.6,
        "Angle",
        "How opaque, with the mirror image, grazing view makes the water",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    angle_range: tuple[float, float] = setting(
        (radians(50.0), radians(88.0)),
        "Angle Range",
        "Angles between sight and the surface's normal between which the water turns opaque",
        min=0.0,
        max=1.5707963267948966,
        unit="ROTATION",
        label="Range",
    )
    depth_strength: float = setting(
        0.1,
        "Depth",
        "How opaque, with the mirror image, depth makes the water",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        section=True,
    )
    depth_range: tuple[float, float] = setting(
        (0.0, 3.0),
        "Depth Range",
        "Depths between which the water turns opaque",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )
    depth_darkening: float = setting(
        0.4,
        "Depth Darkening",
        "Part by which depth darkens what is seen through the water",
        min=0.0,
        max=1.0,
        label="Dark by Depth",
        section=True,
    )
    depth_darkening_range: tuple[float, float] = setting(
        (0.0, 4.0),
        "Depth Darkening Range",
        "Depths between which it darkens",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )
    path_darkening: float = setting(
        0.4,
        "Path Darkening",
        "Part by which the water in front of it darkens what is seen",
        min=0.0,
        max=1.0,
        label="Dark by Path",
        section=True,
    )
    path_darkening_range: tuple[float, float] = setting(
        (0.0, 15.0),
        "Path Darkening Range",
        "Metres of water on the line of sight between which it darkens",
        min=0.0,
        max=100000.0,
        soft_max=200.0,
        unit="LENGTH",
        label="Range",
    )

    maps: ClassVar = {"dudv_map": "DUDV"}

    @property
    def displaces(self) -> bool:
        """The surface is flat."""
        return False

    def moving(self, time: float) -> tuple[tuple[float, ...], ...]:
        """How far the map has flowed, in tiles."""
        velocity = (
            self.flow_speed * cos(self.flow_direction),
            self.flow_speed * sin(self.flow_direction),
        )
        return (scrolled(velocity, time, self.tile_size),)


def displacement(
    surface: np.ndarray, body: BodyPlan, settings: RippleSettings, time: float, dudv_map: Lookup
) -> np.ndarray:
    """(n, 2) what the map says at the surface points, -1 to 1, along the axes of the water frame."""
    (offset,) = settings.moving(time)
    at = in_water_frame(surface, body) / settings.tile_size - np.array(offset)
    return wave_maps.decode_dudv(dudv_map(at))


def opacity(
    distance: np.ndarray, cosine: np.ndarray, depth: np.ndarray, settings: RippleSettings
) -> np.ndarray:
    """(n,) alpha in 0..1, the part of the reflection, from m, the cosine of the angle of view, and m."""
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    alpha = settings.distance_strength * ramp(distance, *settings.distance_range)
    alpha = alpha + settings.angle_strength * ramp(angle, *settings.angle_range)
    alpha = alpha + settings.depth_strength * ramp(depth, *settings.depth_range)
    return np.clip(alpha, 0.0, 1.0)


def brightness(depth: np.ndarray, path: np.ndarray, settings: RippleSettings) -> np.ndarray:
    """(n,) what is left of the scene below, in 0..1, at a depth (m) behind so much water (m)."""
    lost = settings.depth_darkening * ramp(depth, *settings.depth_darkening_range)
    lost = lost + settings.path_darkening * ramp(path, *settings.path_darkening_range)
    return np.clip(1.0 - lost, 0.0, 1.0)


def water_radiance(
    surface: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    settings: RippleSettings,
    time: float,
    textures: WaterTextures,
    dudv_map: Lookup,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E. dudv_map: coordinates in tiles (n, 2) -> texels."""
    d = displacement(surface, body, settings, time, dudv_map)
    tilt = from_water_frame(settings.normal_strength * d, body)
    normal = np.concatenate([tilt, np.ones((len(d), 1))], axis=1)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    depth, path = water_below(surface, body, textures.bottom_depth)
    own = screen_coordinate(surface, body)
    refracted = radiance_near(
        textures.refraction_color, own + settings.refraction_distortion * d, own, np.zeros(3)
    )
    reflected = radiance_near(
        textures.reflection_color,
        under_horizon(own + settings.reflection_distortion * d, body),
        own,
        textures.sky_radiance(optics.reflect_upwards(-to_eye, normal)),
    )
    cosine = np.sum(to_eye * normal, axis=1)
    alpha = opacity(viewing_distance(surface, body), cosine, depth, settings)[:, None]
    below = brightness(depth, path, settings)[:, None] * refracted
    return below + alpha * (reflected - below)
