# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark's figures as tables and sentences, for a terminal or for a page in Markdown."""

from __future__ import annotations

from dataclasses import dataclass

from _bench_kinds import TECHNIQUE_KINDS


@dataclass(frozen=True)
class Table:
    """header and rows: as many cells each; the first column is text, the others are numbers."""

    header: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def markdown(self) -> str:
        rule = ("---", *("--:" for _ in self.header[1:]))
        return "\n".join(f"| {' | '.join(row)} |" for row in (self.header, rule, *self.rows))

    def text(self) -> str:
        rows = (self.header, *self.rows)
        widths = [max(len(row[i]) for row in rows) for i in range(len(self.header))]
        return "\n".join(
            "  " + "  ".join((row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:]))).rstrip()
            for row in rows
        )


def report(figures: dict, *, markdown: bool) -> str:
    """All that was measured. figures: as `benchmark.py frames --json` writes them."""
    parts = [
        _machine(figures),
        _kinds(figures),
        _passes(figures),
        _ratios(figures),
        _techniques(figures),
        _made(figures),
        _moving_sun(figures),
        _grid(figures),
        _memory(figures),
    ]
    shown = [part for part in parts if part]
    return "\n\n".join(
        part if isinstance(part, str) else part.markdown() if markdown else part.text() for part in shown
    )


def _number(value: float) -> str:
    """Three digits, as far as they go without an exponent."""
    return f"{value:.2f}" if abs(value) < 9.995 else f"{value:.1f}" if abs(value) < 99.95 else f"{value:.0f}"


def _machine(figures: dict) -> str:
    device, scene = figures["machine"], figures["scene"]
    width, height = scene["resolution"]
    return (
        f"{device['renderer']}, {device['driver']}, Blender {device['blender']}.\n"
        f"{scene['vertices']:,} vertices in {scene['instances']} instances, "
        f"{scene['draw_calls']} draw calls; "
        f"{width} × {height}, textures of {scene['texture_size']}², caustics of {scene['caustics_size']}² "
        f"texels and {scene['photon_size']}² photons, unless said otherwise; "
        f"medians of {scene['repeats']} rounds."
    )


def _shown_kinds(figures: dict) -> dict[str, dict]:
    """Those of the main tables: techniques have one of their own."""
    return {name: kind for name, kind in figures["kinds"].items() if name not in TECHNIQUE_KINDS}


def _kinds(figures: dict) -> Table | None:
    rows = [
        (
            kind["label"],
            _number(kind["frame_ms"]),
            "–".join(_number(value) for value in kind["frame_ms_quartiles"]),
            _number(kind["frames_per_second"]),
            _number(kind["extraction_ms"]),
            _number(kind["planning_ms"]),
        )
        for kind in _shown_kinds(figures).values()
    ]
    header = ("kind of frame", "ms", "middle half", "per second", "extraction, ms", "planning, ms")
    return Table(header, rows) if rows else None


def _passes(figures: dict) -> Table | None:
    kinds = _shown_kinds(figures).values()
    by_length = sorted(kinds, key=lambda kind: -len(kind["passes_ms"]))
    names = list(dict.fromkeys(name for kind in by_length for name in kind["passes_ms"]))
    rows = [
        (
            kind["label"],
            *(_number(kind["passes_ms"][name]) if name in kind["passes_ms"] else "" for name in names),
        )
        for kind in kinds
    ]
    return Table(("passes, ms", *names), rows) if rows else None


def _ratios(figures: dict) -> Table | None:
    rows = []
    for ratio in figures["ratios"]:
        aim = ""
        if ratio["aim"] is not None:
            aim = f"{'at least' if ratio['at_least'] else 'at most'} {ratio['aim']:.2f}"
            aim += ": yes" if ratio["met"] else ": no"
        rows.append(
            (
                ratio["label"],
                f"{ratio['median']:.2f}",
                "–".join(f"{value:.2f}" for value in ratio["quartiles"]),
                aim,
                "" if ratio["thesis"] is None else f"{ratio['thesis']:.2f}",
            )
        )
    return Table(("ratio", "median of pairs", "middle half", "aim", "thesis"), rows) if rows else None


def _techniques(figures: dict) -> Table | None:
    rows = [
        (
            technique["label"],
            _number(technique["frame_ms"]),
            _number(technique["water_pass_ms"]),
            f"{technique['ratio_to_scene_without_water']:.2f}",
        )
        for technique in figures["techniques"].values()
    ]
    header = ("technique", "frame, ms", "water pass, ms", "frame / scene without water")
    return Table(header, rows) if rows else None


def _things(made: dict[str, int]) -> str:
    return ", ".join(f"{number} {kind}" for kind, number in made.items()) or "nothing"


def _made(figures: dict) -> str:
    first, kinds = figures["first_frame"], figures["kinds"]
    lines = [
        f"The first frame of the process ({kinds[first['kind']]['label']}) took {first['frame_s']:.2f} s, "
        f"of it extraction {first['extraction_s']:.2f} s, and made {_things(first['created'])}."
    ]
    lines += [
        f"Made in {kind['frames']} frames in which only the time changed, {kind['label']}: "
        f"{_things(kind['made'])}."
        for kind in kinds.values()
        if kind["made"]
    ]
    others = "the others" if len(lines) > 1 else "frames in which only the time changed"
    lines.append(f"Made in {others}: nothing.")
    return "\n".join(lines)


def _moving_sun(figures: dict) -> str:
    if "moving_sun" not in figures:
        return ""
    frame, passes = figures["moving_sun"]["frame_ms"], figures["moving_sun"]["passes_ms"]
    drawn = " and ".join(
        f"{_number(passes[name])} ms the {name}" for name in ("shadow depth", "light depth") if name in passes
    )
    return f"While the sun moves, a frame takes {_number(frame)} ms, of it {drawn}, else drawn but once."


def _grid(figures: dict) -> Table | None:
    rows = [
        (f"{size}²", _number(times["extraction_and_planning_ms"]), _number(times["frame_ms"]))
        for size, times in figures.get("grid", {}).items()
    ]
    header = ("vertices of the water grid", "extraction and planning, ms", "whole frame, ms")
    return Table(header, rows) if rows else None


def _memory(figures: dict) -> str:
    if "memory" not in figures:
        return ""
    memory = figures["memory"]
    return (
        f"Memory over {memory['frames']} frames: {memory['growth_kib']:+.0f} KiB; "
        f"made: {_things(memory['made'])}."
    )
