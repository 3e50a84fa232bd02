# SPDX-License-Identifier: GPL-3.0-or-later
"""Images painted with numpy: leaves, grass, reeds, far trees, wood, stone, tiles and paint.

Every painter returns (height, width, 3 or 4) float32, row 0 at the bottom, scene-linear colour, alpha 0 or 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from .noise import smoothstep, tile_noise


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 transfer function, linear to encoded."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(np.maximum(x, 1e-6), 1.0 / 2.4) - 0.055)


def make_image(name: str, pixels: np.ndarray) -> bpy.types.Image:
    """A packed 8-bit sRGB image from scene-linear (h, w, 3 or 4) pixels."""
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = srgb_encode(pixels[..., :3])
    if channels == 4:
        rgba[..., 3] = pixels[..., 3]
    image = bpy.data.images.new(name, width, height, alpha=channels == 4)
    # Colour and alpha are independent: the colour under alpha 0 has to survive for the filtering.
    image.alpha_mode = "CHANNEL_PACKED"
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image


def _canvas(size: int, height: int, fill: Sequence[float]) -> np.ndarray:
    """Transparent canvas. Under alpha 0 lies the plant's own colour, so filtering adds no dark fringe."""
    canvas = np.zeros((height, size, 4), dtype=np.float32)
    canvas[..., :3] = fill
    return canvas


def _stamp_leaf(
    canvas: np.ndarray, x: float, y: float, length: float, width: float, angle: float, color: np.ndarray
) -> None:
    """Draw one pointed leaf from (x, y) (pixels) in direction `angle`; length and width in pixels."""
    h, w = canvas.shape[:2]
    cx, cy = x + 0.5 * length * np.cos(angle), y + 0.5 * length * np.sin(angle)
    reach = 0.5 * length + width + 1.0
    x0, x1 = max(int(cx - reach), 0), min(int(cx + reach) + 2, w)
    y0, y1 = max(int(cy - reach), 0), min(int(cy + reach) + 2, h)
    if x0 >= x1 or y0 >= y1:
        return
    dx = (np.arange(x0, x1, dtype=np.float32) + (0.5 - x))[None, :]
    dy = (np.arange(y0, y1, dtype=np.float32) + (0.5 - y))[:, None]
    c, s = float(np.cos(angle)), float(np.sin(angle))
    u = (dx * c + dy * s) / length
    v = (dy * c - dx * s) / (0.5 * width)
    along = np.clip(u, 0.0, 1.0)
    side = np.abs(v)
    inside = (u > 0.0) & (u < 1.0) & (side < np.sqrt(along) * (1.0 - along) * 2.6)
    # A light rib; one half of the blade catches less light.
    light = (1.22 - 0.22 * side - 0.35 * np.minimum(side, 0.4)) * np.where(v > 0.0, 1.0, 0.86)
    view = canvas[y0:y1, x0:x1]
    view[inside, :3] = light[inside][:, None] * color
    view[inside, 3] = 1.0


def leaf_tile(
    size: int, rng: np.random.Generator, color: np.ndarray, *, leaves: int, leaf: float, slender: float = 0.5
) -> np.ndarray:
    """A loose round cluster of leaves. leaf: length of a leaf, part of the tile; slender: width by length."""
    canvas = _canvas(size, size, color * 0.7)
    for n in range(leaves):
        depth = n / leaves  # the last ones lie on top and are brighter
        r = 0.42 * np.sqrt(rng.uniform()) * size * (1.0 - 0.15 * depth)
        a = rng.uniform(0.0, 2.0 * np.pi)
        x, y = size / 2 + r * np.cos(a), size / 2 + r * np.sin(a)
        tint = (
            color
            * (0.55 + 0.6 * depth)
            * rng.uniform(0.8, 1.2)
            * rng.uniform([0.85, 0.95, 0.8], [1.2, 1.05, 1.1])
        )
        length = leaf * size * rng.uniform(0.75, 1.2)
        # Leaves point outwards, roughly.
        angle = a + rng.normal(0.0, 0.9)
        x -= 0.5 * length * np.cos(angle)
        y -= 0.5 * length * np.sin(angle)
        _stamp_leaf(canvas, x, y, length, length * slender, angle, tint)
    return canvas


