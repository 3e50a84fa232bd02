# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots and pictures of the trade between time and error."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from _trade_front import Row, front
from _trade_points import DEFAULT, SWEEPS, Sweep, point, sweep_points
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from PIL import Image, ImageDraw, ImageFont

from lake_water_addon.core.parameters import OWN
from lake_water_addon.core.quality import QUALITIES
from lake_water_addon.core.snapshot import WaterSettings
from lake_water_addon.core.techniques import TECHNIQUES

COLORS = {
    "LAKE": "#1f6fb4",
    "SIMPLE_LAKE": "#56b4e9",
    "POND": "#009e73",
    "RIPPLE": "#b0892a",
    "TRACED": "#c23b22",
    "EEVEE": "#e68a00",
    "CYCLES": "#7a4fa3",
}
QUALITY_LETTERS = {"DRAFT": "D", "BALANCED": "B", "FINE": "F", "BEST": "X"}
BOUND = 0.02
"""Of the length of a refracted ray: the aim for the middle error of three steps."""

SETTINGS = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
}


def save_figure(figure: Figure, path: Path) -> None:
    """A PNG with a palette: a third of the size, and nothing is seen of it."""
    written = io.BytesIO()
    figure.savefig(written, format="png", dpi=100)
    plt.close(figure)
    written.seek(0)
    with Image.open(written) as image:
        image.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


