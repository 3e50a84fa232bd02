# SPDX-License-Identifier: GPL-3.0-or-later
"""Boulders, stones, timber, jetty, boat, bathing terrace: closed meshes, because water cuts through them."""

from __future__ import annotations

import numpy as np

from .geometry import Geometry, box, geodesic_sphere, grid_faces, join, rotation, tube
from .noise import GradientNoise, smoothstep

GREY = np.array([0.225, 0.21, 0.19])
WARM = np.array([0.27, 0.205, 0.14])
DARK = np.array([0.125, 0.12, 0.115])
MOSS = np.array([0.075, 0.105, 0.022])
LICHEN = np.array([0.40, 0.38, 0.24])


def boulder(seed: int, frequency: int, *, moss: float = 0.5, base: np.ndarray = GREY) -> Geometry:
    """A weathered boulder of about unit radius: a sphere cut by random planes, with moss and lichen."""
    rng = np.random.default_rng([seed, 31])
    noise = GradientNoise(seed + 9)
    directions, triangles = geodesic_sphere(frequency)
    planes = rng.normal(size=(14, 3))
    planes /= np.linalg.norm(planes, axis=1, keepdims=True)
    offsets = rng.uniform(0.58, 0.95, 14)
    dots = directions @ planes.T
    # Distance to the nearest cutting plane, rounded off by a soft minimum: worn edges.
    reach = np.where(dots > 0.05, offsets[None] / np.maximum(dots, 0.05), 4.0)
    sharp = 26.0
    radius = -np.log(np.exp(-sharp * np.minimum(reach, 1.06)).sum(axis=1) / len(offsets) * 2.2) / sharp
    radius = np.clip(radius, 0.45, 1.15)
    radius *= 1.0 + 0.09 * noise.fbm(directions * 1.7, 3) + 0.045 * noise.fbm(directions * 4.5, 2)
    stretch = rng.uniform([0.95, 0.8, 0.6], [1.25, 1.0, 0.85])
    p = directions * radius[:, None] * stretch
    geometry = Geometry(p, triangles.ravel(), np.full(len(triangles), 3))
    normals = geometry.smooth_normals()
    n1, n2 = noise.fbm(p * 2.2 + 4.0, 4), noise.fbm(p * 5.5 + 13.0, 3)
    color = base[None] * (1.0 + 0.36 * n1 + 0.26 * n2)[:, None]
    color += (WARM - base)[None] * smoothstep(0.0, 0.8, noise(p * 1.1 + 30.0))[:, None] * 0.7
    color += (LICHEN - color) * (smoothstep(0.28, 0.55, n2 + 0.3 * n1) * 0.55)[:, None]
    mossy = smoothstep(0.35, 0.85, normals[:, 2] + 0.45 * n1) * moss
    color += (MOSS * (1.0 + 0.3 * n2)[:, None] - color) * mossy[:, None]
    hollow = np.clip(1.0 + 1.6 * (radius - radius.mean()), 0.75, 1.15)
    sky_view = 0.52 + 0.48 * smoothstep(-0.9, 0.35, normals[:, 2] + 0.5 * p[:, 2])
    return geometry.with_color(np.clip(color * (hollow * sky_view)[:, None], 0.015, 0.8))


def stone_group(seed: int, frequency: int, count: int, spread: float) -> Geometry:
    """Several stones in one mesh, half sunk into z = 0, of mixed greys and browns."""
    rng = np.random.default_rng([seed, 32])
    parts = []
    placed: list[tuple[float, float, float]] = []
    for n in range(count):
        size = float(np.exp(rng.uniform(np.log(0.09), np.log(0.36))))
        for _ in range(20):
            a, r = rng.uniform(0, 2 * np.pi), spread * np.sqrt(rng.uniform())
            x, y = r * np.cos(a), r * np.sin(a)
            if all(np.hypot(x - px, y - py) > 0.8 * (size + ps) for px, py, ps in placed):
                break
        placed.append((x, y, size))
        base = (GREY, WARM, DARK, 1.25 * GREY, 0.8 * WARM, 0.7 * GREY)[rng.integers(6)]
        stone = boulder(seed * 101 + n, frequency, moss=0.12, base=base)
        parts.append(stone.moved(rotation(rng.uniform(0, 6.28)) * size, (x, y, 0.22 * size)))
    return join(parts)