def leaf_atlas(
    size: int,
    seed: int,
    color: Sequence[float],
    *,
    leaves: int = 120,
    leaf: float = 0.17,
    slender: float = 0.5,
) -> np.ndarray:
    """Four leaf clusters in a 2x2 atlas: bright ones in the upper row, shaded ones in the lower row."""
    rng = np.random.default_rng([seed, 11])
    base = np.asarray(color, dtype=np.float64)
    tile = size // 2
    rows = []
    for light in ([0.42, 0.62], [0.9, 1.15]):
        rows.append(
            np.concatenate(
                [leaf_tile(tile, rng, base * k, leaves=leaves, leaf=leaf, slender=slender) for k in light],
                axis=1,
            )
        )
    return np.concatenate(rows, axis=0)


def _spruce_silhouette(
    canvas: np.ndarray, rng: np.random.Generator, color: np.ndarray, *, width: float, rows: int
) -> None:
    """Draw a whole spruce over the canvas: tiers of drooping branches. width: half, as a part of the tile."""
    tile = canvas.shape[0]
    for n in range(rows):
        t = n / rows
        y = tile * (0.05 + 0.90 * t)
        reach = tile * width * (1.0 - t) ** 0.85 * (0.78 + 0.3 * rng.uniform())
        for side in (-1.0, 1.0):
            for m in range(6):
                f = (m + 0.3) / 6.0
                tint = color * (0.55 + 0.75 * f + 0.3 * t) * rng.uniform(0.75, 1.25)
                angle = -0.45 if side > 0.0 else np.pi + 0.45
                _stamp_leaf(
                    canvas,
                    tile / 2 + side * reach * f * 0.8,
                    y,
                    reach * 0.45 + tile * 0.035,
                    tile * 0.055,
                    angle + rng.normal(0.0, 0.2),
                    tint,
                )


def needle_atlas(size: int, seed: int, color: Sequence[float]) -> np.ndarray:
    """2x2 atlas for conifers: a dark whole spruce, then three branches, the last the brightest.

    A branch's twig runs along u from the stem at u = 0 to the tip.
    """
    rng = np.random.default_rng([seed, 12])
    base = np.asarray(color, dtype=np.float64)
    tile = size // 2
    silhouette = _canvas(tile, tile, base * 0.4)
    _spruce_silhouette(silhouette, rng, base * 0.5, width=0.46, rows=30)
    tiles = [silhouette]
    for k in (0.62, 0.88, 1.2):
        canvas = _canvas(tile, tile, base * k * 0.7)
        twigs = 19
        for n in range(twigs):
            t = n / twigs
            side = 1.0 if n % 2 else -1.0
            x0, y0 = tile * (0.0 + 0.86 * t), tile * 0.5
            reach = tile * 0.50 * (1.0 - t) ** 0.7 * rng.uniform(0.8, 1.1) + tile * 0.08
            angle = side * rng.uniform(0.65, 0.95)
            for m in range(12):
                f = m / 12.0
                x, y = x0 + reach * f * np.cos(angle), y0 + reach * f * np.sin(angle)
                for spread in (-0.75, 0.75):
                    tint = base * k * rng.uniform(0.65, 1.25) * (0.75 + 0.45 * f)
                    _stamp_leaf(
                        canvas,
                        x,
                        y,
                        tile * 0.14 * (1.0 - 0.35 * f),
                        tile * 0.05,
                        angle + spread + rng.normal(0.0, 0.12),
                        tint,
                    )
        for m in range(26):  # the leader
            f = m / 26.0
            for spread in (-0.6, 0.6):
                _stamp_leaf(
                    canvas,
                    tile * f * 0.88,
                    tile * 0.5,
                    tile * 0.12,
                    tile * 0.045,
                    spread,
                    base * k * rng.uniform(0.7, 1.2),
                )
        tiles.append(canvas)
    return np.concatenate([np.concatenate(tiles[:2], axis=1), np.concatenate(tiles[2:], axis=1)], axis=0)


