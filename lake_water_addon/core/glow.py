# SPDX-License-Identifier: GPL-3.0-or-later
"""The sun's mirror image in the waves and the star that glows around it.

The float64 twin of `gpu_shaders/glow_lib.glsl` and `glow_star_lib.glsl`, and the plan: whether and where a
highlight can be in the picture. The highlight of the thesis is pow(max(0, R.s), exponent) (1, 1, 0.8), R the
mirrored direction of sight and s the direction to the sun. It is drawn into a small texture, filtered with
the two diagonals of a 7x7 window, and added to the picture.

Texels of the glow are those of a lattice over the whole picture, LONG_SIDE along its longer side, whatever
the picture's resolution and whatever part of it is drawn: so the star is the same in a preview, in the final
picture and in a border render.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import cameras
from .optics import MIN_COSINE
from .settings import FrameSettings
from .snapshot import Camera, Mesh, Sun, WaterBody
from .waves import max_slope

COLOR = (1.0, 1.0, 0.8)
"""Of the highlight, scene-linear."""

REACH = 3
"""Texels from the middle of the star to the end of its arms: a window of 7x7."""

TAPS = 4 * REACH + 1
"""Texels on the window's two diagonals."""

LONG_SIDE = 768
"""Texels of the glow along the longer side of the whole picture."""

MARGIN = REACH + 2
"""Texels beyond the drawn part of the picture whose highlights reach into it: the arms of the star, one for
the interpolation, and one for the shift of antialiasing and the lattice."""

LEAST_VISIBLE = 1.0 / (255.0 * 12.92)
"""Radiance of one step from black in an 8-bit sRGB picture: what adds less is not drawn."""

TILES = 16
"""Parts along each side of the picture that are asked for a highlight."""

Window = tuple[float, float, float, float]

_SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""(8, 3) corners of the cube from -1 to 1."""


def highlight(reflected: np.ndarray, sun: np.ndarray, exponent: float, cut: float) -> np.ndarray:
    """(...,) pow(max(0, R.s), exponent), 0 where it is less than `cut`. R (..., 3), s (3,): unit vectors."""
    lobe = np.clip(reflected @ sun, 1e-30, 1.0) ** exponent
    return np.where(lobe < cut, 0.0, lobe)


def star_filter(highlights: np.ndarray) -> np.ndarray:
    """(h, w) mean of the texels on the two diagonals of the 7x7 window around each; 0 beyond the border."""
    height, width = highlights.shape
    padded = np.pad(highlights, REACH)
    total = np.zeros((height, width))
    for k in range(-REACH, REACH + 1):
        for x in {k, -k}:
            total += padded[REACH + k : REACH + k + height, REACH + x : REACH + x + width]
    return total / TAPS


@dataclass(frozen=True, eq=False)
class MirrorSurface:
    """What a plan has to know about a water surface. corners: (8, 3) of a box around it, in render space;
    slope: the greatest |grad h| that it can have.
    """

    corners: np.ndarray
    slope: float


def mirror_surface(
    body: WaterBody, mesh: Mesh | None, origin: np.ndarray, packed_waves: np.ndarray
) -> MirrorSurface:
    """Of a body with its water frame at `origin` (3,) in render space. mesh: of a body without a grid."""
    rise = np.array([0.0, 0.0, np.abs(packed_waves[:, 2]).sum()])
    slope = max_slope(packed_waves)
    if body.grid is not None:
        _, half_x, half_y, center_x, center_y = body.grid
        box = np.array([center_x, center_y, 0.0]) + _SIGNS * (np.array([half_x, half_y, 0.0]) + rise)
        cos_h, sin_h = math.cos(body.heading), math.sin(body.heading)
        turn = np.array([[cos_h, -sin_h, 0.0], [sin_h, cos_h, 0.0], [0.0, 0.0, 1.0]])
        return MirrorSurface(box @ turn.T + origin, slope)
    low, high = mesh.bounds
    # A wave raises the points of a tilted box, too: the corners of the box around it, raised and lowered.
    tilted = (0.5 * (low + high) + _SIGNS * (0.5 * (high - low))) @ body.matrix[:3, :3].T
    low, high = tilted.min(axis=0), tilted.max(axis=0)
    box = 0.5 * (low + high) + _SIGNS * (0.5 * (high - low) + rise)
    gain = _slope_gain(body.matrix[:3, :3])
    return MirrorSurface(box + origin, slope + (mesh.max_slope * gain if gain else 0.0))


def _slope_gain(matrix: np.ndarray) -> float:
    """How much steeper an object's matrix (3, 3) makes its surface; inf for one that tilts or crushes it."""
    level = np.linalg.svd(matrix[:2, :2], compute_uv=False)
    tilt = max(np.abs(matrix[2, :2]).max(), np.abs(matrix[:2, 2]).max())
    if tilt > 1e-6 * level[0] or level[1] <= 1e-9 * level[0]:
        return math.inf
    return float(abs(matrix[2, 2]) / level[1])


