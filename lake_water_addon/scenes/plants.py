# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees, shrubs, grass and reeds: closed trunks with vertex colours (slot 0) and leaf cards (the last slot).

Leaf cards carry normals of the crown as a whole, so that a crown is lit as a round body and not card by card.
"""

from __future__ import annotations

import numpy as np

from .geometry import Geometry, cards, join, tube, two_sided
from .noise import GradientNoise

ATLAS = np.array([[0.0, 0.0, 0.5, 0.5], [0.5, 0.0, 1.0, 0.5], [0.0, 0.5, 0.5, 1.0], [0.5, 0.5, 1.0, 1.0]])
BARK = np.array([0.135, 0.105, 0.078])
BIRCH_BARK = np.array([0.42, 0.40, 0.36])
PINE_BARK = np.array([0.24, 0.115, 0.06])


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def _frame(normal: np.ndarray, roll: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(right, up) unit vectors across each normal, turned by `roll` about it; right x up = normal."""
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
    right = _unit(np.cross(helper, normal))
    up = np.cross(normal, right)
    c, s = np.cos(roll)[:, None], np.sin(roll)[:, None]
    return right * c + up * s, up * c - right * s


def _bark(geometry: Geometry, color: np.ndarray, noise: GradientNoise, *, birch: bool = False) -> Geometry:
    p = geometry.positions
    tone = 1.0 + 0.35 * noise(p * np.array([3.0, 3.0, 1.2]))
    colors = color[None] * tone[:, None]
    if birch:
        colors = np.where((noise(p * np.array([1.5, 1.5, 4.0])) > 0.25)[:, None], [0.06, 0.055, 0.05], colors)
    # Less sky reaches the foot of the trunk and the inside of the crown.
    foot = np.clip(0.55 + 0.45 * p[:, 2] / 1.2, 0.55, 1.0)
    return geometry.with_color(np.clip(colors * foot[:, None], 0.01, 0.8))


def _limb(
    start: np.ndarray,
    end: np.ndarray,
    radius: float,
    sides: int,
    points: int,
    sag: float,
    rng: np.random.Generator,
) -> Geometry:
    t = np.linspace(0.0, 1.0, points)[:, None]
    path = start + (end - start) * t
    path[:, 2] += sag * np.sin(np.pi * t[:, 0])
    path[1:-1] += rng.normal(0.0, 0.06 * np.linalg.norm(end - start), size=(points - 2, 3)) * 0.6
    return tube(path, radius * (1.0 - 0.82 * t[:, 0]), sides)