def _blades(
    canvas: np.ndarray,
    rng: np.random.Generator,
    count: int,
    colors: np.ndarray,
    *,
    height: tuple[float, float],
    width: tuple[float, float],
    lean: float,
    base: float = 0.44,
    spread: float = -0.5,
) -> None:
    """Curved blades that grow from the tile's lower edge. height, width: parts of the tile; colors: (n, 3).

    base: half width of the foot; spread: how far blades bend outwards (negative: back to the middle).
    """
    h, w = canvas.shape[:2]
    rows = (np.arange(h) + 0.5) / h
    x = (np.arange(w) + 0.5) / w
    for n in range(count):
        depth = n / max(count - 1, 1)
        top = rng.uniform(*height)
        foot = 0.5 + rng.uniform(-base, base)
        bend = np.clip(rng.normal(0.0, lean), -2.0 * lean, 2.0 * lean) + spread * (foot - 0.5)
        half = 0.5 * rng.uniform(*width)
        t = rows / top
        center = foot + bend * t * t * top
        taper = half * np.sqrt(np.clip(1.0 - t, 0.0, 1.0))
        inside = np.abs(x[None] - center[:, None]) < taper[:, None]
        color = colors[rng.integers(len(colors))] * rng.uniform(0.75, 1.2)
        shade = (0.5 + 0.55 * np.clip(t, 0.0, 1.0)) * (0.75 + 0.25 * depth)
        fill = np.broadcast_to((color[None] * shade[:, None])[:, None], (h, w, 3))
        canvas[inside, :3] = fill[inside]
        canvas[inside, 3] = 1.0


def _dots(
    canvas: np.ndarray,
    rng: np.random.Generator,
    count: int,
    color: Sequence[float],
    *,
    low: float,
    high: float,
    radius: float,
) -> None:
    h, w = canvas.shape[:2]
    y, x = (np.mgrid[0:h, 0:w] + 0.5) / h
    for _ in range(count):
        cx, cy = rng.uniform(0.2, 0.8) * w / h, rng.uniform(low, high)
        d = np.hypot(x - cx, y - cy) / radius
        inside = d < 1.0
        canvas[inside, :3] = (np.asarray(color)[None, None] * (1.1 - 0.35 * d)[..., None])[inside]
        canvas[inside, 3] = 1.0


def grass_atlas(size: int, seed: int) -> np.ndarray:
    """Four tufts in a 2x2 atlas: meadow, short turf (lower row), dry with seed heads, with flowers."""
    rng = np.random.default_rng([seed, 13])
    tile = size // 2
    green = np.array([[0.15, 0.24, 0.045], [0.11, 0.19, 0.035], [0.20, 0.27, 0.06], [0.085, 0.15, 0.03]])
    straw = np.array([[0.38, 0.33, 0.13], [0.28, 0.27, 0.09], [0.20, 0.23, 0.06], [0.45, 0.38, 0.17]])
    tiles = []
    for kind in range(4):
        canvas = _canvas(tile, tile, green[0] * 0.7)
        if kind == 0:
            _blades(canvas, rng, 80, green, height=(0.4, 0.97), width=(0.018, 0.034), lean=0.32)
        elif kind == 1:
            _blades(canvas, rng, 100, green * 0.9, height=(0.25, 0.62), width=(0.018, 0.034), lean=0.3)
        elif kind == 2:
            _blades(canvas, rng, 45, green, height=(0.35, 0.7), width=(0.018, 0.032), lean=0.3)
            _blades(canvas, rng, 45, straw, height=(0.5, 0.98), width=(0.014, 0.026), lean=0.28)
        else:
            _blades(canvas, rng, 76, green, height=(0.4, 0.85), width=(0.018, 0.034), lean=0.3)
            _dots(canvas, rng, 7, (0.75, 0.72, 0.62), low=0.6, high=0.9, radius=0.022)
            _dots(canvas, rng, 6, (0.75, 0.50, 0.05), low=0.5, high=0.85, radius=0.02)
        tiles.append(canvas)
    return np.concatenate([np.concatenate(tiles[:2], axis=1), np.concatenate(tiles[2:], axis=1)], axis=0)