def log(seed: int, *, length: float, radius: float, sides: int, rings: int) -> Geometry:
    """A sunken trunk along +X with broken branches: vertex colours, closed pieces."""
    rng = np.random.default_rng([seed, 33])
    noise = GradientNoise(seed + 3)
    t = np.linspace(0.0, 1.0, rings)
    path = np.column_stack(
        [
            (t - 0.5) * length,
            0.05 * length * np.sin(2.2 * t + rng.uniform(0, 3)) * t,
            0.03 * length * np.sin(3.1 * t + 1.0),
        ]
    )
    radii = radius * (1.0 - 0.45 * t) * (1.0 + 0.08 * rng.normal(size=rings))
    radii[0] *= 1.25
    parts = [tube(path, radii, sides)]
    for _ in range(5):
        i = int(rng.integers(1, rings - 1))
        a = rng.uniform(-0.4, np.pi + 0.4)
        direction = np.array([rng.uniform(0.2, 0.8), np.cos(a), np.sin(a)])
        direction /= np.linalg.norm(direction)
        reach = radius * rng.uniform(3.0, 8.0)
        s = np.linspace(0.0, 1.0, 4)[:, None]
        limb = path[i] + direction * s * reach + rng.normal(0, 0.05, (4, 3)) * reach * s
        parts.append(tube(limb, radius * 0.34 * (1.0 - 0.75 * s[:, 0]), max(sides - 4, 5)))
    g = join(parts)
    p = g.positions
    n = noise.fbm(p * np.array([1.2, 5.0, 5.0]), 3)
    color = np.array([0.23, 0.165, 0.105])[None] * (1.0 + 0.5 * n)[:, None]
    color += (np.array([0.30, 0.28, 0.25]) - color) * (0.55 * smoothstep(0.1, 0.7, noise(p * 1.6 + 8.0)))[
        :, None
    ]
    return g.with_color(np.clip(color, 0.015, 0.8))


def post(
    height: float, radius: float, sides: int, rng: np.random.Generator, repeat: tuple[float, float]
) -> Geometry:
    """An upright round post with its foot at the origin."""
    lean = rng.normal(0.0, 0.012, size=2) * height
    path = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * height], [0.0, 0.0, height]])
    path[:, :2] += np.array([0.0, 0.5, 1.0])[:, None] * lean
    return tube(
        path, np.full(3, radius) * rng.uniform([1.08, 0.98, 0.94], [1.12, 1.02, 0.98]), sides, repeat=repeat
    )


def jetty(
    seed: int, length: float, ground: np.ndarray, *, width: float = 1.5, deck: float = 0.5, sides: int = 10
) -> Geometry:
    """A jetty along +X from x = 0. ground: (n,) heights of the bed under n evenly spaced pairs of posts."""
    rng = np.random.default_rng([seed, 34])
    parts = []
    planks = int(length / 0.17)
    for n in range(planks):
        x = (n + 0.5) * length / planks
        plank = box(
            (0.155, width + rng.uniform(-0.05, 0.09), 0.035),
            uv_scale=0.55,
            uv_offset=rng.uniform(0, 1, 2),
            long_axis=1,
        )
        turn = rotation(rng.normal(0.0, 0.012), rng.normal(0.0, 0.01), rng.normal(0.0, 0.006))
        parts.append(plank.moved(turn, (x, rng.normal(0.0, 0.015), deck + rng.normal(0.0, 0.004))))
    for y in (-0.5, 0.5):
        beam = box((length + 0.1, 0.09, 0.16), uv_scale=0.5, uv_offset=rng.uniform(0, 1, 2))
        parts.append(beam.moved(np.eye(3), (length / 2, y * (width - 0.35), deck - 0.10)))
    for x, z in zip(np.linspace(0.35, length - 0.12, len(ground)), ground, strict=True):
        rise = rng.uniform(0.10, 0.16) if x < length - 1.0 else 0.62
        for side in (-1.0, 1.0):
            total = deck + rise - (z - 0.45)
            pole = post(total, 0.085, sides, rng, (0.5, 0.5 * total))
            # The grain runs along the post: u of the wood image is the grain.
            pole = Geometry(
                pole.positions, pole.corners, pole.sizes, uvs=pole.uvs[:, ::-1], smooth=pole.smooth
            )
            parts.append(pole.moved(np.eye(3), (x, side * (width / 2 + 0.07), z - 0.45)))
        cross = box((0.08, width + 0.3, 0.12), uv_scale=0.5, uv_offset=rng.uniform(0, 1, 2), long_axis=1)
        parts.append(cross.moved(np.eye(3), (x + 0.11, 0.0, deck - 0.22)))
    return join(parts)