def broadleaf(
    seed: int,
    *,
    height: float,
    spread: float,
    cards_per_blob: int,
    blobs: int,
    card: float,
    trunk_radius: float,
    sides: int,
    clear_trunk: float = 0.28,
    flat: float = 0.82,
    bark: np.ndarray = BARK,
) -> Geometry:
    """A tree on z = 0 with clouds of leaves. spread: crown radius in m; card: half size of a leaf card in m.

    The cards face outwards. flat: height of a cloud of leaves by its width.
    """
    rng = np.random.default_rng([seed, 21])
    noise = GradientNoise(seed + 5)
    lean = rng.normal(0.0, 0.03, size=2) * height
    levels = np.linspace(-0.35, 0.72 * height, 7)
    t = np.clip(levels / (0.72 * height), 0.0, 1.0)
    path = np.column_stack(
        [
            lean[0] * t**2 + rng.normal(0, 0.012 * height, 7) * t,
            lean[1] * t**2 + rng.normal(0, 0.012 * height, 7) * t,
            levels,
        ]
    )
    flare = 1.0 + 0.9 * np.exp(-np.maximum(levels, 0.0) / (0.05 * height))
    parts = [tube(path, trunk_radius * (1.0 - 0.8 * t) * flare, sides)]
    crown = np.array([lean[0], lean[1], height * (0.5 + 0.5 * clear_trunk)])
    half_height = 0.5 * height * (1.0 - clear_trunk)
    centers, radii = [], []
    for n in range(blobs):
        # A golden-angle spiral over the crown's ellipsoid, fuller at mid height.
        f = (n + 0.5) / blobs
        z = 1.0 - 1.75 * f
        ring = np.sqrt(max(1.0 - z * z, 0.0))
        a = n * 2.39996 + rng.uniform(-0.3, 0.3)
        r = 0.62 * rng.uniform(0.85, 1.1)
        centers.append(
            crown
            + np.array([spread * ring * r * np.cos(a), spread * ring * r * np.sin(a), half_height * 0.66 * z])
        )
        radii.append(spread * rng.uniform(0.40, 0.56) * (0.8 + 0.2 * ring))
    centers.append(crown)
    radii.append(spread * 0.62)
    for center in centers[:-1:2]:
        foot = path[3] + (path[5] - path[3]) * rng.uniform()
        parts.append(_limb(foot, center, trunk_radius * 0.42, max(sides - 4, 4), 3, 0.04 * height, rng))
    wood = join([_bark(p, bark, noise, birch=bark is BIRCH_BARK) for p in parts])
    position, normal, owner = [], [], []
    for b, (center, radius) in enumerate(zip(centers, radii, strict=True)):
        d = _unit(rng.normal(size=(cards_per_blob, 3)))
        # Outward of the crown rather than into it, where no card would ever be seen.
        outward = _unit(center - crown + np.array([0.0, 0.0, 0.35 * half_height]))
        d = _unit(d + 0.55 * outward * (b < blobs))
        squash = np.array([1.0, 1.0, flat])
        position.append(center + d * squash * radius * rng.uniform(0.72, 1.05, size=(cards_per_blob, 1)))
        normal.append(_unit(d + 0.28 * rng.normal(size=d.shape)))
        owner.append(np.full(cards_per_blob, b))
    position, normal, owner = np.concatenate(position), np.concatenate(normal), np.concatenate(owner)
    right, up = _frame(normal, rng.uniform(0.0, 2.0 * np.pi, len(position)))
    half = card * rng.uniform(0.8, 1.2, size=(len(position), 1))
    quad = cards(position, right * half, up * half, ATLAS[np.zeros(len(position), dtype=int)])
    corner = quad.positions.reshape(-1, 4, 3)
    blob_center, blob_radius = np.asarray(centers)[owner], np.asarray(radii)[owner]
    around_blob = (corner - blob_center[:, None]) / blob_radius[:, None, None]
    around_crown = (corner - crown) / np.array([spread, spread, half_height])
    normals = _unit(0.55 * around_blob + 0.75 * around_crown + np.array([0.0, 0.0, 0.2]))
    # Shaded tiles low and inside the crown, bright ones on top and outside.
    light = (
        0.45 * around_crown[..., 2].mean(axis=1)
        + 0.35 * np.linalg.norm(around_crown.mean(axis=1), axis=1)
        + 0.35 * around_blob[..., 2].mean(axis=1)
        + rng.normal(0.0, 0.16, len(position))
    )
    tile = np.digitize(light, [-0.12, 0.22, 0.55])
    leaves = cards(position, right * half, up * half, ATLAS[tile], normals)
    return join([wood.with_slot(0), leaves.with_slot(1)])


