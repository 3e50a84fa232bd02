# SPDX-License-Identifier: GPL-3.0-or-later
"""The sheet of docs/limits.md: each technique at its best beside the truth, and where it is wrong.

Run by `docs/pictures.py --only limits`; the references take minutes and are kept in build/trade. The page's
numbers go to the standard output.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import gpu
import matplotlib
import numpy as np
from _trade_measure import Accuracy, SceneBench
from _trade_points import optics_of
from PIL import Image, ImageDraw, ImageFont

from lake_water_addon.core.hits import HitErrors
from lake_water_addon.core.techniques import TECHNIQUES
from scripts.reference.measures import displayed, error_maps
from scripts.reference.truth import RayEnds, hidden_from, technique_errors

SCENE = "lake_near"
SIZE = (320, 240)
DETAIL = 0.3
HEADING = 24  # pixels over each row of the sheet

WRONG = 2.0
"""Pixels from which on a hit counts as wrong."""
PIXELS = (0.25, 64.0)
"""Ends of the maps of |W - W*|, logarithmic."""
FLIP = 0.5
"""End of the maps of FLIP."""
MISSED, FALSE, DRY = (255, 0, 200), (0, 220, 255), (60, 60, 60)

EXACT = {
    "samples": 16,
    "least_grid_resolution": 1024,
    "texture_size": 2048,
    "fov_ext": 1.5,
    "use_caustics": True,
    "caustics_size": 2048,
    "photon_size": 1024,
    "caustics_steps": 3,
    "light_depth_size": 4096,
}
PLAIN_POND = {
    "pond_bias_depth_strength": 0.0,
    "pond_bias_distance_strength": 0.0,
    "pond_specular": (0.0,) * 3,
}
PLAIN_RIPPLE = {"ripple_distance_strength": 0.0, "ripple_depth_strength": 0.0, "ripple_normal_strength": 0.2}
BEST: dict[str, dict[str, object]] = {
    "LAKE": {"refraction_steps": 128, "reflection_steps": 128, "use_exact_fresnel": True},
    "SIMPLE_LAKE": {"simple_lake_longest_path": 100.0, "simple_lake_step": 0.6, "c": 32.0},
    "POND": {"pond_bias": 0.3, "pond_power": 0.5, "pond_ripple_scale": (0.03, 0.03), **PLAIN_POND},
    "RIPPLE": {"ripple_angle_strength": 0.4, **PLAIN_RIPPLE},
    "TRACED": {"traced_march_steps": 128, "traced_bisection_steps": 8, "traced_thickness": 0.1},
}
"""What leaves the least error in this view, of a search over those dials of a technique that move it."""

MARKS: dict[str, tuple[tuple[int, int], ...]] = {
    "LAKE": ((185, 62), (36, 150), (100, 20)),
    "SIMPLE_LAKE": ((232, 88), (180, 70), (36, 110)),
    "POND": ((150, 110), (120, 40)),
    "RIPPLE": ((150, 110), (120, 40)),
    "TRACED": ((185, 62), (36, 150), (100, 20)),
}
"""Places in a technique's picture, from its upper left corner, that the page names by number."""


class Measured(NamedTuple):
    """One technique. picture: (h, w, 3) radiance; flip: (h, w); numbers: of the page's table, by heading."""

    picture: np.ndarray
    truth: np.ndarray
    flip: np.ndarray
    water: np.ndarray
    refracted: HitErrors
    reflected: HitErrors
    ends: tuple[RayEnds, RayEnds]
    found: tuple[np.ndarray, np.ndarray]
    numbers: dict[str, str]


def measure(bench: SceneBench, technique: str) -> Measured:
    settings = {**EXACT, **BEST[technique]}
    reference = bench.reference(optics_of(technique))
    picture, _ = bench.picture(technique, settings)
    flip = error_maps(reference.radiance, picture, bench.exposure).flip
    plan, hits = bench.hits(technique, settings)
    true = bench.true_hits()
    errors = technique_errors(plan, hits, true)
    inner = errors.mask & (reference.water > 0.99)
    ends = true.refracted, true.reflected
    found = hits.refracted[..., 3] > 0.5, hits.reflected[..., 3] > 0.5
    exists = tuple(np.isfinite(end.distance) for end in ends)
    bent = inner & exists[0] & ~(errors.refracted.pixels <= WRONG)
    mirrored = inner & ((exists[1] != found[1]) | (errors.reflected.pixels > WRONG))
    right = inner & ~bent & ~mirrored
    geometry, body = bench.tracer("project").geometry, plan.bodies[0]
    hidden = []
    for texture_pass, end, these in (
        (body.refraction, ends[0], inner & exists[0]),
        (body.reflection, ends[1], inner & exists[1]),
    ):
        hides = np.zeros(inner.shape, bool)
        hides[these] = hidden_from(texture_pass, end.point[these], geometry)
        hidden.append(hides)
    total = flip[inner].sum()

    def percent(part: np.ndarray, whole: np.ndarray) -> str:
        return f"{100.0 * part.sum() / max(whole.sum(), 1):.1f} %"

    def mean(values: np.ndarray, where: np.ndarray) -> str:
        return f"{values[where].mean():.3f}" if where.any() else "-"

    way = errors.refracted.distance / ends[0].distance
    return Measured(
        picture,
        reference.radiance,
        flip,
        errors.mask,
        errors.refracted,
        errors.reflected,
        ends,
        found,
        {
            "FLIP": mean(flip, inner),
            "refracted, median px": f"{np.nanmedian(errors.refracted.pixels):.2f}",
            "refracted, median part of d": f"{100.0 * np.nanmedian(way):.2f} %",
            "refracted wrong": percent(bent, inner),
            "its FLIP": mean(flip, bent),
            "part of all FLIP": f"{100.0 * flip[bent].sum() / total:.0f} %",
            "hidden from the texture's camera": percent(hidden[0], inner),
            "of the wrong": percent(hidden[0] & bent, bent),
            "reflected, median px": f"{np.nanmedian(errors.reflected.pixels):.2f}",
            "reflected wrong": percent(mirrored, inner),
            "its FLIP ": mean(flip, mirrored & ~bent),
            "part of all FLIP ": f"{100.0 * flip[mirrored & ~bent].sum() / total:.0f} %",
            "missed": percent(inner & exists[1] & ~found[1], inner & exists[1]),
            "false": percent(inner & ~exists[1] & found[1], inner & ~exists[1]),
            "hidden ": percent(hidden[1], inner & exists[1]),
            "both right": percent(right, inner),
            "its FLIP  ": mean(flip, right),
        },
    )