@dataclass(frozen=True, eq=False)
class GlowPlan:
    """Whether the sun's mirror image glows in a picture, and why.

    bodies: which of the water bodies can hold it. cut: least highlight that is drawn. lattice: (2,) texels
    over the whole picture. rectangle: (left, bottom, right, top) texels of the lattice that are drawn, beyond
    the picture's border, too. view, projection: of the whole picture, render space, without the jitter.
    window, jitter: those of `plan_frame`.
    """

    drawn: bool
    reason: str
    bodies: tuple[bool, ...] = ()
    cut: float = 1.0
    lattice: np.ndarray | None = None
    rectangle: tuple[int, int, int, int] = (0, 0, 0, 0)
    view: np.ndarray | None = None
    projection: np.ndarray | None = None
    window: Window = (0.0, 0.0, 1.0, 1.0)
    jitter: tuple[float, float] = (0.0, 0.0)

    @property
    def size(self) -> tuple[int, int]:
        """Texels that are drawn."""
        left, bottom, right, top = self.rectangle
        return right - left, top - bottom

    def shift(self, size: tuple[int, int]) -> np.ndarray:
        """(2,) texels, by which this antialiasing sample moves the lattice's content; size: pixels drawn.

        As large a part of a texel as the jitter is of a pixel: the mean of the samples is that of the
        highlight over each texel, and small glints far away do not twinkle.
        """
        left, bottom, right, top = self.window
        whole = np.array(size) / (right - left, top - bottom)
        return np.clip(0.5 * np.array(self.jitter) * whole, -0.5, 0.5)

    def drawn_projection(self, size: tuple[int, int]) -> np.ndarray:
        """(4, 4) projection whose picture is the rectangle, for a drawn picture of so many pixels."""
        low = (np.array(self.rectangle[:2]) - self.shift(size)) / self.lattice
        high = (np.array(self.rectangle[2:]) - self.shift(size)) / self.lattice
        return cameras.crop(self.projection, *low, *high)

    def to_texels(self, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """(scale, offset), (2,) each: from 0..1 in the drawn picture to texels of the rectangle."""
        low, high = np.array(self.window[:2]), np.array(self.window[2:])
        scale = (high - low) * self.lattice
        offset = (low - 0.5 * np.array(self.jitter)) * self.lattice + self.shift(size) - self.rectangle[:2]
        return scale, offset

    def pixels(self, size: tuple[int, int]) -> tuple[int, int, int, int]:
        """(left, bottom, width, height) of the pixels that the star can reach; size: of the drawn picture."""
        scale, offset = self.to_texels(size)
        low = np.floor(-offset / scale * size).astype(int).clip(0, size)
        high = np.ceil((np.array(self.size) - offset) / scale * size).astype(int).clip(low, size)
        return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def plan_glow(
    sun: Sun | None,
    camera: Camera,
    surfaces: Sequence[MirrorSurface | None],
    settings: FrameSettings,
    *,
    window: Window = (0.0, 0.0, 1.0, 1.0),
    jitter: tuple[float, float] = (0.0, 0.0),
) -> GlowPlan:
    """Plan the glow of one picture.

    camera: of the whole picture, render space, without the jitter; window, jitter: those of `plan_frame`.
    surfaces: of the water bodies; None for one that is not seen from the air. Where it says "not drawn",
    no water in the picture has a highlight of `LEAST_VISIBLE` / strength; what is weaker is never drawn.
    """
    if not settings.use_glow or settings.glow_strength <= 0.0:
        return GlowPlan(False, "switched off")
    if sun is None or not np.any(sun.irradiance > 0.0):
        return GlowPlan(False, "there is no sun")
    if sun.direction[2] <= 0.0:
        return GlowPlan(False, "the sun is below the horizon")
    if not any(surface is not None for surface in surfaces):
        return GlowPlan(False, "no water is seen from the air")
    cut = max(settings.glow_threshold, LEAST_VISIBLE / settings.glow_strength)
    if cut >= 1.0:
        return GlowPlan(False, "its strength or its threshold leaves nothing to see")
    # The lobe is a cone of directions around s; as a chord of the unit sphere.
    lobe = math.sqrt(2.0 * (1.0 - cut ** (1.0 / settings.glow_exponent)))
    lattice = _lattice(camera.projection)
    border = MARGIN / lattice
    low, high = np.array(window[:2]) - border, np.array(window[2:]) + border
    found = [
        None if surface is None else _mirror_window(sun.direction, camera, surface, lobe, low, high)
        for surface in surfaces
    ]
    bodies = tuple(part is not None for part in found)
    if not any(bodies):
        return GlowPlan(False, "the waves in the picture cannot mirror the sun into it")
    low = np.min([part[0] for part in found if part is not None], axis=0)
    high = np.max([part[1] for part in found if part is not None], axis=0)
    # The star's arms, and one dark texel around them that the interpolation reads.
    first = np.maximum(
        np.floor(low * lattice - 0.5) - REACH - 1, np.floor(np.array(window[:2]) * lattice) - MARGIN
    )
    last = np.minimum(
        np.floor(high * lattice + 0.5) + REACH + 2, np.ceil(np.array(window[2:]) * lattice) + MARGIN
    )
    return GlowPlan(
        True,
        "the waves in the picture can mirror the sun into it",
        bodies,
        cut,
        lattice,
        (int(first[0]), int(first[1]), int(last[0]), int(last[1])),
        camera.view,
        camera.projection,
        window,
        jitter,
    )


def _lattice(projection: np.ndarray) -> np.ndarray:
    """(2,) texels over the whole picture: LONG_SIDE along the longer side, and as large along the other.

    By the lens, so that the star is upright in the picture that is shown, also where pixels are not square.
    """
    sides = 1.0 / np.linalg.norm(projection[:2, :2], axis=1)
    return LONG_SIDE * sides / sides.max()


def _mirror_window(
    sun: np.ndarray, camera: Camera, surface: MirrorSurface, lobe: float, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners (2,) of the part of [low, high] (0..1 in the picture) where the surface may mirror the sun.

    None where it cannot. lobe: chord of the directions around the sun that count.

    A direction of sight I is mirrored into R by the normal along R - I. Its slope is at most S, so R - I lies
    in a cone around +z, of angle b = atan S to the axis. R is within the lobe's chord of s: so s - I is
    within it of that cone, |(s - I).xy| cos b - (s - I).z sin b <= lobe. The left side changes by no more
    than I does: its value in the middle of a tile bounds it on all of the tile.
    """
    seen = _box_window(camera, surface.corners, low, high)
    if seen is None:
        return None
    low, high = seen
    angle = math.atan(surface.slope)

    def beyond(direction: np.ndarray) -> np.ndarray:
        half = sun - direction
        level = np.hypot(half[..., 0], half[..., 1])
        return level * math.cos(angle) - half[..., 2] * math.sin(angle)

    # A normal that faces away is turned to the eye, and MIN_COSINE further than to the edge.
    lobe = lobe + 2.0 * MIN_COSINE
    if cameras.is_orthographic(camera.projection):
        return (low, high) if beyond(-camera.view[2, :3]) <= lobe else None

    x, y = (np.linspace(low[i], high[i], TILES + 1) for i in (0, 1))
    corners = _directions(camera, x, y)
    middle = corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:] + corners[1:, 1:]
    middle /= np.sqrt(np.einsum("ijk,ijk->ij", middle, middle))[..., None]
    radius = _tile_radius(corners, middle)
    least, most = _heights_of_sight(cameras.eye_position(camera.view), surface.corners)
    found = (
        (beyond(middle) <= lobe + radius)
        & (middle[..., 2] - radius <= most)
        & (middle[..., 2] + radius >= least)
    )
    rows, columns = np.nonzero(found.any(axis=1))[0], np.nonzero(found.any(axis=0))[0]
    if len(rows) == 0:
        return None
    return np.array([x[columns[0]], y[rows[0]]]), np.array([x[columns[-1] + 1], y[rows[-1] + 1]])


def _box_window(
    camera: Camera, corners: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """The part of [low, high] in which the box is seen; all of it when the box reaches behind the camera."""
    clip = cameras.to_clip(camera.projection @ camera.view, corners)
    if clip[:, 3].max() <= cameras.MIN_W:
        return None
    if clip[:, 3].min() <= cameras.MIN_W:
        return low, high
    at = 0.5 * clip[:, :2] / clip[:, 3:] + 0.5
    low, high = np.maximum(low, at.min(axis=0)), np.minimum(high, at.max(axis=0))
    return (low, high) if np.all(low < high) else None


def _directions(camera: Camera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(len(y), len(x), 3) unit directions of sight of a perspective camera at x, y in its picture, 0..1."""
    to_world = np.linalg.inv(camera.projection)[:3].T @ camera.view[:3, :3]
    right, up, rest = to_world[0], to_world[1], to_world[2] + to_world[3]
    world = (2.0 * x - 1.0)[:, None] * right + ((2.0 * y - 1.0)[:, None] * up + rest)[:, None]
    return world / np.sqrt(np.einsum("ijk,ijk->ij", world, world))[..., None]


def _tile_radius(corners: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """(n, m) greatest chord from the middle (n, m, 3) of each tile to its corners, of (n + 1, m + 1, 3)."""
    cosine = np.min(
        [
            np.einsum("ijk,ijk->ij", corners[i : i + len(middle), j : j + middle.shape[1]], middle)
            for i in (0, 1)
            for j in (0, 1)
        ],
        axis=0,
    )
    return np.sqrt(np.maximum(2.0 - 2.0 * cosine, 0.0))


def _heights_of_sight(eye: np.ndarray, corners: np.ndarray) -> tuple[float, float]:
    """Least and greatest z of the unit directions from `eye` (3,) to points of a box with these corners."""
    lowest, highest = corners[:, 2].min() - eye[2], corners[:, 2].max() - eye[2]
    least, most = corners[:, :2].min(axis=0) - eye[:2], corners[:, :2].max(axis=0) - eye[:2]
    near = float(np.hypot(*np.maximum(np.maximum(least, -most), 0.0)))
    far = float(np.linalg.norm(corners[:, :2] - eye[:2], axis=1).max())

    def z(height: float, distance: float) -> float:
        length = math.hypot(height, distance)
        return height / length if length > 0.0 else math.copysign(1.0, height)

    return z(lowest, near if lowest < 0.0 else far), z(highest, far if highest < 0.0 else near)