def conifer(
    seed: int,
    *,
    height: float,
    spread: float,
    whorls: int,
    branches: int,
    sides: int,
    clear_trunk: float = 0.08,
    droop: float = 0.28,
) -> Geometry:
    """A spruce. Each branch is a roof of two leaf quads.

    Uses the needle atlas: tile 0 is the silhouette of a whole spruce, the others are branches.
    """
    rng = np.random.default_rng([seed, 22])
    noise = GradientNoise(seed + 6)
    trunk_radius = 0.019 * height + 0.03
    levels = np.linspace(-0.35, 0.93 * height, 7)
    t = np.clip(levels / height, 0.0, 1.0)
    bend = rng.normal(0.0, 0.008, size=(7, 2)) * height * t[:, None]
    path = np.column_stack([bend, levels])
    flare = 1.0 + 0.8 * np.exp(-np.maximum(levels, 0.0) / (0.04 * height))
    wood = _bark(tube(path, trunk_radius * (1.0 - 0.93 * t) * flare, sides), BARK, noise)
    positions, uvs, normals = [], [], []
    for w in range(whorls):
        f = w / max(whorls - 1, 1)
        z0 = height * (clear_trunk + (0.92 - clear_trunk) * f**0.9)
        reach = spread * (1.0 - f) ** 0.85 + 0.09 * spread
        count = max(int(round(branches * (1.0 - 0.4 * f))), 3)
        stem = np.array([np.interp(z0, levels, path[:, 0]), np.interp(z0, levels, path[:, 1]), z0])
        for n in range(count):
            a = w * 1.1 + 2.0 * np.pi * (n + rng.uniform(-0.25, 0.25)) / count
            out = np.array([np.cos(a), np.sin(a), 0.0])
            across = np.array([-out[1], out[0], 0.0])
            length = reach * rng.uniform(0.82, 1.14)
            drop = droop * (1.25 - 0.95 * f)
            tip = stem + out * length - np.array([0.0, 0.0, drop * length])
            base = stem - out * 0.04 * length
            # A ridge with two eaves: from every side some of the branch is seen face on.
            half = length * rng.uniform(0.46, 0.60)
            fall = np.array([0.0, 0.0, -half * rng.uniform(0.35, 0.75)])
            left, right = across * half + fall, -across * half + fall
            positions.append(np.array([base, tip, base + left, tip + left, base + right, tip + right]))
            tile = ATLAS[1 + int(np.digitize(f + rng.normal(0.0, 0.22), [0.3, 0.7]))]
            middle = 0.5 * (tile[1] + tile[3])
            uvs.append(
                np.array(
                    [
                        [tile[0], middle],
                        [tile[2], middle],
                        [tile[0], tile[3]],
                        [tile[2], tile[3]],
                        [tile[0], tile[1]],
                        [tile[2], tile[1]],
                    ]
                )
            )
            ridge = out[None] * np.array([0.3, 1.0])[:, None] + np.array([0.0, 0.0, 0.6])
            normals.append(_unit(np.concatenate([ridge, ridge + 0.45 * across, ridge - 0.45 * across])))
    # Counter-clockwise from above: ridge, eave on the left; eave on the right, ridge.
    quads = np.array([[0, 1, 3, 2], [4, 5, 1, 0]])
    total = len(positions)
    corners = (quads[None] + 6 * np.arange(total)[:, None, None]).reshape(-1)
    uv = np.concatenate(uvs)
    parts = [
        wood.with_slot(0),
        Geometry(
            np.concatenate(positions),
            corners,
            np.full(2 * total, 4),
            uvs=uv[corners],
            normals=np.concatenate(normals),
        ).with_slot(1),
    ]
    # Three upright silhouettes fill the dark inside, so that no light shows through between the branches.
    yaw = np.pi * np.arange(3) / 3.0
    right = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(3)]) * spread * 0.80
    low, high = clear_trunk * 0.5 * height, 1.0 * height
    up = np.tile([0.0, 0.0, 0.5 * (high - low)], (3, 1))
    center = np.tile([0.0, 0.0, 0.5 * (high + low)], (3, 1))
    # Normals in the plane of the card: seen from behind they are turned, which only swaps left and right.
    sideways = np.stack([-right, right, right, -right], axis=1)
    parts.append(cards(center, right, up, ATLAS[np.zeros(3, dtype=int)], _unit(sideways)).with_slot(1))
    return join(parts)


def shrub(seed: int, *, radius: float, cards_count: int, card: float) -> Geometry:
    """A round bush of leaf cards on z = 0, slot 0."""
    rng = np.random.default_rng([seed, 23])
    d = _unit(rng.normal(size=(cards_count, 3)) + np.array([0.0, 0.0, 0.35]))
    lumps = 1.0 + 0.22 * np.sin(3.0 * np.arctan2(d[:, 1], d[:, 0]) + seed)
    position = d * radius * (lumps * rng.uniform(0.55, 1.0, cards_count))[:, None] * [1.0, 1.0, 0.85]
    position[:, 2] = np.abs(position[:, 2]) + 0.28 * radius
    normal = _unit(d + 0.5 * rng.normal(size=d.shape))
    right, up = _frame(normal, rng.uniform(0.0, 2.0 * np.pi, cards_count))
    half = card * rng.uniform(0.8, 1.2, size=(cards_count, 1))
    light = position[:, 2] / radius - 0.45 + rng.normal(0.0, 0.2, cards_count)
    tile = np.digitize(light, [-0.05, 0.25, 0.6])
    quad = cards(position, right * half, up * half, ATLAS[tile])
    normals = _unit(quad.positions / radius + np.array([0.0, 0.0, 0.4]))
    return cards(position, right * half, up * half, ATLAS[tile], normals.reshape(-1, 4, 3))