def _shown(picture: np.ndarray, exposure: float) -> np.ndarray:
    return np.round(255.0 * displayed(picture, exposure)).astype(np.uint8)


def _colored(values: np.ndarray, name: str) -> np.ndarray:
    """(..., 3) bytes of values in 0..1 by one of matplotlib's maps."""
    return matplotlib.colormaps[name](np.clip(values, 0.0, 1.0), bytes=True)[..., :3]


def _of_pixels(pixels: np.ndarray) -> np.ndarray:
    low, high = np.log2(PIXELS)
    return (np.log2(np.maximum(pixels, PIXELS[0])) - low) / (high - low)


def _error_map(errors: HitErrors, ends: RayEnds, found: np.ndarray, water: np.ndarray) -> np.ndarray:
    exists = np.isfinite(ends.distance)
    colors = _colored(_of_pixels(np.where(exists | found, np.nan_to_num(errors.pixels), 0.0)), "viridis")
    colors[exists & ~found] = MISSED
    colors[~exists & found] = FALSE
    colors[~water] = DRY
    return colors


def sheet() -> Image.Image:
    """A row a technique: truth, picture, error of refracted and of reflected hits, FLIP; scales below."""
    bench = SceneBench(SCENE, SIZE, DETAIL, Accuracy(), Path("build/trade"), max(os.cpu_count() // 2, 1))
    gpu.init()
    width, height = SIZE
    rows = len(TECHNIQUES)
    picture = Image.new("RGB", (5 * width, rows * (height + HEADING) + 2 * HEADING), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(15)
    try:
        for row, (name, technique) in enumerate(TECHNIQUES.items()):
            got = measure(bench, name)
            print(f"{technique.label}: " + "; ".join(f"{k.strip()} {v}" for k, v in got.numbers.items()))
            panels = {
                f"{technique.label}: what it should be": _shown(got.truth, bench.exposure),
                "what it is": _shown(got.picture, bench.exposure),
                "refracted |W - W*|": _error_map(got.refracted, got.ends[0], got.found[0], got.water),
                "reflected |W - W*|": _error_map(got.reflected, got.ends[1], got.found[1], got.water),
                "FLIP": _colored(got.flip / FLIP, "magma"),
            }
            top = row * (height + HEADING)
            for column, (text, panel) in enumerate(panels.items()):
                draw.text((column * width + 6, top + 3), text, "black", font)
                picture.paste(Image.fromarray(panel[::-1].copy()), (column * width, top + HEADING))
            for number, (x, y) in enumerate(MARKS.get(name, ()), 1):
                for column in range(1, 5):
                    _mark(draw, font, (column * width + x, top + HEADING + y), str(number))
    finally:
        bench.close()
    _scales(picture, rows * (height + HEADING), font)
    return picture


def _mark(draw: ImageDraw.ImageDraw, font: ImageFont.ImageFont, at: tuple[int, int], text: str) -> None:
    x, y = at
    draw.ellipse((x - 9, y - 9, x + 9, y + 9), fill="white", outline="black")
    draw.text((x, y), text, "black", font, anchor="mm")


def _scales(picture: Image.Image, top: int, font: ImageFont.ImageFont) -> None:
    width = SIZE[0]
    draw = ImageDraw.Draw(picture)
    ramp = np.linspace(0.0, 1.0, 2 * width - 160)[None].repeat(12, axis=0)
    left = 2 * width + 6
    picture.paste(Image.fromarray(_colored(ramp, "viridis")), (left, top + 8))
    for pixels in (0.25, 1.0, 4.0, 16.0, 64.0):
        x = left + _of_pixels(np.array(pixels)) * (ramp.shape[1] - 1)
        draw.text((x, top + 22), f"{pixels:g} px", "black", font, anchor="ma" if 0.25 < pixels < 64 else "la")
    for i, (text, color) in enumerate((("missed", MISSED), ("false", FALSE))):
        x, y = left + ramp.shape[1] + 60, top + 6 + 20 * i
        draw.rectangle((x, y, x + 14, y + 14), fill=color)
        draw.text((x + 20, y - 2), text, "black", font)
    flip_ramp = np.linspace(0.0, 1.0, width - 12)[None].repeat(12, axis=0)
    picture.paste(Image.fromarray(_colored(flip_ramp, "magma")), (4 * width + 6, top + 8))
    draw.text((4 * width + 6, top + 22), "0", "black", font)
    draw.text((5 * width - 6, top + 22), f"{FLIP:g}", "black", font, anchor="ra")
