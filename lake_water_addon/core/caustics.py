# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons of sunlight through the waves, and their sum, which the method CPU takes here.

The twin of `sun_run_lib.glsl`, `photon_lib.glsl`, `caustics_lib.glsl`, `coverage_lib.glsl`.

A photon is launched where a ray of the sun meets the water plane, one a texel of the light camera's
window (`light`), so that all carry the same flux. At the waves it is refracted, and the intersection
algorithm (`intersection`) finds where it lands. Its light is spread around that place as wide as
neighbouring photons lie apart: for each axis of the window, by a tent whose half width is

    spread = sqrt((du/dx)^2 + (du/dy)^2),

u the place of landing along that axis, x and y those of launching. Under a calm surface it is the
distance of the photons, whose tents then add up to 1 everywhere: the sum is (1 - F) exp(-k d), whatever
the resolutions. The derivatives are those of the refracted ray at the length that it has: they follow
from slope and curvature of the waves, so that no edge of the bottom disturbs them.

What is summed is divided by the sum that a calm surface would give with just those photons that were
launched from water: 1 but for the texels at a shore, and at the window's border (`resolved`).

Points and directions are in render space (see `plan`); `uv` are coordinates in the window, 0..1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from . import cameras, optics
from .intersection import intersect
from .light import LightCamera

MAX_RUN = 3.0
"""m along the plane for each m of height: the rays of a sun lower than 18 degrees meet the waves at 18.

Only crests are in lower light, and a grid that is coarser than the waves cannot tell which: it gives noise.
"""

MAX_TURN = 0.25
"""Most by which the search for the surface changes the slope of the waves."""

MAX_RAISE = 2.0
"""Most that the search's last step may be, as a multiple of the height that is missing."""

MIN_FACING = 0.1
"""Least part of a sunbeam's width that a surface's own is compared with, where it turns from the sun."""

DEPTH_JUMP = 8.0
"""Between neighbouring texels, in their own size: what is deeper is an edge and not interpolated across."""

NOTHING = 5e4
"""m: from this distance on there is no bottom."""

MIN_DESCENT = 0.05
"""Least cosine between a refracted ray and the light below a calm surface: others never come down."""

MIN_SPREAD = 0.25
"""Texels: least half width over which a photon's light is spread."""

MAX_SPREAD = 8.0
"""Texels: greatest half width, or the distance of the photons where that is more."""

MIN_COVERAGE = 0.45
"""Least part of a texel that is covered by water, for what falls there to be scaled to all of it."""

CHUNK = 1 << 17
"""Photons that the processor sums at a time."""

BATCH = 1 << 20
"""Texels of their tents that it adds at a time; 16 bytes each."""


class WavesAt(NamedTuple):
    """height (n,), slope (n, 2) = (h_x, h_y), curvature (n, 3) = (h_xx, h_xy, h_yy) of the waves."""

    height: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


class WaterPoint(NamedTuple):
    """A point (n, 3) of the surface, its slope (n, 2) and the curvature (n, 3) of the waves there."""

    position: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


class Photon(NamedTuple):
    """landing (n, 2), spread (n, 2): uv; light (n,): what arrives of the flux; landed (n,): in the window."""

    landing: np.ndarray
    spread: np.ndarray
    light: np.ndarray
    landed: np.ndarray


@dataclass(frozen=True, eq=False)
class PhotonScene:
    """What a photon meets. depth: (r, r) the bottom's distance along the light, first row at the bottom.

    photons: their number along a side; steps: of the intersection algorithm, beyond looking straight down.
    """

    sun_direction: np.ndarray
    camera: LightCamera
    depth: np.ndarray
    origin: np.ndarray
    packed_waves: np.ndarray
    k: float
    q: float
    n12: float
    photons: int
    steps: int


