# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground: basin, shelf, shore, meadow and the hills on the horizon.

Heights are relative to the lake's level, horizontal coordinates to its centre, in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .geometry import Geometry, grid_faces
from .noise import GradientNoise, smoothstep, tile_cells, tile_noise

PAINTED_HALF_SIZE = 36.0  # m, the square around the centre that the painted ground image covers
PAINTED_RADIUS = 35.0  # m, faces inside use that image, faces outside the one of the hills
OUTER_RADIUS = 900.0  # m
_BEACH_RADIUS = 21.5  # m, the lake and its beach lie inside
_HILLS_RADIUS = 70.0  # m, where the land begins to rise

# Depth of the basin's profile over the distance from the shore: a wide shelf, then the drop.
_PROFILE_DISTANCE = np.array([0.0, 0.8, 2.0, 3.5, 5.0, 6.5, 8.0, 9.5, 11.5, 14.0, 18.0, 60.0])
_PROFILE_DEPTH = np.array([0.0, 0.17, 0.45, 0.78, 1.08, 1.50, 2.30, 3.30, 4.35, 4.85, 5.0, 5.0])
# Height of the land over the distance from the shore.
_LAND_DISTANCE = np.array([0.0, 0.5, 1.5, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0, 80.0, 900.0])
_LAND_HEIGHT = np.array([0.0, 0.12, 0.33, 0.47, 0.55, 0.66, 0.95, 1.7, 3.6, 6.5, 16.0])

SAND = np.array([0.40, 0.325, 0.205])
WET_SAND = np.array([0.24, 0.185, 0.115])
SILT = np.array([0.20, 0.185, 0.105])
MUD = np.array([0.085, 0.082, 0.048])
SOIL = np.array([0.155, 0.105, 0.06])
GRASS = np.array([0.115, 0.165, 0.032])
DRY_GRASS = np.array([0.27, 0.245, 0.085])
LUSH_GRASS = np.array([0.065, 0.125, 0.022])
ROCK = np.array([0.24, 0.225, 0.20])
FOREST = np.array([0.042, 0.075, 0.024])
HAZE = np.array([0.41, 0.50, 0.58])


