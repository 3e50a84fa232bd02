# SPDX-License-Identifier: GPL-3.0-or-later
"""Lookups at a fragment's own place in the picture: the float64 twin of `gpu_shaders/screen_lookup_lib.glsl`.

Pond and Ripple see both textures from the main camera (the reflection through its mirror image), so that a
point of the flat surface has the same coordinates in both; only a map of ripples moves the lookup.
Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import cameras
from .air_lookup import LEAST_KNOWN, in_camera, over_horizon, straight_bottom
from .lookup import Lookup
from .surface import frame_axes

if TYPE_CHECKING:  # the plan looks up the techniques
    from .plan import BodyPlan

MIN_WIDTH = 1e-6
"""A ramp narrower than this is a step."""


def from_water_frame(vector: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 2) components along x and y of render space, from those along the axes of the water frame."""
    return vector @ frame_axes(body).T


def screen_coordinate(surface: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 2) where the surface lies in both textures."""
    return cameras.to_texture(body.refraction.projection, in_camera(body.refraction, surface))


def under_horizon(at: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 2) coordinates of the reflection texture, kept on the side of its horizon where the scene is.

    A ripple far off would look beyond it, at what the mirrored camera sees of the sky's nadir.
    """
    projection = body.reflection.projection
    if cameras.is_orthographic(projection):
        return at
    ndc = 2.0 * at - 1.0
    scale, shift = np.diagonal(projection)[:2], projection[:2, 2]
    ray = np.concatenate([(ndc + shift) / scale, np.full((len(at), 1), -1.0)], axis=1)
    return cameras.to_texture(projection, over_horizon(body.reflection, ray))


def viewing_distance(surface: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n,) m from the camera; along its axis when it is orthographic, for it has no place."""
    u = in_camera(body.refraction, surface)
    if cameras.is_orthographic(body.refraction.projection):
        return np.maximum(-u[:, 2], 0.0)
    return np.linalg.norm(u, axis=1)


def water_below(surface: np.ndarray, body: BodyPlan, bottom_depth: Lookup) -> tuple[np.ndarray, np.ndarray]:
    """((n,), (n,)) m of water over what is seen straight through the surface: downwards, and on that line.

    0 where something that is nearer than the surface stands in the texture.
    """
    u = in_camera(body.refraction, surface)
    a = straight_bottom(u, body.refraction.projection, bottom_depth)
    up = body.refraction.view[:3, 2]
    beyond = a[:, 2] < u[:, 2]
    depth = np.where(beyond, np.maximum((u - a) @ up, 0.0), 0.0)
    return depth, np.where(beyond, np.linalg.norm(a - u, axis=1), 0.0)


def ramp(x: np.ndarray, begin: float, end: float) -> np.ndarray:
    """0 up to `begin`, 1 from `end` on, linear between; end < begin gives the falling one."""
    width = end - begin
    if abs(width) < MIN_WIDTH:
        return np.where(np.asarray(x) >= begin, 1.0, 0.0)
    return np.clip((np.asarray(x) - begin) / width, 0.0, 1.0)


def radiance_near(picture: Lookup, at: np.ndarray, own: np.ndarray, substitute: np.ndarray) -> np.ndarray:
    """(n, 3) radiance of a picture at `at` (n, 2), or at the fragment's `own` place where it is not known.

    picture: -> premultiplied radiance and alpha (n, 4). substitute: (..., 3) where neither is known.
    """
    texel = picture(at)
    texel = np.where(texel[:, 3:] < LEAST_KNOWN, picture(own), texel)
    known = np.clip(4.0 * texel[:, 3:], 0.0, 1.0)
    return substitute + known * (texel[:, :3] / np.maximum(texel[:, 3:], 1e-4) - substitute)