def _hull_section(t: np.ndarray, s: np.ndarray, inset: float) -> np.ndarray:
    """Points of the hull's half shell. t: -1 stern .. 1 bow along the length; s: 0 keel .. 1 gunwale."""
    length, beam = 3.9, 1.36
    # Fuller aft, pointed at the bow; a small transom remains at the stern.
    fore = np.where(
        t > 0.0, np.cos(0.5 * np.pi * np.clip(t, 0.0, 1.0) ** 1.7), 1.0 - 0.42 * np.clip(-t, 0.0, 1.0) ** 2.2
    )
    half_beam = np.maximum(0.5 * beam * fore - inset, 0.0)
    sheer = 0.40 + 0.20 * np.clip(t, 0.0, 1.0) ** 2 + 0.07 * np.clip(-t, 0.0, 1.0) ** 2
    keel = -0.24 + 0.34 * np.clip(t - 0.55, 0.0, 1.0) ** 2 * 2.6 + 0.10 * np.clip(-t, 0.0, 1.0) ** 3
    y = half_beam * np.sin(0.5 * np.pi * s) ** 0.72
    z = (keel + inset) + (sheer - keel - inset) * s**1.75
    x = 0.5 * length * t * (1.0 - inset / 2.2) + 0.10 * s * np.clip(t, 0.0, 1.0) ** 3
    return np.stack([x, y, z], axis=-1)


def boat_hull(stations: int, ribs: int, *, floor: float = 0.17, thickness: float = 0.05) -> Geometry:
    """A rowing boat along +X that floats on z = 0: one closed skin, keel below, floor above the water.

    uv: v = 0 keel .. 0.5 gunwale outside, 0.5 .. 1 inside (see textures.boat_paint).
    """
    t = np.linspace(-1.0, 0.985, stations)[:, None] * np.ones((1, ribs))
    s = np.linspace(0.0, 1.0, ribs)[None, :] * np.ones((stations, 1))
    outer = _hull_section(t, s, 0.0)
    inner = _hull_section(t, s, thickness)
    inner[..., 2] = np.maximum(inner[..., 2], np.minimum(floor, outer[:, -1:, 2] - 0.05))
    inner[:, -1, 2] = outer[:, -1, 2]
    # The inside starts from the floor's middle: full sections from port gunwale round to starboard gunwale.
    inner[0, :, 0] += thickness
    inner[-1, :, 0] -= 2.0 * thickness

    def section(half: np.ndarray) -> np.ndarray:
        port = half.copy()
        starboard = half[:, :0:-1].copy()
        starboard[..., 1] *= -1.0
        return np.concatenate([starboard, port], axis=1)  # starboard gunwale .. keel .. port gunwale

    out, ins = section(outer), section(inner)[:, ::-1]
    loop = np.concatenate([out, ins], axis=1)  # closed ring around each station
    per_ring = loop.shape[1]
    n_out = out.shape[1]
    half_v = np.concatenate([np.linspace(0.5, 0.0, ribs)[:-1], np.linspace(0.0, 0.5, ribs)])
    v = np.concatenate([half_v, 1.0 - half_v])
    rows = stations
    quads = grid_faces(rows, per_ring, wrap=True)
    column = quads[:, :1] % per_ring + np.array([0, 1, 1, 0])
    row = quads // per_ring
    v_wrapped = np.concatenate([v, v[:1]])
    uvs = np.stack([row / (rows - 1) * 2.0, v_wrapped[column]], axis=-1)
    # The rim quads join outside and inside at v = 0.5 on both sides.
    ends_corners, ends_sizes, ends_uvs = [], [], []
    for station, reverse in ((0, False), (rows - 1, True)):
        offset = station * per_ring
        for i in range(n_out - 1):
            face = np.array([i, i + 1, per_ring - 2 - i, per_ring - 1 - i]) + offset
            uv = np.stack([np.full(4, 0.02), v[face - offset]], axis=-1)
            uv[2:, 1] = uv[1::-1, 1]
            if not reverse:
                face, uv = face[::-1], uv[::-1]
            ends_corners.append(face)
            ends_sizes.append(4)
            ends_uvs.append(uv)
    return Geometry(
        loop.reshape(-1, 3),
        np.concatenate([quads.ravel(), *ends_corners]),
        np.concatenate([np.full(len(quads), 4), ends_sizes]).astype(np.int64),
        uvs=np.concatenate([uvs.reshape(-1, 2), *ends_uvs]),
    )