def _plain(axis) -> None:
    """Numbers as one reads them, on a logarithmic axis."""
    axis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def plot_scene(rows: Sequence[Row], engines: Sequence[Mapping[str, object]], title: str, path: Path) -> None:
    """Time against error of one scene: all points, each technique's front, qualities and engines.

    engines: with engine, label, ratio and flip.
    """
    with plt.rc_context(SETTINGS):
        figure, axes = plt.subplots(figsize=(8.6, 5.2), layout="constrained")
        for technique, color in COLORS.items():
            of = [row for row in rows if row.technique == technique]
            if not of:
                continue
            axes.plot(
                [r["ratio"] for r in of], [r["flip"] for r in of], ".", color=color, alpha=0.45, ms=6, mew=0
            )
            best = front(of)
            axes.step(
                [r["ratio"] for r in best],
                [r["flip"] for r in best],
                where="post",
                color=color,
                lw=1.4,
                label=TECHNIQUES[technique].label,
            )
            for row in of:
                if row.quality and technique in (DEFAULT, "TRACED"):
                    axes.plot(row["ratio"], row["flip"], "o", color=color, ms=11, mec="white", mew=0.8)
                    letter = QUALITY_LETTERS[row.quality]
                    at = (row["ratio"], row["flip"])
                    axes.annotate(letter, at, color="white", fontsize=7, ha="center", va="center")
        for engine, marker in (("EEVEE", "s"), ("CYCLES", "^")):
            of = sorted((e for e in engines if e["engine"] == engine), key=lambda e: e["ratio"])
            if not of:
                continue
            axes.plot(
                [e["ratio"] for e in of],
                [e["flip"] for e in of],
                marker,
                color=COLORS[engine],
                ms=6,
                label=engine.title() if engine == "CYCLES" else engine,
            )
            for e in of:
                at = (e["ratio"], e["flip"])
                axes.annotate(
                    str(e["short"]), at, (4, 4), textcoords="offset points", fontsize=7, color=COLORS[engine]
                )
        axes.set_xscale("log")
        axes.set_yscale("log")
        _plain(axes.xaxis)
        _plain(axes.yaxis)
        axes.yaxis.set_major_locator(LogLocator(10.0, (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        axes.set_xlabel("time of a picture, as a multiple of the scene without water")
        axes.set_ylabel("mean FLIP on the water")
        axes.set_title(title, loc="left", fontsize=10)
        letters = ", ".join(f"{letter} {QUALITIES[name].label}" for name, letter in QUALITY_LETTERS.items())
        axes.text(1.0, 1.01, letters, transform=axes.transAxes, ha="right", va="bottom", fontsize=8)
        axes.legend(loc="upper right", fontsize=8, ncols=2)
        save_figure(figure, path)


def _shown(sweep: Sweep, settings: Mapping[str, object]) -> object:
    """The value of a sweep's dial in a point: where it names none, the default."""
    if sweep.dial in settings:
        return settings[sweep.dial]
    if sweep.dial in OWN:
        return OWN[sweep.dial].default
    return getattr(WaterSettings(), sweep.dial)


def _series(rows: Sequence[Row], technique: str, sweep: Sweep, column: str) -> tuple[list, list[float]]:
    by_key = {row.key: row for row in rows if row.technique == technique}
    found = []
    for settings in sweep_points(technique, sweep):
        row = by_key.get((technique, tuple(settings.items())))
        if row is not None and np.isfinite(row[column]):
            found.append((_shown(sweep, row.settings), row[column]))
    found.sort(key=lambda pair: pair[0])
    return [value for value, _ in found], [measured for _, measured in found]


def _places(values: Sequence[object]) -> tuple[list[int], list[str]]:
    """One place for each value, as far apart as the next."""
    told = [
        ("off", "on")[v] if isinstance(v, bool) else f"{v:g}" if not isinstance(v, str) else v for v in values
    ]
    return list(range(len(values))), [
        text.replace("GPU_", "").title() if "_" in text else text for text in told
    ]


def _panel(
    axes: Axes,
    rows: Sequence[Row],
    scenes: Sequence[str],
    technique: str,
    sweep: Sweep,
    column: str,
    color: str,
) -> bool:
    """Thin lines for the scenes, a thick one for their mean. False where nothing was measured."""
    lines = {}
    for scene in scenes:
        values, measured = _series([r for r in rows if r.scene == scene], technique, sweep, column)
        if len(values) > 1:
            lines[scene] = dict(zip(values, measured, strict=True))
    if not lines:
        return False
    shared = [v for v in max(lines.values(), key=len) if all(v in line for line in lines.values())]
    places, labels = _places(shared)
    for line in lines.values():
        axes.plot(places, [line[v] for v in shared], color=color, lw=0.7, alpha=0.35)
    if column == "ratio":
        mean = [float(np.exp(np.mean([np.log(line[v]) for line in lines.values()]))) for v in shared]
    else:
        mean = [float(np.mean([line[v] for line in lines.values()])) for v in shared]
    axes.plot(places, mean, "o-", color=color, lw=2.0, ms=4)
    axes.set_xticks(places, labels)
    base = _shown(sweep, point(technique, sweep.around))
    if base in shared:
        axes.get_xticklabels()[shared.index(base)].set_fontweight("bold")
    return True


def plot_settings(rows: Sequence[Row], technique: str, path: Path) -> bool:
    """One setting at a time around the base: error on the left axis, time on the right. False without any."""
    scenes = list(dict.fromkeys(row.scene for row in rows))
    sweeps = [s for s in SWEEPS if len(_series(rows, technique, s, "flip")[0]) > 1]
    if not sweeps:
        return False
    columns = min(4, len(sweeps))
    lines = -(-len(sweeps) // columns)
    with plt.rc_context({**SETTINGS, "font.size": 8}):
        figure, grid = plt.subplots(
            lines, columns, figsize=(2.75 * columns, 2.1 * lines + 0.3), layout="constrained", squeeze=False
        )
        for axes, sweep in zip(grid.flat, sweeps, strict=False):
            _panel(axes, rows, scenes, technique, sweep, "flip", COLORS["LAKE"])
            right = axes.twinx()
            right.grid(visible=False)
            right.spines["right"].set_visible(True)
            _panel(right, rows, scenes, technique, sweep, "ratio", COLORS["EEVEE"])
            right.tick_params(axis="y", colors=COLORS["EEVEE"])
            axes.tick_params(axis="y", colors=COLORS["LAKE"])
            for side in (axes, right):
                side.set_ylim(0.0, 1.08 * max(1e-3, side.get_ylim()[1]))
            axes.set_title(sweep.label, fontsize=9, loc="left")
        for axes in list(grid.flat)[len(sweeps) :]:
            axes.set_axis_off()
        figure.get_layout_engine().set(rect=(0.0, 0.0, 0.975, 1.0))
        figure.supylabel("mean FLIP on the water", color=COLORS["LAKE"], fontsize=9)
        place = {"rotation": 90, "ha": "right", "va": "center"}
        figure.text(0.998, 0.5, "time / scene without water", color=COLORS["EEVEE"], fontsize=9, **place)
        save_figure(figure, path)
    return True


GEOMETRY = (
    ("intersection_steps", "refracted_median_share", "Intersection steps", "median |W − W*| / d, refracted"),
    ("texture_size", "refracted_median_pixels", "Texture size", "median error in pixels, refracted"),
    ("fov_ext", "refracted_missed", "FOV extension", "share of refracted rays that find nothing"),
    ("reflection_steps", "reflected_median_pixels", "Reflection steps", "median error in pixels, reflected"),
    (
        "reflection_steps",
        "reflected_missed",
        "Reflection steps",
        "share of what is mirrored that is not found",
    ),
    ("photon_size", "caustics_correlation", "Photons a side", "caustics' correlation with the count"),
)
"""Dial, column and their names."""


def plot_geometry(rows: Sequence[Row], labels: Mapping[str, str], path: Path) -> bool:
    """What the rays' and the caustics' own errors do, for Lake: a line a scene. False without any."""
    by_dial = {sweep.dial: sweep for sweep in SWEEPS}
    colors = dict(zip(labels, plt.get_cmap("tab10").colors, strict=False))
    with plt.rc_context({**SETTINGS, "font.size": 8}):
        figure, grid = plt.subplots(2, 3, figsize=(10.5, 5.6), layout="constrained")
        drawn = False
        for axes, (dial, column, label, told) in zip(grid.flat, GEOMETRY, strict=True):
            for scene, color in colors.items():
                of = [row for row in rows if row.scene == scene]
                values, measured = _series(of, DEFAULT, by_dial[dial], column)
                if len(values) > 1:
                    drawn = True
                    places, ticks = _places(values)
                    axes.plot(places, measured, "o-", ms=3, lw=1.2, color=color, label=labels[scene])
                    axes.set_xticks(places, ticks)
            if dial == "intersection_steps":
                axes.axhline(BOUND, color="#444444", lw=0.8, ls="--")
                axes.set_yscale("log")
                _plain(axes.yaxis)
            elif "pixels" in column:
                axes.set_yscale("log")
                _plain(axes.yaxis)
            axes.set_title(told, fontsize=8.5, loc="left")
            axes.set_xlabel(label)
        handles, names = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=8, fontsize=8)
        if drawn:
            save_figure(figure, path)
        else:
            plt.close(figure)
    return drawn


# Pictures

TILE = (256, 192)
TEXT = 16
"""px: the height of a line of text over a tile."""


def to_8_bit(displayed: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8, first row at the top, of a displayed picture in 0..1, first row at the bottom."""
    return np.round(255.0 * np.clip(displayed[::-1], 0.0, 1.0)).astype(np.uint8)


def flip_colors(flip: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8, first row at the top: magma, as FLIP's authors show it, black for 0 and pale for 1."""
    return to_8_bit(plt.get_cmap("magma")(np.clip(flip, 0.0, 1.0))[..., :3])


def contact_sheet(lines: Sequence[Sequence[tuple[str, np.ndarray | None]]], path: Path, tile=TILE) -> None:
    """Rows of pictures (h, w, 3) uint8 with a line of text over each; None leaves the place empty."""
    width, height = tile
    columns = max(map(len, lines))
    sheet = Image.new("RGB", (columns * (width + 4) - 4, len(lines) * (height + TEXT + 4) - 4), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(11)
    for y, line in enumerate(lines):
        for x, (text, picture) in enumerate(line):
            left, top = x * (width + 4), y * (height + TEXT + 4)
            draw.text((left + 1, top + 1), text, fill="black", font=font)
            if picture is not None:
                shown = Image.fromarray(picture).resize(tile, Image.Resampling.LANCZOS)
                sheet.paste(shown, (left, top + TEXT))
    sheet.save(path, quality=80, optimize=True, progressive=True)