def _hermite(x: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
    """Cubic interpolation that keeps the knots' monotony (Fritsch and Carlson 1980, harmonic-mean slopes)."""
    h = np.diff(xs)
    d = np.diff(ys) / h
    both = d[:-1] * d[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(both > 0.0, 2.0 * both / (d[:-1] + d[1:]), 0.0)
    slope = np.concatenate([[d[0]], inner, [d[-1]]])
    x = np.clip(x, xs[0], xs[-1])
    i = np.clip(np.searchsorted(xs, x, side="right") - 1, 0, len(xs) - 2)
    t = (x - xs[i]) / h[i]
    t2, t3 = t * t, t * t * t
    return (
        (2 * t3 - 3 * t2 + 1) * ys[i]
        + (t3 - 2 * t2 + t) * h[i] * slope[i]
        + (3 * t2 - 2 * t3) * ys[i + 1]
        + (t3 - t2) * h[i] * slope[i + 1]
    )


@dataclass(frozen=True)
class Terrace:
    """Bathing steps that lead from the bank down to a tiled floor under water.

    Local frame: `origin` on the shoreline, `inward` (unit, towards the lake), `side` (unit, to its left).
    """

    origin: tuple[float, float]
    inward: tuple[float, float]
    floor_depth: float = 1.25
    tread: float = 0.36
    rise: float = 0.175
    steps: int = 9
    start: float = -1.0  # m along `inward` of the top step's outer edge
    top: float = 0.325  # m, height of the top step
    floor_length: float = 4.4
    half_width: float = 2.2

    @property
    def side(self) -> tuple[float, float]:
        return -self.inward[1], self.inward[0]

    @property
    def floor_start(self) -> float:
        return self.start + self.tread * self.steps

    @property
    def floor_center(self) -> tuple[float, float]:
        along = self.floor_start + 0.5 * self.floor_length
        return self.origin[0] + along * self.inward[0], self.origin[1] + along * self.inward[1]

    def local(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(along, across) of (..., 2) points."""
        d = points - np.asarray(self.origin)
        return d @ np.asarray(self.inward), d @ np.asarray(self.side)


class LakeTerrain:
    """The shape of the ground as functions of the place.

    seed: of the outline, the relief and the paint. islet: (x, y) of the rocky islet.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.noise = GradientNoise(seed)
        rng = np.random.default_rng([seed, 1])
        # Low harmonics give bays and points; the amplitudes keep the radius between about 14 and 19.5 m.
        self._harmonics = [
            (n, a * rng.uniform(0.75, 1.15), rng.uniform(0.0, 2.0 * np.pi))
            for n, a in ((2, 1.15), (3, 0.85), (4, 0.45), (5, 0.4), (7, 0.2))
        ]
        self.islet = (5.2 + rng.uniform(-0.5, 0.5), 4.6 + rng.uniform(-0.5, 0.5))
        theta = np.radians(-75.0)
        r = self.shore_radius(theta)
        outward = (float(np.cos(theta)), float(np.sin(theta)))
        self.terrace = Terrace((r * outward[0], r * outward[1]), (-outward[0], -outward[1]))

    def shore_radius(self, theta: np.ndarray | float) -> float:
        """Metres from the centre to the shoreline in direction theta, without its small irregularities."""
        r = 17.0
        for n, a, phase in self._harmonics:
            r = r + a * np.cos(n * theta + phase)
        return r

    def shore_distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance from the shoreline, about in metres, of (..., 2) points: negative in the lake."""
        points = np.asarray(points, dtype=np.float64)
        r = np.hypot(points[..., 0], points[..., 1])
        s = r - self.shore_radius(np.arctan2(points[..., 1], points[..., 0]))
        near = np.exp(-((s / 6.0) ** 2))
        return s + near * (0.55 * self.noise.fbm(points * 0.31, 2) + 0.16 * self.noise(points * 1.3 + 40.0))

    def height(self, points: np.ndarray) -> np.ndarray:
        """Height in m of the ground at (..., 2) points."""
        points = np.asarray(points, dtype=np.float64)
        r = np.hypot(points[..., 0], points[..., 1])
        s = self.shore_distance(points)
        depth = _hermite(-s, _PROFILE_DISTANCE, _PROFILE_DEPTH)
        land = _hermite(s, _LAND_DISTANCE, _LAND_HEIGHT)
        rough = self.noise.fbm(points * 0.22 + 7.0, 4)
        fine = self.noise.fbm(points * 0.9 + 3.0, 3)
        # Relief in proportion to the distance from z = 0 leaves the shoreline where it is.
        bed = -depth + np.minimum(0.16 * depth, 0.35) * rough + np.minimum(0.10 * depth, 0.06) * fine
        bank = land + np.minimum(0.30 * land, 0.9) * rough + np.minimum(0.12 * land, 0.05) * fine
        h = np.where(s < 0.0, bed, bank)
        if np.max(r) > _HILLS_RADIUS:
            h = h + self._hills(points, r)
        h = self._with_islet(points, h)
        return self._with_terrace(points, h)

    def _hills(self, points: np.ndarray, r: np.ndarray) -> np.ndarray:
        ridges = self.noise.ridged(points / 260.0 + 5.0, 5)
        hills = 12.0 + 95.0 * np.maximum(ridges - 0.45, 0.0) + 4.0 * self.noise.fbm(points / 45.0, 3)
        # The last ring is the crest of the last ridge: from the lake nothing is seen behind it.
        return smoothstep(_HILLS_RADIUS, 420.0, r) * hills + 38.0 * smoothstep(480.0, OUTER_RADIUS, r)

    def _with_islet(self, points: np.ndarray, h: np.ndarray) -> np.ndarray:
        d = points - np.asarray(self.islet)
        q = np.hypot(d[..., 0] * 0.8, d[..., 1]) * (1.0 + 0.12 * self.noise(points * 0.8 + 90.0))
        crown = (
            0.55 - 0.42 * q - 0.13 * np.maximum(q - 1.0, 0.0) ** 1.3 + 0.05 * self.noise.fbm(points * 1.7, 3)
        )
        return np.where(q < 7.0, np.maximum(h, crown), h)

    def _with_terrace(self, points: np.ndarray, h: np.ndarray) -> np.ndarray:
        t = self.terrace
        along, across = t.local(points)
        line = t.top - t.rise * np.clip((along - t.start) / t.tread, 0.0, t.steps) - 0.16
        line = np.maximum(line, -t.floor_depth - 0.12)
        end = t.floor_start + t.floor_length
        weight = (
            smoothstep(t.start - 0.9, t.start - 0.1, along)
            * smoothstep(end + 1.4, end - 0.1, along)
            * smoothstep(t.half_width + 1.3, t.half_width + 0.1, np.abs(across))
        )
        # Lift deep ground gently to the floor, cut high ground down below the steps.
        return h + weight * (line - h)

    def gradient(self, points: np.ndarray, step: float = 0.5) -> np.ndarray:
        """(..., 2) central differences of the height, rise over run, at (..., 2) points."""
        points = np.asarray(points, dtype=np.float64)[..., None, :]
        h = self.height(points + step * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]))
        return np.stack([h[..., 0] - h[..., 1], h[..., 2] - h[..., 3]], axis=-1) / (2.0 * step)

    def clearing(self, points: np.ndarray) -> np.ndarray:
        """Where the hills carry meadows (high, about 0.3 and more) instead of woods, at (..., 2) points."""
        return self.noise.fbm(points / 75.0 + 31.0, 3)

    def color(
        self, points: np.ndarray, height: np.ndarray, patches: np.ndarray, mottle: np.ndarray
    ) -> np.ndarray:
        """Base colour (..., 3), scene-linear, without the finest detail.

        patches: smooth noise of a few metres; mottle: noise of a few decimetres; both about -1..1.
        """
        s = self.shore_distance(points)
        depth = -height
        m = mottle[..., None]
        p = patches[..., None]
        meadow = _mix(GRASS, DRY_GRASS, smoothstep(0.1, 1.0, patches + 0.35 * mottle))
        meadow = _mix(meadow, LUSH_GRASS, smoothstep(0.0, -0.9, patches + 0.3 * mottle))
        meadow = _mix(meadow, SOIL, 0.55 * smoothstep(0.75, 1.3, mottle - 0.4 * patches))
        meadow = meadow * (1.0 + 0.16 * m)
        beach = SAND * (1.0 + 0.10 * m + 0.08 * p)
        wet = _mix(WET_SAND * (1.0 + 0.12 * m), beach, smoothstep(0.03, 0.16, height + 0.03 * mottle))
        bank = _mix(wet, meadow, smoothstep(0.13, 0.29, height + 0.09 * patches + 0.05 * mottle))
        bed = _mix(SAND * 0.80, SILT, smoothstep(0.35, 2.0, depth + 0.5 * patches + 0.15 * mottle))
        bed = _mix(bed, MUD, smoothstep(1.6, 4.2, depth + 0.4 * patches))
        bed = bed * (1.0 + 0.13 * m)
        shallow = _mix(WET_SAND * (1.0 + 0.12 * m), bed, smoothstep(0.0, 0.22, depth))
        color = np.where((height > 0.0)[..., None], bank, shallow)
        rocky = smoothstep(4.6, 2.6, np.hypot(points[..., 0] - self.islet[0], points[..., 1] - self.islet[1]))
        color = _mix(color, ROCK * (0.9 + 0.22 * m), 0.65 * rocky * smoothstep(0.5, 0.2, height))
        # Woodland floor under the trees, then the wooded hills, then haze with the distance.
        r = np.hypot(points[..., 0], points[..., 1])
        color = _mix(
            color,
            FOREST * (1.25 + 0.35 * m) + 0.02 * np.maximum(p, 0.0),
            smoothstep(12.0, 24.0, s + 3.0 * patches) * (0.45 + 0.35 * smoothstep(40.0, 120.0, r)),
        )
        return np.clip(color, 0.01, 0.9)


def _mix(a: np.ndarray, b: np.ndarray, t: np.ndarray) -> np.ndarray:
    t = np.asarray(t)[..., None]
    return a * (1.0 - t) + b * t


def terrain_mesh(terrain: LakeTerrain, detail: float) -> Geometry:
    """A polar mesh, finest along the shore. Slot 0: inside, uv of paint_ground; slot 1: paint_hills."""
    q = float(np.sqrt(detail))
    columns = max(int(round(160 * q)), 32)
    rings = [0.25]
    while rings[-1] < OUTER_RADIUS:
        r = rings[-1]
        if r < 9.0:
            step = 0.70
        elif r < 20.5:
            step = 0.31
        elif r < PAINTED_RADIUS:
            step = 0.95
        else:
            step = 0.09 * r - 1.8
        rings.append(r + step / q)
    radii = np.asarray(rings)
    radii[-1] = OUTER_RADIUS
    radii[int(np.argmin(np.abs(radii - PAINTED_RADIUS)))] = PAINTED_RADIUS
    theta = np.arange(columns) * (2.0 * np.pi / columns)
    xy = (radii[:, None, None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1)[None]).reshape(-1, 2)
    xy = np.concatenate([xy, [[0.0, 0.0]]])
    height = terrain.height(xy)
    # Columns run counter-clockwise and rows outwards: turned, the quads face up.
    quads = grid_faces(len(radii), columns, wrap=True)[:, ::-1]
    center = np.stack(
        [np.arange(columns), (np.arange(columns) + 1) % columns, np.full(columns, len(xy) - 1)], axis=-1
    )
    corners = np.concatenate([quads.ravel(), center.ravel()])
    sizes = np.concatenate([np.full(len(quads), 4), np.full(columns, 3)])
    inner = np.concatenate(
        [radii[quads[:, 0] // columns] < PAINTED_RADIUS + 1e-6, np.ones(columns, dtype=bool)]
    )
    # A quad's first corner lies on its outer ring: the quad is inside when that ring is.
    slots = np.where(inner, 0, 1).astype(np.int32)
    uvs = 0.5 + xy[corners] / (2.0 * PAINTED_HALF_SIZE)
    # Outside: the direction along u (counted on past the seam), the logarithm of the distance along v.
    column = quads[:, :1] % columns + np.array([0, 1, 1, 0])[::-1]
    distance = np.log(radii[quads // columns] / PAINTED_RADIUS) / np.log(OUTER_RADIUS / PAINTED_RADIUS)
    # Half a texel short of the image's edges: it repeats along v too, where the far end would bleed in.
    polar = np.stack([column / columns, 0.004 + 0.992 * distance], axis=-1)
    outside = ~inner[: len(quads)]
    uvs[: 4 * len(quads)].reshape(-1, 4, 2)[outside] = polar[outside]
    return Geometry(np.column_stack([xy, height]), corners, sizes, uvs=uvs, slots=slots)


def paint_hills(terrain: LakeTerrain, size: int) -> np.ndarray:
    """The land outside PAINTED_RADIUS, a (size/4, size, 3) scene-linear image: log distance by direction."""
    rng = np.random.default_rng([terrain.seed, 4])
    rows, columns = size // 4, size
    coarse = 2
    theta = (np.arange(columns // coarse) + 0.5) * coarse / columns * 2.0 * np.pi
    r = PAINTED_RADIUS * (OUTER_RADIUS / PAINTED_RADIUS) ** (
        (np.arange(rows // coarse) + 0.5) * coarse / rows
    )
    xy = r[:, None, None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1)[None]
    r = np.broadcast_to(r[:, None], xy.shape[:2])
    patches = 1.3 * terrain.noise.fbm(xy * 0.11 + 23.0, 3)
    mottle = 1.2 * terrain.noise.fbm(xy * 0.6 + 61.0, 2) * smoothstep(160.0, 50.0, r)
    color = terrain.color(xy, np.full(xy.shape[:2], 5.0), patches, mottle)
    # Meadows between the woods on the hills.
    clearing = terrain.clearing(xy)
    color = _mix(
        color,
        _mix(GRASS * 1.15, DRY_GRASS, 0.3 * smoothstep(0.0, 1.0, patches)),
        0.85 * smoothstep(0.2, 0.5, clearing) * smoothstep(45.0, 110.0, r),
    )
    image = np.repeat(np.repeat(color, coarse, axis=0), coarse, axis=1)
    far = np.repeat(np.repeat(r, coarse, axis=0), coarse, axis=1)
    grain = tile_noise(rows, rng, exponent=0.75, low=6, high=rows / 2.2)
    image = image * (1.0 + 0.20 * np.tile(grain, (1, columns // rows)))[..., None]
    # Aerial perspective: the light of the air before the hills.
    return np.clip(_mix(image, HAZE, 0.78 * (1.0 - np.exp(-np.maximum(far - 60.0, 0.0) / 520.0))), 0.01, 0.9)


def paint_ground(
    terrain: LakeTerrain, size: int, shade: list[tuple[float, float, float, float]]
) -> np.ndarray:
    """The painted ground as a (size, size, 3) scene-linear image over the square of PAINTED_HALF_SIZE.

    shade: soft contact shadows (x, y, radius in m, strength 0..1) under what stands on the ground.
    """
    rng = np.random.default_rng([terrain.seed, 2])
    half = PAINTED_HALF_SIZE
    # The smooth fields are evaluated on a coarser lattice: their features are decimetres to metres.
    coarse = max(size // 4, 64)
    axis = ((np.arange(coarse) + 0.5) / coarse * 2.0 - 1.0) * half
    xy = np.stack(np.meshgrid(axis, axis), axis=-1)
    height = terrain.height(xy)
    patches = 1.3 * terrain.noise.fbm(xy * 0.11 + 23.0, 3)
    mottle = 1.2 * terrain.noise.fbm(xy * 0.6 + 61.0, 3)
    color = terrain.color(xy, height, patches, mottle)
    shore = terrain.shore_distance(xy)
    dark = np.ones(xy.shape[:2])
    for x, y, radius, strength in shade:
        lo = np.searchsorted(axis, [x - 2.0 * radius, y - 2.0 * radius])
        hi = np.searchsorted(axis, [x + 2.0 * radius, y + 2.0 * radius])
        window = (slice(lo[1], hi[1]), slice(lo[0], hi[0]))
        d2 = (xy[window][..., 0] - x) ** 2 + (xy[window][..., 1] - y) ** 2
        dark[window] *= 1.0 - strength * np.exp(-d2 / (0.6 * radius * radius))
    color = color * dark[..., None]
    image = _enlarge(color.astype(np.float32), size)
    big_height = _enlarge(height.astype(np.float32)[..., None], size)[..., 0]
    big_shore = _enlarge(shore.astype(np.float32)[..., None], size)[..., 0]

    tile = max(size // 4, 64)
    blades = tile_noise(tile, rng, exponent=0.7, low=14, high=tile / 2.1)
    grain = tile_noise(tile, rng, exponent=0.6, low=8, high=tile / 3)
    reps = -(-size // tile)
    grassy = smoothstep(0.16, 0.3, big_height)
    fine = np.tile(blades, (reps, reps))[:size, :size] * (0.24 * grassy)
    fine += np.tile(grain, (reps, reps))[:size, :size] * (0.06 - 0.06 * grassy)
    image *= (1.0 + fine)[..., None]
    # The rest lies in the lake and on its beach: only that window of the image is worked on.
    lo = max(int(size * (0.5 - 0.5 * _BEACH_RADIUS / half)), 0)
    window = (slice(lo, size - lo), slice(lo, size - lo))
    _paint_lake_bed(image[window], big_height[window], big_shore[window], tile, rng)
    return np.clip(image, 0.005, 0.95)


def _paint_lake_bed(
    image: np.ndarray, height: np.ndarray, shore: np.ndarray, tile: int, rng: np.random.Generator
) -> None:
    """Pebbles, sand ripples and weed into `image`, in place. tile: period of the patterns in pixels."""
    reps = -(-len(image) // tile)

    def spread(t: np.ndarray) -> np.ndarray:
        return np.tile(t, (reps, reps))[: len(image), : len(image)]

    drift = spread(tile_noise(tile, rng, exponent=1.6, low=1, high=12))
    # Pebbles of a quarter and of an eighth of a metre on the beach and in the shallows, in drifts.
    band = smoothstep(-1.5, -0.35, height) * smoothstep(0.32, 0.16, height) * smoothstep(-0.2, 0.7, drift)
    wet = np.where(height < -0.05, 0.85, 0.55 + 0.45 * smoothstep(-0.02, 0.12, height)).astype(np.float32)
    for cells, sharpness, amount in ((60, 2.6, 0.2), (144, 2.2, 0.9)):
        first, second, owner = tile_cells(tile, cells, rng)
        shape = np.clip((second - first) * sharpness, 0.0, 1.0)
        mask = spread(np.where((owner * 7.0) % 1.0 < amount, smoothstep(0.12, 0.35, shape), 0.0)) * band
        grey = (0.14 + 0.26 * owner) * (0.62 + 0.38 * shape)
        tint = np.stack([grey * (1.02 + 0.10 * owner), grey, grey * (0.92 - 0.14 * owner)], axis=-1)
        for channel in range(3):
            image[..., channel] += mask * (spread(tint[..., channel]) * wet - image[..., channel])
    # Sand ripples run along the shore: they bend visibly under the waves.
    swing = spread(tile_noise(tile, rng, exponent=1.8, low=1, high=10))
    ripple = np.sin(shore * np.float32(2.0 * np.pi / 0.34) + 1.6 * swing)
    where = smoothstep(-1.9, -0.5, height) * smoothstep(-0.12, -0.3, height) * smoothstep(0.5, -0.4, drift)
    image *= (1.0 + 0.16 * where * ripple)[..., None]
    # Dark weed, in patches of a metre.
    weeds = 0.75 * smoothstep(1.0, 1.9, spread(tile_noise(tile, rng, exponent=1.3, low=5, high=60)))
    weeds = weeds * smoothstep(-0.3, -0.8, height)
    image += weeds[..., None] * (np.array([0.045, 0.07, 0.02], dtype=np.float32) - image)


def _enlarge(image: np.ndarray, size: int) -> np.ndarray:
    """Bilinear enlargement of a square (n, n, C) image whose pixels are cell centres."""
    n = image.shape[0]
    x = np.clip((np.arange(size) + 0.5) * n / size - 0.5, 0.0, n - 1.0).astype(np.float32)
    i = np.minimum(x.astype(int), n - 2)
    f = x - i.astype(np.float32)
    rows = image[i] * (1.0 - f)[:, None, None] + image[i + 1] * f[:, None, None]
    return rows[:, i] * (1.0 - f)[None, :, None] + rows[:, i + 1] * f[None, :, None]