def boat_fittings(seed: int) -> Geometry:
    """Thwarts, gunwale rails and a pair of shipped oars for the hull, in bare wood."""
    rng = np.random.default_rng([seed, 35])
    parts = []
    for x, width in ((-1.25, 1.02), (-0.1, 1.24), (0.95, 0.98)):
        seat = box((0.26, width, 0.035), uv_scale=0.6, uv_offset=rng.uniform(0, 1, 2), long_axis=1)
        parts.append(seat.moved(np.eye(3), (x, 0.0, 0.30)))
    t = np.linspace(-1.0, 0.985, 18)
    edge = _hull_section(t, np.ones(18), 0.02)
    for side in (-1.0, 1.0):
        path = edge * np.array([1.0, side, 1.0]) + np.array([0.0, 0.0, 0.01])
        rail = tube(path, np.full(18, 0.034), 6, repeat=(0.3, 4.0))
        parts.append(
            Geometry(rail.positions, rail.corners, rail.sizes, uvs=rail.uvs[:, ::-1], smooth=rail.smooth)
        )
        oar_path = np.array([[-1.5, 0.22 * side, 0.36], [0.0, 0.30 * side, 0.42], [1.25, 0.36 * side, 0.47]])
        oar = tube(oar_path, np.array([0.028, 0.026, 0.024]), 6, repeat=(0.3, 3.0))
        parts.append(Geometry(oar.positions, oar.corners, oar.sizes, uvs=oar.uvs[:, ::-1], smooth=oar.smooth))
        blade = box((0.55, 0.14, 0.022), uv_scale=0.6, uv_offset=rng.uniform(0, 1, 2))
        parts.append(blade.moved(rotation(0.05 * side), (-1.72, 0.20 * side, 0.35)))
    return join(parts)


def terrace(
    steps: int,
    tread: float,
    rise: float,
    top: float,
    floor_depth: float,
    floor_length: float,
    half_width: float,
) -> tuple[Geometry, Geometry]:
    """(tiled parts, stone parts) along +X from the top step's outer edge at x = 0; z relative to the water.

    Every step is a closed block down into the ground, so that nothing is seen under it. Tiles: 2 m an image.
    """
    tiled, stone = [], []
    bottom = -floor_depth - 0.5
    for n in range(steps):
        z = top - n * rise
        block = box((tread, 2.0 * half_width, z - bottom), uv_scale=0.5, long_axis=1)
        stone.append(block.moved(np.eye(3), ((n + 0.5) * tread, 0.0, 0.5 * (z + bottom))))
        if n % 2 == 0:  # a tiled nosing on every second step: stripes that the water bends
            nosing = box(
                (0.13, 2.0 * half_width - 0.02, 0.03), uv_scale=0.5, long_axis=1, uv_offset=(0.0, 0.03)
            )
            tiled.append(nosing.moved(np.eye(3), ((n + 1) * tread - 0.07, 0.0, z + 0.012)))
    start = steps * tread
    slab = box((floor_length, 2.0 * half_width, 0.45), uv_scale=0.5, uv_offset=(0.0, 0.0))
    tiled.append(slab.moved(np.eye(3), (start + floor_length / 2, 0.0, -floor_depth - 0.225)))
    length = start + 0.7
    for side in (-1.0, 1.0):
        # Cheek walls step down with the stairs and cross the waterline.
        for x0, x1, z in ((0.0, 0.40 * length, top + 0.24), (0.40 * length, length, 0.16)):
            wall = box((x1 - x0, 0.34, z - bottom), uv_scale=0.55)
            stone.append(
                wall.moved(np.eye(3), (0.5 * (x0 + x1), side * (half_width + 0.17), 0.5 * (z + bottom)))
            )
            cap = box((x1 - x0 + 0.06, 0.44, 0.07), uv_scale=0.55, uv_offset=(0.3, 0.4))
            stone.append(cap.moved(np.eye(3), (0.5 * (x0 + x1), side * (half_width + 0.17), z + 0.035)))
    for side in (-1.0, 1.0):  # a kerb around the floor, and a pillar on each outer corner
        kerb = box((floor_length, 0.22, 0.62), uv_scale=0.55)
        stone.append(
            kerb.moved(np.eye(3), (start + floor_length / 2, side * (half_width + 0.11), -floor_depth - 0.20))
        )
        pillar = box((0.42, 0.42, floor_depth + 1.15), uv_scale=0.55, long_axis=0)
        stone.append(
            pillar.moved(
                np.eye(3),
                (start + floor_length - 0.1, side * (half_width + 0.05), 0.5 * (0.35 - floor_depth - 0.8)),
            )
        )
        cap = box((0.54, 0.54, 0.09), uv_scale=0.55)
        stone.append(cap.moved(np.eye(3), (start + floor_length - 0.1, side * (half_width + 0.05), 0.395)))
    return join(tiled), join(stone)