def reed_atlas(size: int, seed: int) -> np.ndarray:
    """Two tall tiles side by side (each size/2 wide, size high): leaves only, and with cattails."""
    rng = np.random.default_rng([seed, 14])
    green = np.array([[0.19, 0.27, 0.065], [0.14, 0.22, 0.055], [0.26, 0.29, 0.09], [0.38, 0.33, 0.14]])
    tiles = []
    for heads in (0, 5):
        canvas = _canvas(size // 2, size, green[0] * 0.7)
        _blades(
            canvas, rng, 15, green, height=(0.45, 0.97), width=(0.05, 0.085), lean=0.22, base=0.20, spread=0.9
        )
        h, w = canvas.shape[:2]
        y, x = np.mgrid[0:h, 0:w].astype(np.float32) + 0.5
        for _ in range(heads):
            top, foot, bend = rng.uniform(0.72, 0.97), rng.uniform(0.35, 0.65), rng.uniform(-0.2, 0.2)
            t = y / h / top
            center = (foot + bend * t * t) * w
            stalk = (np.abs(x - center) < 0.012 * w) & (t < 1.0)
            canvas[stalk, :3] = (0.22, 0.25, 0.09)
            canvas[stalk, 3] = 1.0
            head = (np.abs(x - center) < 0.042 * w) & (t > 0.84) & (t < 0.97)
            canvas[head, :3] = (0.105, 0.052, 0.022)
            canvas[head, 3] = 1.0
        tiles.append(canvas)
    return np.concatenate(tiles, axis=1)


def far_tree_atlas(size: int, seed: int, haze: Sequence[float]) -> np.ndarray:
    """Whole trees seen from far: four kinds along u, three distances (haze) along v, near at the bottom."""
    rng = np.random.default_rng([seed, 15])
    tile = size // 4
    kinds = []
    for kind in range(4):
        conifer = kind < 2
        color = np.array(
            ([0.050, 0.088, 0.036], [0.043, 0.082, 0.040], [0.10, 0.15, 0.035], [0.14, 0.155, 0.035])[kind]
        )
        canvas = _canvas(tile, tile, color * 0.8)
        if conifer:
            _spruce_silhouette(canvas, rng, color, width=0.30 - 0.05 * kind, rows=34)
        else:
            for n in range(190):
                depth = n / 190.0
                a = rng.uniform(0, 2 * np.pi)
                r = np.sqrt(rng.uniform())
                lobe = 1.0 + 0.18 * np.sin(3 * a + kind) + 0.1 * np.sin(5 * a)
                x = tile * (0.5 + 0.32 * r * lobe * np.cos(a))
                y = tile * (0.53 + 0.32 * r * lobe * np.sin(a))
                light = 0.5 + 0.75 * depth * (0.5 + 0.5 * np.sin(a) * r + 0.2)
                _stamp_leaf(
                    canvas,
                    x,
                    y,
                    tile * 0.11,
                    tile * 0.085,
                    rng.uniform(0, 2 * np.pi),
                    color * light * rng.uniform(0.8, 1.25),
                )
            trunk = canvas[: int(0.3 * tile), int(0.48 * tile) : int(0.52 * tile)]
            bare = trunk[..., 3] < 0.5
            trunk[bare, :3] = (0.05, 0.04, 0.03)
            trunk[..., 3] = 1.0
        kinds.append(canvas)
    row = np.concatenate(kinds, axis=1)
    rows = []
    for amount in (0.05, 0.22, 0.42, 0.42):
        hazed = row.copy()
        hazed[..., :3] += amount * (np.asarray(haze, dtype=np.float32) - hazed[..., :3])
        rows.append(hazed)
    return np.concatenate(rows, axis=0)


def wood(size: int, seed: int, color: Sequence[float] = (0.30, 0.245, 0.185)) -> np.ndarray:
    """Weathered wood, tileable, the grain along u."""
    rng = np.random.default_rng([seed, 16])
    noise = tile_noise(size, rng, exponent=1.0, low=1, high=size / 3)
    # Averaged along u, noise becomes fibres.
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    fy = np.abs(np.fft.fftfreq(size)[:, None] * size)
    fx = np.fft.rfftfreq(size)[None, :] * size
    fibres = np.fft.irfft2(
        spectrum * np.exp(-((fx / 3.0) ** 2)) * np.exp(-((fy / (size / 5)) ** 2)), s=(size, size)
    )
    fibres /= fibres.std()
    cracks = smoothstep(1.6, 2.6, fibres + 0.25 * noise)
    tone = 1.0 + 0.20 * fibres + 0.10 * noise
    image = np.asarray(color)[None, None] * tone[..., None]
    image[..., 0] *= 1.0 + 0.05 * noise
    image *= (1.0 - 0.65 * cracks)[..., None]
    return np.clip(image, 0.01, 0.9).astype(np.float32)


def mosaic(size: int, seed: int) -> np.ndarray:
    """Floor of a bathing terrace: 8x8 tiles, a blue and white chequer with terracotta rosettes."""
    rng = np.random.default_rng([seed, 17])
    n = 8
    axis = (np.arange(size) + 0.5) / size * n
    y, x = np.meshgrid(axis, axis, indexing="ij")
    iy, ix = y.astype(int), x.astype(int)
    fy, fx = y - iy, x - ix
    white, blue = np.array([0.66, 0.63, 0.55]), np.array([0.035, 0.14, 0.30])
    terracotta = np.array([0.47, 0.15, 0.07])
    image = np.where(((ix + iy) % 2 == 0)[..., None], white, blue)
    d = np.abs(fx - 0.5) + np.abs(fy - 0.5)
    rosette = (d < 0.24) & ((ix + iy) % 2 == 0) & ((ix // 2 + iy // 2) % 2 == 0)
    image = np.where(rosette[..., None], terracotta, image)
    tone = rng.uniform(0.82, 1.12, size=(n, n))[iy, ix]
    image = image * tone[..., None]
    grout = np.minimum(np.minimum(fx, 1 - fx), np.minimum(fy, 1 - fy)) < 0.035
    image = np.where(grout[..., None], np.array([0.22, 0.20, 0.165]), image)
    dirt = tile_noise(size, rng, exponent=1.3, low=1, high=size / 3)
    image = image * np.clip(0.95 + 0.10 * dirt, 0.4, 1.2)[..., None]
    return np.clip(image, 0.01, 0.9).astype(np.float32)


def masonry(size: int, seed: int) -> np.ndarray:
    """Pale dressed stone in courses (tileable), for steps and walls."""
    rng = np.random.default_rng([seed, 18])
    rows, columns = 6, 4
    axis = (np.arange(size) + 0.5) / size
    y, x = np.meshgrid(axis * rows, axis * columns, indexing="ij")
    iy = y.astype(int)
    x = x + 0.5 * (iy % 2)
    ix = x.astype(int) % columns
    fy, fx = y - iy, x - np.floor(x)
    tone = rng.uniform(0.78, 1.12, size=(rows, columns))[iy, ix]
    noise = tile_noise(size, rng, exponent=0.9, low=2, high=size / 2.2)
    image = np.array([0.40, 0.365, 0.30])[None, None] * (tone * (1.0 + 0.10 * noise))[..., None]
    joint = (np.minimum(fy, 1 - fy) < 0.06) | (np.minimum(fx, 1 - fx) < 0.035)
    image = np.where(joint[..., None], image * 0.55, image)
    return np.clip(image, 0.01, 0.9).astype(np.float32)


def stripes(size: int, seed: int) -> np.ndarray:
    """Red and white bands along v, weathered, for mooring poles: their bend at the surface is plain to see.

    As narrow as the pole is slender, (size, size / 16): a square image would be blurred along the pole.
    """
    rng = np.random.default_rng([seed, 19])
    width = max(size // 16, 4)
    v = (np.arange(size) + 0.5) / size
    band = (np.floor(v * 8) % 2 == 0)[:, None, None]
    red, white = np.array([0.50, 0.045, 0.03]), np.array([0.70, 0.67, 0.60])
    image = np.where(band, red, white) * np.ones((size, width, 1))
    noise = tile_noise(size, rng, exponent=1.1, low=1, high=size / 3)[:, :width]
    return np.clip(image * (0.93 + 0.09 * noise)[..., None], 0.01, 0.9).astype(np.float32)


def boat_paint(size: int, seed: int) -> np.ndarray:
    """Lapped planks of a hull. v: 0 keel .. 0.5 outer gunwale, then 0.5 .. 1 the inside down to the floor."""
    rng = np.random.default_rng([seed, 20])
    v = ((np.arange(size) + 0.5) / size)[:, None]
    outside = v < 0.5
    t = np.where(outside, v * 2.0, (1.0 - v) * 2.0)
    color = np.where(t[..., None] < 0.36, np.array([0.30, 0.045, 0.03]), np.array([0.66, 0.64, 0.57]))
    color = np.where(t[..., None] > 0.84, np.array([0.025, 0.115, 0.21]), color)
    wood_inside = np.array([0.36, 0.20, 0.085])
    color = np.where(outside[..., None], color, wood_inside)
    plank = (t * 7.0) % 1.0
    shade = 0.72 + 0.28 * smoothstep(0.0, 0.18, plank)
    image = color * shade[..., None] * np.ones((size, size, 1))
    noise = tile_noise(size, rng, exponent=1.2, low=1, high=size / 3)
    streak = tile_noise(size, rng, exponent=0.4, low=2, high=40)
    image = image * np.clip(0.94 + 0.07 * noise + 0.03 * streak, 0.5, 1.2)[..., None]
    return np.clip(image, 0.01, 0.9).astype(np.float32)


def cabin_atlas(size: int, seed: int) -> np.ndarray:
    """Boathouse, a 2x2 atlas: boards, the door's gable (below), a wall with windows, shingles."""
    rng = np.random.default_rng([seed, 21])
    tile = size // 2
    y, x = (np.mgrid[0:tile, 0:tile] + 0.5) / tile
    noise = tile_noise(tile, rng, exponent=1.1, low=1, high=tile / 3)
    streaks = np.repeat(rng.normal(0.0, 1.0, 22), tile // 22 + 1)[:tile]
    board = (x * 22.0) % 1.0
    red = np.array([0.255, 0.048, 0.030])
    white = np.array([0.62, 0.60, 0.55])
    walls = red * (1.0 + 0.07 * noise + 0.07 * streaks[None, :])[..., None]
    walls = np.where((board < 0.10)[..., None], walls * 0.55, walls)
    walls = walls * (0.72 + 0.28 * smoothstep(0.0, 0.16, y))[..., None]

    def panel(image: np.ndarray, x0: float, x1: float, y0: float, y1: float, color: np.ndarray) -> np.ndarray:
        inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        return np.where(inside[..., None], color * (1.0 + 0.05 * noise)[..., None], image)

    door = panel(walls, 0.36, 0.64, 0.0, 0.56, white)
    door = panel(door, 0.385, 0.615, 0.0, 0.535, np.array([0.055, 0.12, 0.10]))
    for m in range(1, 5):
        door = panel(
            door,
            0.385 + 0.046 * m - 0.003,
            0.385 + 0.046 * m + 0.003,
            0.0,
            0.535,
            np.array([0.02, 0.05, 0.04]),
        )
    door = panel(door, 0.595, 0.607, 0.24, 0.30, np.array([0.45, 0.40, 0.30]))
    window = walls
    for x0 in (0.16, 0.62):
        window = panel(window, x0, x0 + 0.22, 0.34, 0.80, white)
        for ix in range(2):
            for iy in range(2):
                window = panel(
                    window,
                    x0 + 0.022 + 0.092 * ix,
                    x0 + 0.022 + 0.092 * ix + 0.082,
                    0.375 + 0.205 * iy,
                    0.375 + 0.205 * iy + 0.185,
                    np.array([0.055, 0.075, 0.095]),
                )
    row = np.floor(y * 14.0)
    shingle = (x * 18.0 + 0.5 * (row % 2)) % 1.0
    tone = rng.uniform(0.7, 1.2, size=(15, 20))[
        row.astype(int), np.floor(x * 18.0 + 0.5 * (row % 2)).astype(int)
    ]
    moss = smoothstep(0.9, 2.0, tile_noise(tile, rng, exponent=1.5, low=1, high=40))
    roof = (
        np.array([0.115, 0.10, 0.09])
        * (tone * (0.6 + 0.4 * smoothstep(0.0, 0.35, (y * 14.0) % 1.0)))[..., None]
    )
    roof = np.where((shingle < 0.07)[..., None], roof * 0.6, roof)
    roof = roof + (0.6 * moss)[..., None] * (np.array([0.085, 0.11, 0.03]) - roof)
    atlas = np.concatenate(
        [np.concatenate([walls, door], axis=1), np.concatenate([window, roof], axis=1)], axis=0
    )
    return np.clip(atlas, 0.01, 0.9).astype(np.float32)