def waves_at(packed: np.ndarray, xy: np.ndarray) -> WavesAt:
    """The waves and their derivatives at points (n, 2), from `waves.pack`'s rows."""
    angle = xy @ packed[:, :2].T + packed[:, 3]
    sine, cosine = np.sin(angle) * packed[:, 2], np.cos(angle) * packed[:, 2]
    kx, ky = packed[:, 0], packed[:, 1]
    curvature = -(sine @ np.stack([kx * kx, kx * ky, ky * ky], axis=1))
    return WavesAt(sine.sum(axis=1), cosine @ packed[:, :2], curvature)


def bend(curvature: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(n, 2) change of the slope over a step (n, 2): the symmetric matrix of `curvature` times it."""
    xx, xy, yy = curvature.T
    return np.stack([xx * step[:, 0] + xy * step[:, 1], xy * step[:, 0] + yy * step[:, 1]], axis=1)


def sun_run(sun_direction: np.ndarray) -> np.ndarray:
    """(3,) way along a ray of the sun for each metre of height."""
    level = sun_direction[:2]
    return np.append(level / max(sun_direction[2], np.linalg.norm(level) / MAX_RUN), 1.0)


def on_waves(
    point: np.ndarray,
    wave: np.ndarray,
    mesh_slope: np.ndarray,
    origin: np.ndarray,
    packed: np.ndarray,
    run: np.ndarray,
) -> WaterPoint:
    """The surface on the sun's ray through `point` (n, 3), a point between the vertices of its mesh.

    wave: (n,) height of the waves there, mesh_slope: (n, 2) slope without them, both as interpolated. The
    grid may be coarser than the waves; on the true surface no edge of a triangle shows in the caustics.
    A fixed-point step and one of Newton's; origin: (3,) of the waves; run: `sun_run`.
    """
    length = np.linalg.norm(run[:2])
    raised = (waves_at(packed, point[:, :2] - origin[:2]).height - wave) / max(1.0, length)
    point, wave = point + raised[:, None] * run, wave + raised
    at = waves_at(packed, point[:, :2] - origin[:2])
    facing = 1.0 - (mesh_slope + at.slope) @ run[:2]
    raised = (at.height - wave) / np.maximum(facing, 1.0 / MAX_RAISE)
    turn = bend(at.curvature, raised[:, None] * run[:2])
    scale = np.minimum(1.0, MAX_TURN / np.maximum(np.linalg.norm(turn, axis=1), 1e-9))[:, None]
    position = point + scale * raised[:, None] * run
    return WaterPoint(position, mesh_slope + at.slope + scale * turn, at.curvature)


def bottom_depth(depth: np.ndarray, uv: np.ndarray, texel: float) -> np.ndarray:
    """(n,) distance along the light at uv (n, 2), bilinear: exact for a plane, however it lies to the light.

    depth: (r, r); texel: its size in m. Across an edge, the nearest texel's; beyond the window, its border's.
    """
    size = len(depth)
    at = np.clip(uv, 0.0, 1.0) * size - 0.5
    low = np.clip(np.floor(at), 0, size - 2).astype(int)
    part = at - low
    x, y = low.T
    z = np.stack([depth[y, x], depth[y, x + 1], depth[y + 1, x], depth[y + 1, x + 1]])
    edge = z.max(axis=0) - z.min(axis=0) > DEPTH_JUMP * texel
    part = np.where(edge[:, None], np.floor(np.clip(part, 0.0, 1.0) + 0.5), part)
    lower, upper = z[0] + part[:, 0] * (z[1] - z[0]), z[2] + part[:, 0] * (z[3] - z[2])
    return lower + part[:, 1] * (upper - lower)


def is_water(point: np.ndarray, scene: PhotonScene) -> np.ndarray:
    """(n,) whether points (n, 3) of the surface are water over a bottom, and not under dry ground."""
    at = point @ scene.camera.view[:3, :3].T + scene.camera.view[:3, 3]
    uv = cameras.to_texture(scene.camera.projection, at)
    below = bottom_depth(scene.depth, uv, float(scene.camera.texel.max()))
    return (below >= -at[:, 2]) & (below < NOTHING)


def launch_step(camera: LightCamera, axis: int, photons: int) -> np.ndarray:
    """(3,) in m: from one launching place on the water plane to the next along the window's x or y."""
    sideways = camera.view[axis, :3]
    level = sideways - camera.direction * (sideways[2] / camera.direction[2])
    return level * (2.0 / (camera.projection[axis, axis] * photons))


def ray_spread(
    point: WaterPoint, mesh_turn: np.ndarray, way: np.ndarray, step: np.ndarray, scene: PhotonScene
) -> np.ndarray:
    """(n, 3) in m: how far apart two photons are after `way` (n,) m of water, launched a `step` (3,) apart.

    mesh_turn: (n, 2) change of the mesh's own slope over the step. In world axes, less the step itself.
    """
    run, to_sun, n12 = sun_run(scene.sun_direction), scene.sun_direction, scene.n12
    slope = point.slope
    steepness = np.sqrt(1.0 + np.sum(slope * slope, axis=1))[:, None]
    normal = np.concatenate([-slope, np.ones((len(slope), 1))], axis=1) / steepness
    rise = slope @ step[:2] / np.maximum(1.0 - slope @ run[:2], MIN_FACING)
    turn = bend(point.curvature, step[:2] + rise[:, None] * run[:2]) + mesh_turn
    tilt = np.concatenate([-turn, np.zeros((len(slope), 1))], axis=1)
    tilt = (tilt - normal * np.sum(normal * tilt, axis=1, keepdims=True)) / steepness
    cosine = -(normal @ to_sun)[:, None]
    root = np.sqrt(np.maximum(1.0 - n12 * n12 * (1.0 - cosine * cosine), 1e-6))
    change = -n12 * (tilt @ to_sun)[:, None] * (1.0 + n12 * cosine / root)
    bent = -(change * normal + (n12 * cosine + root) * tilt)
    return rise[:, None] * run + way[:, None] * bent


def photon(point: WaterPoint, mesh_turn: np.ndarray, launch: np.ndarray, scene: PhotonScene) -> Photon:
    """Photons that meet the surface at `point`, launched at `launch` (n, 2) in the window.

    mesh_turn: (n, 2, 2), [:, i] the change of the mesh's own slope from one photon to the next along axis i.
    """
    camera, run = scene.camera, sun_run(scene.sun_direction)
    rotation, projection = camera.view[:3, :3], camera.projection
    normal = np.concatenate([-point.slope, np.ones((len(launch), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    incident = np.broadcast_to(-scene.sun_direction, normal.shape)
    refracted, _ = optics.refract_direction(incident, normal, scene.n12)
    at = point.position @ rotation.T + camera.view[:3, 3]
    direction = refracted @ rotation.T

    def depth_at(uv):
        return bottom_depth(scene.depth, uv, float(camera.texel.max()))

    found = intersect(at, direction, depth_at, projection, scene.steps)
    way = np.sum((found.hit - at) * direction, axis=1)
    scale = 0.5 * np.diag(projection)[:2]
    height = point.position[:, 2] - scene.origin[2]
    moved = height[:, None] * (rotation @ run)[:2] + way[:, None] * direction[:, :2]
    landing = launch + scale * moved

    squares = np.zeros_like(landing)
    for axis in (0, 1):
        step = launch_step(camera, axis, scene.photons)
        apart = ray_spread(point, mesh_turn[:, axis], way, step, scene) @ rotation.T
        apart = scale * apart[:, :2]
        apart[:, axis] += 1.0 / scene.photons
        squares += apart**2

    facing = normal @ scene.sun_direction
    fresnel = optics.schlick(facing, optics.reflectance_at_normal(scene.n12), scene.q)
    light = (1.0 - fresnel) * optics.attenuation(scene.k, np.linalg.norm(found.bottom - at, axis=1))
    landed = (direction[:, 2] < -MIN_DESCENT) & (found.bottom[:, 2] > -NOTHING)
    landed &= np.all((landing >= 0.0) & (landing < 1.0), axis=1)
    return Photon(landing, np.sqrt(squares), light, landed)


def tent_spread(spread: np.ndarray, size: int, spacing: float) -> np.ndarray:
    """Half widths in texels of the tents of photons with these spreads in uv.

    spacing: texels from photon to photon under a calm surface, which the limits leave alone.
    """
    return np.clip(spread * size, min(MIN_SPREAD, spacing), max(MAX_SPREAD, spacing))


def tent_before(z: np.ndarray) -> np.ndarray:
    """Part of a tent over [-1, 1] that lies before z: 1/2 + z - z |z| / 2."""
    z = np.clip(z, -1.0, 1.0)
    return 0.5 + z * (1.0 - 0.5 * np.abs(z))


def tent_part(texel: np.ndarray, center: np.ndarray, half_width: np.ndarray) -> np.ndarray:
    """Part of a tent about `center` that lies in texel number `texel`, all in texels."""
    return tent_before((texel + 1.0 - center) / half_width) - tent_before((texel - center) / half_width)


def border_coverage(texel: np.ndarray, size: int, spacing: float) -> np.ndarray:
    """Coverage of texels, in one axis, when all photons are launched from water.

    1 but for what tents from beyond the border would add: as wide as the photons lie apart, one on each side.
    """
    from_left, from_right = (tent_part(i, -0.5 * spacing, spacing) for i in (texel, size - 1.0 - texel))
    return 1.0 - spacing * (from_left + from_right)


def coverage(wet: np.ndarray, size: int) -> np.ndarray:
    """(size, size) sums that photons launched from water, (p, p), with light 1 give under a calm surface.

    A tent is then as wide as the photons lie apart.
    """
    spacing = size / len(wet)
    centers = (np.arange(len(wet)) + 0.5) * spacing
    parts = spacing * tent_part(np.arange(size)[:, None], centers, spacing)
    return parts @ wet @ parts.T


def whole_coverage(size: int, spacing: float) -> np.ndarray:
    """(size, size) coverage when all photons are launched from water."""
    border = border_coverage(np.arange(size), size, spacing)
    return border[:, None] * border


def resolved(sums: np.ndarray, wet: np.ndarray) -> np.ndarray:
    """(size, size) the caustics from sums (size, size) of photons launched where `wet` (p, p) is.

    Light is scaled to the part of a texel that water covers. A texel that it hardly covers takes the mean of
    those one photon away that it covers, if any: a filtered lookup at the shore finds no dark one.
    """
    size, spacing = len(sums), len(sums) / len(wet)
    covered = coverage(wet.astype(np.float64), size)
    known = covered >= MIN_COVERAGE * whole_coverage(size, spacing)
    light, weight = np.zeros((size, size)), np.zeros((size, size))
    y, x = np.mgrid[:size, :size]
    for dx, dy in neighbors(spacing):
        at = np.clip(y + dy, 0, size - 1), np.clip(x + dx, 0, size - 1)
        light += np.where(known[at], sums[at], 0.0)
        weight += np.where(known[at], covered[at], 0.0)
    filled = light / np.where(weight > 0.0, weight, 1.0)
    return np.where(known, sums / np.where(known, covered, 1.0), filled)


def neighbors(spacing: float) -> list[tuple[int, int]]:
    """Steps in texels to those one photon away."""
    step = int(np.ceil(spacing))
    return [(-step, 0), (step, 0), (0, -step), (0, step)]


def shore_margin(spacing: float) -> int:
    """How many photons away from a texel's own one it may depend on whether they are launched from water.

    That is so for `resolved`: one photon's tent and half a texel, from this texel and those one photon away.
    """
    return int(np.ceil((np.ceil(spacing) + 0.5) / spacing + 1.5))


def sum_photons(photon_map: np.ndarray, spread_map: np.ndarray, size: int) -> np.ndarray:
    """(size, size) float32 sums of a photon map's light, relative to the sun's on the water plane.

    photon_map: (p, p, 4) landing x, y in uv, light, 1 where it landed; spread_map: (p, p, 2) in uv, 0
    without water; float32, as the photon shader writes them. What of a tent lies outside the window is lost.
    """
    spacing = size / len(photon_map)
    found, spread = photon_map.reshape(-1, 4), spread_map.reshape(-1, 2)
    lit = np.flatnonzero((found[:, 3] > 0.5) & (found[:, 2] > 0.0))
    total = np.zeros((size, size))
    for start in range(0, len(lit), CHUNK):
        chosen = lit[start : start + CHUNK]
        center = np.stack([found[chosen, axis] for axis in (0, 1)]) * size
        half_width = tent_spread(np.stack([spread[chosen, axis] for axis in (0, 1)]), size, spacing)
        _add_tents(total, center, half_width, found[chosen, 2] * spacing**2)
    return total.astype(np.float32)


def _add_tents(total: np.ndarray, center: np.ndarray, half_width: np.ndarray, amount: np.ndarray) -> None:
    """Add tents of `amount` (n,) about `center` (2, n), with half widths (2, n), in texels.

    Sorted by the number of texels that they reach along x and y, so that many are a few operations on whole
    arrays. A chunk of neighbouring photons falls into few rows of texels, which stay in a cache.
    """
    size = len(total)
    first = np.floor(center - half_width)
    reach = (np.floor(center + half_width) - first).astype(np.int32) + 1
    pad, low = int(reach.max()), int(first[1].min())
    width, height = size + 2 * pad, int(first[1].max()) - low + pad
    kind = reach[0] * (pad + 1) + reach[1]
    order = np.argsort(kind.astype(np.int16) if pad < 150 else kind, kind="stable")  # 16 bits sort fastest
    column, row = first.astype(np.int64)
    place = ((row - low) * width + (column + pad))[order]
    scale = 1.0 / half_width
    begin = ((first - center) * scale)[:, order]
    scale, amount = scale[:, order], amount[order]

    added = np.zeros(height * width)
    room = max(BATCH, pad * pad)
    places, amounts = np.empty(room, np.int64), np.empty(room)
    photon = entry = 0
    kinds = np.bincount(kind)
    for of_kind in np.flatnonzero(kinds).tolist():
        along_x, along_y = divmod(of_kind, pad + 1)
        steps = np.arange(along_y)[:, None] * width + np.arange(along_x)
        end = photon + int(kinds[of_kind])
        while photon < end:
            if entry + steps.size > room:
                added += np.bincount(places[:entry], amounts[:entry], len(added))
                entry = 0
            these = slice(photon, min(end, photon + (room - entry) // steps.size))
            shape = (*steps.shape, these.stop - these.start)
            here = slice(entry, entry + math.prod(shape))
            x = _tent_parts(begin[0, these], scale[0, these], along_x)
            y = _tent_parts(begin[1, these], scale[1, these], along_y) * amount[these]
            np.multiply(y[:, None], x, out=amounts[here].reshape(shape))
            np.add(place[these], steps[..., None], out=places[here].reshape(shape))
            photon, entry = these.stop, here.stop
    added += np.bincount(places[:entry], amounts[:entry], len(added))
    added = added.reshape(height, width)[:, pad : pad + size]
    total[max(low, 0) : low + height] += added[max(-low, 0) : size - low]


def _tent_parts(begin: np.ndarray, scale: np.ndarray, count: int) -> np.ndarray:
    """(count, n) parts of n tents in `count` texels; the first begins at `begin`, and one is `scale` wide."""
    edges = np.arange(count + 1, dtype=begin.dtype)[:, None]
    before = tent_before(begin + edges * scale)
    return before[1:] - before[:-1]