def grass_patch(seed: int, *, radius: float, tufts: int, height: float, kinds: tuple[float, ...]) -> Geometry:
    """Upright tuft cards over a disc on z = 0. kinds: frequencies of the grass atlas's four tiles.

    The normals point up, as the ground's do: a patch is as bright as the meadow that it stands on.
    """
    rng = np.random.default_rng([seed, 24])
    a = rng.uniform(0.0, 2.0 * np.pi, tufts)
    r = radius * np.sqrt(rng.uniform(0.0, 1.0, tufts))
    # Lower towards the rim, so that neighbouring patches melt into one another.
    half = 0.5 * height * rng.uniform(0.7, 1.25, tufts) * (1.0 - 0.45 * (r / radius) ** 2)
    width = 0.75 * height * rng.uniform(0.8, 1.3, tufts) + 0.05
    centers = np.column_stack([r * np.cos(a), r * np.sin(a), half - 0.03])
    yaw = rng.uniform(0.0, np.pi, tufts)
    right = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(tufts)]) * width[:, None]
    lean = rng.normal(0.0, 0.16, size=(tufts, 2))
    up = _unit(np.column_stack([lean, np.ones(tufts)])) * half[:, None]
    probability = np.asarray(kinds) / np.sum(kinds)
    tile = ATLAS[rng.choice(4, tufts, p=probability)]
    flip = rng.uniform(size=tufts) < 0.5
    tile = np.where(flip[:, None], tile[:, [2, 1, 0, 3]], tile)
    n = np.tile([0.0, 0.0, 1.0], (tufts, 1))
    return two_sided(cards(centers, right, up, tile, np.repeat(n[:, None], 4, axis=1)))


def reed_clump(seed: int, *, stalks: int, radius: float, height: float) -> Geometry:
    """Tall leaf cards on z = 0 for the shallows."""
    rng = np.random.default_rng([seed, 25])
    a = rng.uniform(0.0, 2.0 * np.pi, stalks)
    r = radius * np.sqrt(rng.uniform(0.0, 1.0, stalks))
    half = 0.5 * height * rng.uniform(0.65, 1.1, stalks) * (1.0 - 0.25 * r / radius)
    width = 0.30 * height * rng.uniform(0.75, 1.1, stalks) * 0.55
    centers = np.column_stack([r * np.cos(a), r * np.sin(a), half - 0.06])
    yaw = np.arange(stalks) * 2.39996 + rng.uniform(-0.4, 0.4, stalks)
    right = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(stalks)]) * width[:, None]
    outward = np.column_stack([np.cos(a), np.sin(a)]) * (0.16 * r / radius)[:, None]
    up = (
        _unit(np.column_stack([outward + rng.normal(0.0, 0.05, size=(stalks, 2)), np.ones(stalks)]))
        * half[:, None]
    )
    headed = rng.uniform(size=stalks) < 0.3
    tile = np.where(headed[:, None], [0.5, 0.0, 1.0, 1.0], [0.0, 0.0, 0.5, 1.0])
    n = _unit(np.column_stack([0.25 * np.cos(a), 0.25 * np.sin(a), np.ones(stalks)]))
    return two_sided(cards(centers, right, up, tile, np.repeat(n[:, None], 4, axis=1)))


def far_forest(points: np.ndarray, heights: np.ndarray, kinds: np.ndarray, bands: np.ndarray) -> Geometry:
    """One quad a tree that faces the lake's centre. points: (n, 3) feet; kinds, bands: atlas column, row."""
    n = len(points)
    outward = _unit(points[:, :2])
    half = 0.5 * heights
    right = np.column_stack([-outward[:, 1], outward[:, 0], np.zeros(n)]) * -1.0
    # right x up points back to the centre
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    centers = points + np.column_stack([np.zeros((n, 2)), half * 0.92])
    tile = np.column_stack([kinds * 0.25, bands * 0.25, kinds * 0.25 + 0.25, bands * 0.25 + 0.25])
    normal = _unit(np.column_stack([-0.6 * outward, np.full(n, 0.8)]))
    return cards(
        centers, right * half[:, None], up * half[:, None], tile, np.repeat(normal[:, None], 4, axis=1)
    )