def cabin(length: float = 5.4, depth: float = 4.0, wall: float = 2.3, ridge: float = 4.1) -> Geometry:
    """A boathouse on z = 0, ridge along X, door in the gable at +X: closed, uv into the cabin atlas."""
    hx, hy = length / 2.0, depth / 2.0
    foot = -0.8
    p = np.array(
        [
            [-hx, -hy, foot],
            [hx, -hy, foot],
            [hx, hy, foot],
            [-hx, hy, foot],
            [-hx, -hy, wall],
            [hx, -hy, wall],
            [hx, hy, wall],
            [-hx, hy, wall],
            [-hx, 0, ridge],
            [hx, 0, ridge],
        ]
    )
    faces = [
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [1, 2, 6, 9, 5],
        [3, 0, 4, 8, 7],
        [0, 3, 2, 1],
        [4, 5, 9, 8],
        [6, 7, 8, 9],
    ]
    high = ridge
    uvs = []
    for n, face in enumerate(faces):
        q = p[face]
        if n in (0, 1):
            u, v = (q[:, 0] * (1 if n == 0 else -1) + hx) / length, np.clip(q[:, 2] / wall, 0.0, 1.0)
            uvs.append(np.stack([0.5 * u, 0.5 + 0.5 * v], axis=-1))
        elif n in (2, 3):
            u, v = (q[:, 1] * (1 if n == 2 else -1) + hy) / depth, np.clip(q[:, 2] / high, 0.0, 1.0)
            uvs.append(np.stack([(0.5 if n == 2 else 0.0) + 0.5 * u, 0.5 * v], axis=-1))
        else:
            uvs.append(np.stack([0.75 + 0.02 * q[:, 0], 0.75 + 0.02 * q[:, 1]], axis=-1))
    sizes = np.array([len(f) for f in faces])
    body = Geometry(
        p, np.concatenate(faces), sizes, uvs=np.concatenate(uvs), smooth=np.zeros(len(faces), dtype=bool)
    )
    parts = [body]
    # Two roof slabs that overhang; each a closed block, sheared to the pitch.
    slope = (ridge - wall) / hy
    for side in (-1.0, 1.0):
        slab = box((length + 0.7, hy + 0.5, 0.11))
        x, y, z = slab.positions.T
        across = y + 0.5 * (hy + 0.5)  # 0 at the ridge .. hy + 0.5 at the eave, for side = 1
        if side < 0.0:
            across = 0.5 * (hy + 0.5) - y
        lifted = np.column_stack([x, side * across, ridge + 0.07 - across * slope + z])
        top = slab.uvs.reshape(6, 4, 2).copy()
        top[:] = np.stack(
            [0.5 + 0.5 * (x + 0.5 * length + 0.35) / (length + 0.7), 0.98 - 0.46 * across / (hy + 0.5)],
            axis=-1,
        )[slab.corners].reshape(6, 4, 2)
        parts.append(Geometry(lifted, slab.corners, slab.sizes, uvs=top.reshape(-1, 2), smooth=slab.smooth))
    for x, y in ((-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy)):  # white corner boards: the door frame's white
        post_shape = box((0.16, 0.16, wall - foot))
        post_shape = Geometry(
            post_shape.positions,
            post_shape.corners,
            post_shape.sizes,
            uvs=np.full((24, 2), [0.685, 0.1]),
            smooth=post_shape.smooth,
        )
        parts.append(post_shape.moved(np.eye(3), (x, y, 0.5 * (wall + foot))))
    return join(parts)
