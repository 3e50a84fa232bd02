# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the rays of some of a picture's pixels really end, and how far off the hits pass of a plan is there.

The surface is the sum of sines itself, and not its triangles; of a mesh it is the triangles. Each pixel's ray
is refracted and reflected there once and followed to the first thing of the scene. Render space throughout
(see `core.plan`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .core import cameras, optics, waves
from .core.hits import found_points, reflection_errors, refraction_errors
from .core.plan import BodyPlan, FramePlan
from .core.snapshot import Mesh
from .raycast import RayCaster
from .render.passes.hits import Hits

FARTHEST = 0.05
"""Part of the picture's diagonal that a place can be off at most; what is not found is as far off."""

NEWTON_STEPS = 8


@dataclass(frozen=True, eq=False)
class Truth:
    """Of n pixels at one time. body: (n,) number; surface: (n, 3) U.

    rows, columns: (n,) of the pixels in the hits pass. refracted, reflected: (n, 3) W*, NaN where the ray
    meets nothing. fresnel: (n,) part of the colour that is mirrored; absorption: (n,) 1/m.
    """

    rows: np.ndarray
    columns: np.ndarray
    body: np.ndarray
    surface: np.ndarray
    refracted: np.ndarray
    reflected: np.ndarray
    fresnel: np.ndarray
    absorption: np.ndarray


@dataclass(frozen=True)
class RayErrors:
    """metres, texels: medians of the refracted rays, NaN without any; pixels: mean of all pixels."""

    metres: float
    texels: float
    pixels: float


def find_truth(
    plan: FramePlan, hits: Hits, caster: RayCaster, count: int, rng: np.random.Generator
) -> Truth | None:
    """Of `count` pixels of water at most, evenly spread. None when the pass shows none.

    caster: with the plan's origin.
    """
    number = np.rint(hits.surface[..., 3]).astype(int) - 1
    rows, columns = np.nonzero(number >= 0)
    if len(rows) == 0:
        return None
    start = (np.arange(min(count, len(rows))) + rng.random()) / min(count, len(rows))
    chosen = (start * len(rows)).astype(int) % len(rows)
    rows, columns = rows[chosen], columns[chosen]
    body = number[rows, columns]
    surface = hits.surface[rows, columns, :3].astype(np.float64)
    sight = _sight(plan, surface)
    normal, n12, absorption = np.empty_like(surface), np.empty(len(surface)), np.empty(len(surface))
    for i in np.unique(body):
        of, planned = body == i, plan.bodies[i]
        surface[of], normal[of] = _on_surface(planned, plan.snapshot.meshes, surface[of], sight[of])
        n12[of] = 1.0 / planned.body.settings.ior
        absorption[of] = planned.spectrum.absorption.mean()
    normal = optics.face_viewer(normal, -sight)
    refracted, _ = optics.refract_direction(sight, normal, n12[:, None])
    reflected = optics.reflect_direction(sight, normal)
    # One that a steep wave sends down meets the water again, which no technique follows: it does not count.
    upwards = reflected[:, 2] > 0.0
    fresnel = optics.fresnel_dielectric(-np.sum(sight * normal, axis=1), n12)
    return Truth(
        rows,
        columns,
        body,
        surface,
        _ends(caster, surface, refracted),
        _ends(caster, surface, reflected),
        np.where(upwards, fresnel, 0.0),
        absorption,
    )


def _sight(plan: FramePlan, points: np.ndarray) -> np.ndarray:
    """(n, 3) unit directions in which the camera sees points (n, 3)."""
    view = plan.camera.view
    if cameras.is_orthographic(plan.camera.projection):
        return np.broadcast_to(-view[2, :3], points.shape)
    sight = points - cameras.eye_position(view)
    return sight / np.linalg.norm(sight, axis=1, keepdims=True)


def _on_surface(
    planned: BodyPlan, meshes: dict, drawn: np.ndarray, sight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(U, N), (n, 3) each: where the lines of sight through drawn points (n, 3) meet the surface itself."""
    packed, origin = planned.packed_waves, planned.origin
    if planned.body.grid is None:
        return drawn, _mesh_normals(planned, meshes[planned.body.mesh], drawn)
    way = np.zeros(len(drawn))
    for _ in range(NEWTON_STEPS):
        at = drawn + way[:, None] * sight - origin
        height = at[:, 2] - waves.height(packed, at[:, :2])
        descent = sight[:, 2] - np.sum(waves.slope(packed, at[:, :2]) * sight[:, :2], axis=1)
        way = way - height / np.minimum(descent, -1e-3)
    at = drawn + way[:, None] * sight - origin
    # Where it found none, the line of sight touches a crest: what is drawn must do.
    lost = np.abs(at[:, 2] - waves.height(packed, at[:, :2])) > 1e-6
    surface = np.where(lost[:, None], drawn, at + origin)
    return surface, waves.normal(packed, (surface - origin)[:, :2])


def _mesh_normals(planned: BodyPlan, mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """(n, 3) unit normals of a surface that is a mesh raised by waves, at points (n, 3) of it."""
    from mathutils.bvhtree import BVHTree

    slope = waves.slope(planned.packed_waves, (points - planned.origin)[:, :2])
    if mesh.max_slope > 0.0 or np.any(planned.body.matrix[:2, 2] != 0.0):
        turned = planned.body.matrix[:3, :3]
        flat = mesh.positions.astype(np.float64) @ turned.T + planned.origin
        normals = mesh.normals.astype(np.float64) @ np.linalg.inv(turned)
        triangles = np.concatenate([part.triangles for part in mesh.parts])
        tree = BVHTree.FromPolygons(flat.tolist(), triangles.tolist(), all_triangles=True)
        above = float(flat[:, 2].max()) + 1.0
        for i, (x, y) in enumerate(points[:, :2].tolist()):
            at, _, face, _ = tree.ray_cast((x, y, above), (0.0, 0.0, -1.0))
            if at is not None:
                corners = triangles[face]
                up = _weights(flat[corners, :2], np.array([x, y])) @ normals[corners]
                slope[i] -= up[:2] / (np.sign(up[2]) * max(abs(up[2]), 1e-3))
    normal = np.column_stack([-slope, np.ones(len(points))])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _weights(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(3,) barycentric coordinates of a point (2,) in a triangle (3, 2)."""
    of_b, of_c = np.linalg.lstsq((corners[1:] - corners[0]).T, point - corners[0], rcond=None)[0]
    return np.array([1.0 - of_b - of_c, of_b, of_c])


def _ends(caster: RayCaster, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    hits = caster.cast(origin, direction)
    way = np.where(hits.found, hits.distance, np.nan)
    return origin + way[:, None] * direction


def ray_errors(measured: Sequence[tuple[FramePlan, Hits, Truth]], size: tuple[int, int]) -> RayErrors:
    """How far hits passes of plans are off, in a picture of `size` (width, height) pixels.

    Of each pixel: how far off what is refracted is, as far as it makes up the colour, and what is mirrored.
    """
    farthest = FARTHEST * float(np.hypot(*size))
    metres, texels, pixels = [], [], []
    for plan, hits, truth in measured:
        refracted, reflected = (
            picture[truth.rows, truth.columns] for picture in (hits.refracted, hits.reflected)
        )
        for i in np.unique(truth.body):
            mask = truth.body == i
            below = refraction_errors(plan, i, size, refracted, truth.refracted, mask)
            above = reflection_errors(plan, i, size, reflected, truth.reflected, mask)
            metres.append(below.distance[mask])
            texels.append(below.texels[mask])
            ends = np.where(np.isfinite(truth.refracted), truth.refracted, found_points(refracted))
            way = np.linalg.norm(ends - truth.surface, axis=1)
            ends_there = np.isfinite(way)
            left = np.where(ends_there, np.exp(-truth.absorption * np.where(ends_there, way, 0.0)), 0.0)
            off = (
                (1.0 - truth.fresnel) * left * _pixels_off(below.pixels, refracted, truth.refracted, farthest)
            )
            off += truth.fresnel * _pixels_off(above.pixels, reflected, truth.reflected, farthest)
            pixels.append(off[mask])
    metres, texels = (np.concatenate(values) for values in (metres, texels))
    some = np.isfinite(metres)
    return RayErrors(
        float(np.median(metres[some])) if some.any() else float("nan"),
        float(np.median(texels[some])) if some.any() else float("nan"),
        float(np.concatenate(pixels).mean()),
    )


def _pixels_off(pixels: np.ndarray, given: np.ndarray, true: np.ndarray, farthest: float) -> np.ndarray:
    """(n,) with `farthest` where only one of the two is there, and 0 where neither is."""
    exists, found = np.isfinite(true).all(axis=1), given[:, 3] > 0.5
    return np.where(exists & found, np.minimum(pixels, farthest), np.where(exists != found, farthest, 0.0))
