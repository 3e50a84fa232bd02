# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface between the vertices of its mesh: the float64 twin of `gpu_shaders/surface_lib.glsl`.

The mesh tells which pixels show water. What they show is computed at the waves themselves: Newton's steps
along the line of sight lead there from a triangle, however coarse it is. A mesh needs no more vertices than
its outline asks for, against the shore and of one crest before the next.

The best place of all is taken that lies within the water's rectangle and its waves' heights and faces the
eye, else the triangle's: where sight touches a crest, steps may lead nowhere. A place that faces away from
the eye has no step of Newton's that leads on; it gets that of one which faces it a little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import waves

if TYPE_CHECKING:  # the plan looks up the techniques
    from .plan import BodyPlan

SURFACE_STEPS = 6
LEAST_APPROACH = 0.25
"""How fast sight is taken to come nearer to waves at least, as a part of that to level water."""

NEARER = 0.9
"""Part of the way from the mesh to the eye that the surface may be nearer."""
ENDLESS = 1e30


class SurfacePoint(NamedTuple):
    """position: (n, 3), render space; slope: (n, 2)."""

    position: np.ndarray
    slope: np.ndarray


def frame_axes(body: BodyPlan) -> np.ndarray:
    """(2, 2) the water frame's axes in its columns."""
    c, s = np.cos(body.body.heading), np.sin(body.body.heading)
    return np.array([[c, -s], [s, c]])


def in_water_frame(surface: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 2) m along the axes of the water frame, from its origin."""
    return (surface[:, :2] - body.origin[:2]) @ frame_axes(body)


def is_in_body(surface: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n,) whether points (n, 3) lie within the rectangle around the body."""
    half, center = np.array(body.extent[:2]), np.array(body.extent[2:])
    return np.all(np.abs(in_water_frame(surface, body) - center) <= half, axis=1)


def most_towards_eye(eye: np.ndarray, point: np.ndarray, *, orthographic: bool = False) -> np.ndarray:
    """(n,) m from points (n, 3) of the mesh that the surface may be nearer to the eye (3,)."""
    return np.full(len(point), ENDLESS) if orthographic else NEARER * np.linalg.norm(eye - point, axis=1)


def surface_in_sight(
    point: np.ndarray,
    wave: np.ndarray,
    mesh_slope: np.ndarray,
    to_eye: np.ndarray,
    most: np.ndarray | float,
    up: float,
    body: BodyPlan,
) -> SurfacePoint:
    """Where lines of sight through points (n, 3) of the mesh meet the surface.

    wave: (n,) height of the waves there, mesh_slope: (n, 2) slope without them, both as interpolated; to_eye:
    (n, 3) unit; most: m towards the eye that the surface may be away; up: 1 seen from the air, -1 from below.
    """
    packed, origin = body.packed_waves, body.origin[:2]
    greatest = waves.max_height(body.body.settings.waves)

    def facing(slope: np.ndarray) -> np.ndarray:
        return up * (over_mesh - np.sum(slope * to_eye[:, :2], axis=1))

    over_mesh = to_eye[:, 2] - np.sum(mesh_slope * to_eye[:, :2], axis=1)
    least_approach = LEAST_APPROACH * np.abs(to_eye[:, 2]) + 1e-3
    slope = waves.slope(packed, point[:, :2] - origin)
    above = wave - waves.height(packed, point[:, :2] - origin)
    way, best = np.zeros(len(point)), np.abs(above)
    found = SurfacePoint(point.astype(np.float64), mesh_slope + slope)
    for _ in range(SURFACE_STEPS):
        way = np.minimum(way - up * above / np.maximum(facing(slope), least_approach), most)
        position = point + way[:, None] * to_eye
        slope = waves.slope(packed, position[:, :2] - origin)
        height = wave + way * over_mesh
        above = height - waves.height(packed, position[:, :2] - origin)
        better = (np.abs(above) < best) & (facing(slope) > 0.0)
        better &= (np.abs(height) <= greatest) & is_in_body(position, body)
        best = np.where(better, np.abs(above), best)
        found = SurfacePoint(
            np.where(better[:, None], position, found.position),
            np.where(better[:, None], mesh_slope + slope, found.slope),
        )
    return found
