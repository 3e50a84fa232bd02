# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes what `benchmark.py trade` measured: trade.md, trade.csv and the pictures in images/trade."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from _bench_report import Table
from _trade_front import Row, better_than, front, mean_rows, quality_rows, row_of, write_rows
from _trade_points import BASE, DEFAULT, DIALS, optics_of, point, without_caustics
from _trade_table import ERRORS, KEY, TIMES, picture_file, reference_file
from _trade_text import AGREEMENT, AIMS, ENGINES, HOW, INTRODUCTION, LIMITS

from lake_water_addon.core.quality import QUALITIES
from lake_water_addon.core.techniques import TECHNIQUES

IMAGES = "images/trade"
FASTER_THAN_EEVEE = 100.0
FASTER_THAN_CYCLES = 200.0
EEVEE_SAMPLES = 16


@dataclass(frozen=True, eq=False)
class Engine:
    """A picture by another engine. values: `flip`, `ratio`, `seconds` and more.

    others: part of the processor that other programs had. to_converged: FLIP on the water from Cycles'
    converged picture; commit: of the extension, whose nodes it rendered.
    """

    scene: str
    engine: str
    label: str
    samples: int
    denoised: bool
    direct: bool
    converged: bool
    values: Mapping[str, float]
    picture: np.ndarray | None
    others: float
    to_converged: float = math.nan
    commit: str = ""


@dataclass(frozen=True, eq=False)
class Measured:
    """All of a run. labels: of scenes, in order; about: what measured it, and when."""

    folder: Path
    rows: list[Row]
    lines: dict[tuple, Mapping[str, str]]
    labels: dict[str, str]
    about: Mapping[str, object]
    engines: list[Engine]

    def of(self, scene: str, technique: str | None = None) -> list[Row]:
        return [r for r in self.rows if r.scene == scene and technique in (None, r.technique)]

    def quality(self, scene: str, name: str, technique: str = DEFAULT) -> Row | None:
        return next((r for r in self.of(scene, technique) if r.quality == name), None)

    def without_caustics(self, scene: str) -> Row | None:
        """Lake's Balanced without them."""
        of = self.of(scene, DEFAULT)
        return next((r for r in of if r.settings == without_caustics(max(r.size))), None)

    def picture(self, row: Row) -> np.ndarray | None:
        """(h, w, 3), None where it was not kept."""
        path = picture_file(self.folder, self.lines[row.scene, row.key])
        if not path.exists():
            return None
        with np.load(path) as kept:
            return kept["picture"].astype(np.float64)

    def reference(self, row: Row) -> tuple[np.ndarray, np.ndarray] | None:
        """Radiance (h, w, 3) and water (h, w) of what a point is compared with; None without errors."""
        line = self.lines[row.scene, row.key]
        if "photons" not in line:
            return None
        path = reference_file(self.folder, line, optics_of(row.technique))
        if not path.exists():
            return None
        with np.load(path) as kept:
            return kept["radiance"].astype(np.float64), kept["water"].astype(np.float64)

    def exposure(self, scene: str) -> float:
        return float(self.about["scenes"][scene]["exposure"])


def _newest(lines: Sequence[Mapping[str, str]]) -> list[Mapping[str, str]]:
    """Those of each scene as it was measured last."""
    last = {line["scene"]: (line["size"], line["content"]) for line in lines}
    return [line for line in lines if (line["size"], line["content"]) == last[line["scene"]]]


def _lines(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def read_measured(folder: Path) -> Measured:
    """The tables that a run wrote. ValueError where there are none."""
    errors, times = _newest(_lines(folder / "errors.csv")), _newest(_lines(folder / "times.csv"))
    if not errors and not times:
        raise ValueError(f"there are no measurements in {folder}: run `benchmark.py trade` first")
    about = json.loads((folder / "run.json").read_text())
    merged: dict[tuple[str, ...], dict[str, str]] = {}
    for line in (*errors, *times):
        merged.setdefault(tuple(line.get(name, "") for name in KEY), {}).update(line)
    labels = {name: told["label"] for name, told in about["scenes"].items()}
    order = list(labels)
    found = [(row_of(line), line) for line in merged.values()]
    found.sort(key=lambda pair: (order.index(pair[0].scene), list(TECHNIQUES).index(pair[0].technique)))
    lines = {(row.scene, row.key): line for row, line in found}
    labels = {name: labels[name] for name in order if any(row.scene == name for row, _ in found)}
    measured = Measured(folder, [row for row, _ in found], lines, labels, about, [])
    measured.engines.extend(_engines(measured))
    return measured


def _engines(measured: Measured) -> list[Engine]:
    found = []
    lines = _newest(_lines(measured.folder / "engines.csv"))
    for line in {(line["scene"], line["label"]): line for line in lines}.values():
        if line["scene"] not in measured.labels:
            continue
        numbers = {n: float(t) for n, t in line.items() if n in (*ERRORS, *TIMES) and t}
        picture = None
        path = measured.folder / "pictures" / line["picture"]
        if path.exists():
            with np.load(path) as kept:
                picture = kept["picture"].astype(np.float64)
        found.append(
            Engine(
                line["scene"],
                line["engine"],
                line["label"],
                int(line["samples"]),
                line["denoised"] == "yes",
                line["direct"] == "yes",
                line["converged"] == "yes",
                numbers,
                picture,
                float(line["shared"] or 0.0),
                commit=line["commit"],
            )
        )
    compared = []
    for e in found:
        converged = next((o for o in found if o.scene == e.scene and o.converged), None)
        away = math.nan
        if converged is not None and e is not converged and e.picture is not None:
            water = measured.reference(measured.of(e.scene, DEFAULT)[0])[1]
            away = _flip(measured, e.scene, converged.picture, e.picture, water)
        compared.append(Engine(**{**e.__dict__, "to_converged": away}))
    return compared


# Text


def _milli(seconds: float) -> str:
    return f"{1000 * seconds:.0f}"


def _ratio(value: float) -> str:
    return (
        ""
        if math.isnan(value)
        else f"{value:.2f}"
        if value < 10
        else f"{value:.1f}"
        if value < 100
        else f"{value:.0f}"
    )


def _error(value: float) -> str:
    """Three digits after the point, rounded up: an aim is not reached by rounding."""
    return "" if math.isnan(value) else f"{math.ceil(1000 * value - 1e-9) / 1000:.3f}"


def _percent(value: float, digits: int = 1) -> str:
    if math.isnan(value):
        return ""
    return f"{math.ceil(100 * value * 10**digits - 1e-9) / 10**digits:.{digits}f} %"


def _verdict(reached: bool) -> str:
    return "yes" if reached else "**no**"


def _settings_words(settings: Mapping[str, object]) -> str:
    """A point of a quality's dials, in one line."""
    steps = settings.get("caustics_steps", 1)
    told = (
        ("samples", lambda v: f"{v} samples" if v > 1 else "1 sample"),
        ("texture_size", "texture {}".format),
        ("fov_ext", "FOV {:g}".format),
        ("least_grid_resolution", "grid {}".format),
        ("intersection_steps", lambda v: f"{v} steps" if v > 1 else "1 step"),
        ("refraction_steps", lambda v: f"refraction {v}" if v else ""),
        ("reflection_steps", "reflection {}".format),
        ("use_exact_fresnel", lambda v: "exact Fresnel" if v else "Schlick"),
        ("caustics_size", "caustics {}".format),
        ("photon_size", lambda v: f"photons {v}" + (f" of {steps} steps" if steps > 1 else "")),
        ("light_depth_size", "light {}".format),
    )
    return ", ".join(filter(None, (say(settings[name]) for name, say in told if name in settings)))


def _other_words(settings: Mapping[str, object], base: Mapping[str, object]) -> str:
    told = [f"{n.replace('_', ' ')} {v}" for n, v in settings.items() if base.get(n) != v]
    told += [f"no {n.replace('_', ' ')}" for n in ("use_caustics",) if n not in settings]
    return ", ".join(told) or "the base"


def qualities_table(measured: Measured, technique: str) -> Table:
    """FLIP on the water and time of each quality in each scene."""
    names = [n for n in QUALITIES if any(measured.quality(s, n, technique) for s in measured.labels)]
    header = (
        "scene",
        *(f"{QUALITIES[n].label}: FLIP" for n in names),
        *(f"{QUALITIES[n].label}: time" for n in names),
    )
    rows = []
    for scene, label in measured.labels.items():
        of = [measured.quality(scene, n, technique) for n in names]
        rows.append(
            (
                label,
                *(_error(r["flip"]) if r else "" for r in of),
                *(_ratio(r["ratio"]) if r else "" for r in of),
            )
        )
    means = {r.quality: r for r in mean_rows(measured.rows, technique) if r.quality}
    rows.append(
        (
            "mean",
            *(_error(means[n]["flip"]) if n in means else "" for n in names),
            *(_ratio(means[n]["ratio"]) if n in means else "" for n in names),
        )
    )
    return Table(header, rows)


def front_table(measured: Measured, technique: str) -> Table:
    """The front of the means over the scenes."""
    rows = [
        (
            f"{_settings_words(row.settings)}"
            + (f" (**{QUALITIES[row.quality].label}**)" if row.quality else ""),
            _ratio(row["ratio"]),
            _error(row["flip"]),
            _error(row["hdr_flip"]),
            f"{row['ssim']:.3f}",
        )
        for row in front(quality_rows(mean_rows(measured.rows, technique)))
    ]
    return Table(("settings", "time", "FLIP", "HDR-FLIP", "SSIM"), rows)


def on_front_lines(measured: Measured) -> list[str]:
    """For each quality, whether it is a point of the front of the means, and if not, what is better."""
    rivals = quality_rows(mean_rows(measured.rows, DEFAULT))
    lines = []
    for row in rivals:
        if not row.quality:
            continue
        better = better_than(row, rivals)
        label = QUALITIES[row.quality].label
        if better:
            best = min(better, key=lambda r: r["flip"])
            lines.append(
                f"- {label}: **not on the front**: {_settings_words(best.settings)} takes "
                f"{best['ratio'] / row['ratio']:.2f} of its time and leaves {best['flip'] / row['flip']:.2f} "
                "of its error."
            )
        else:
            lines.append(f"- {label}: on the front.")
    return lines


def floors_table(measured: Measured) -> Table:
    """The least FLIP on the water that any setting of a technique left, in each scene."""
    techniques = [
        t for t in TECHNIQUES if any(r.technique == t and "flip" in r.values for r in measured.rows)
    ]
    rows = []
    for scene, label in measured.labels.items():
        least = [
            min((r["flip"] for r in measured.of(scene, t) if "flip" in r.values), default=math.nan)
            for t in techniques
        ]
        rows.append((label, *map(_error, least)))
    return Table(("scene", *(TECHNIQUES[t].label for t in techniques)), rows)


def geometry_table(measured: Measured) -> Table:
    """Errors of rays of the base of each technique, medians over scenes."""
    header = (
        "technique",
        "refracted: m",
        "of d",
        "texels",
        "pixels",
        "beyond a texel",
        "missed",
        "false",
        "reflected: pixels",
        "beyond a texel",
        "missed",
        "false",
    )
    rows = []
    for technique in TECHNIQUES:
        base = point(technique, {})
        of = [
            r for r in measured.rows if r.technique == technique and r.settings == base and "flip" in r.values
        ]
        if not of:
            continue

        def middle(column: str, of: list[Row] = of) -> float:
            given = [r[column] for r in of if column in r.values]
            return float(np.median(given)) if given else math.nan

        rows.append(
            (
                TECHNIQUES[technique].label,
                f"{middle('refracted_median_m'):.3f}",
                _percent(middle("refracted_median_share")),
                _ratio(middle("refracted_median_texels")),
                _ratio(middle("refracted_median_pixels")),
                _percent(middle("refracted_beyond"), 0),
                _percent(middle("refracted_missed")),
                _percent(middle("refracted_false")),
                _ratio(middle("reflected_median_pixels")),
                _percent(middle("reflected_beyond"), 0),
                _percent(middle("reflected_missed"), 0),
                _percent(middle("reflected_false"), 0),
            )
        )
    return Table(header, rows)


def caustics_table(measured: Measured) -> Table:
    """How near to the count of photons the caustics of each quality come."""
    names = list(QUALITIES)
    rows = []
    for scene, label in measured.labels.items():
        of = [measured.quality(scene, n) for n in names]
        cells = [
            f"{r['caustics_correlation']:.3f}, {r['caustics_contrast']:.2f}, {r['caustics_energy']:.2f}"
            if r and "caustics_correlation" in r.values
            else ""
            for r in of
        ]
        if any(cells):
            rows.append((label, *cells))
    return Table(("scene", *(QUALITIES[n].label for n in names)), rows)


def other_settings_table(measured: Measured, technique: str) -> Table:
    """One setting at a time around the base, for a technique without a plot of its own: means over scenes."""
    base = point(technique, {})
    means = mean_rows(measured.rows, technique)
    model = next((r for r in means if r.settings == base), None)
    rows = []
    for row in means:
        changed = sum(row.settings.get(n) != base.get(n) for n in DIALS)
        if model is not None and changed <= 5 and not (row.quality and row.settings != base):
            rows.append((_other_words(row.settings, base), _ratio(row["ratio"]), _error(row["flip"])))
    return Table((f"{TECHNIQUES[technique].label}: what differs from the base", "time", "FLIP"), rows)


def engines_table(measured: Measured) -> Table:
    """EEVEE and Cycles beside Balanced, in the scenes that they were measured in."""
    rows = []
    for scene, label in measured.labels.items():
        of = [e for e in measured.engines if e.scene == scene]
        if not of:
            continue
        for words, row in (
            ("Lake, Balanced", measured.quality(scene, "BALANCED")),
            ("Lake, Balanced, no caustics", measured.without_caustics(scene)),
        ):
            if row is not None:
                rows.append(
                    (
                        f"{label}: {words}",
                        f"{row['seconds']:.2f}",
                        _ratio(row["ratio"]),
                        _error(row["flip"]),
                        _error(_to_converged(measured, row)),
                        "",
                    )
                )
        rows += [
            (
                f"{label}: {e.label}",
                f"{e.values['seconds']:.1f}",
                _ratio(e.values.get("ratio", math.nan)),
                _error(e.values.get("flip", math.nan)),
                _error(e.to_converged),
                _percent(e.others, 0),
            )
            for e in of
        ]
    return Table(
        ("picture", "s", "time", "FLIP to the image truth", "FLIP to Cycles' converged picture", "shared"),
        rows,
    )


def _converged(measured: Measured, scene: str) -> Engine | None:
    return next((e for e in measured.engines if e.scene == scene and e.converged), None)


def _to_converged(measured: Measured, row: Row) -> float:
    """FLIP on the water between a kept picture and Cycles' converged one."""
    converged, picture = _converged(measured, row.scene), measured.picture(row)
    if converged is None or converged.picture is None or picture is None:
        return math.nan
    return _flip(measured, row.scene, converged.picture, picture, measured.reference(row)[1])


def cycles_ratio_at(engines: Sequence[Engine], flip: float) -> tuple[float, str]:
    """(time, "", "at most" or "more than") that Cycles takes to come so near to its own converged picture.

    As a multiple of the dry scene's time; between two numbers of samples along a straight line of logarithms.
    """
    best = math.nan, ""
    for denoised in (False, True):
        of = sorted(
            (
                e
                for e in engines
                if e.engine == "CYCLES" and e.denoised == denoised and not (e.converged or e.direct)
            ),
            key=lambda e: e.values["ratio"],
        )
        of = [e for e in of if math.isfinite(e.to_converged)]
        if not of:
            continue
        found = of[-1].values["ratio"], "more than"
        for i, e in enumerate(of):
            if e.to_converged <= flip:
                if i == 0:
                    found = e.values["ratio"], "at most"
                else:
                    before = of[i - 1]
                    share = math.log(before.to_converged / flip) / math.log(
                        before.to_converged / e.to_converged
                    )
                    found = before.values["ratio"] ** (1 - share) * e.values["ratio"] ** share, ""
                break
        if math.isnan(best[0]) or (
            found[1] != "more than" and (best[1] == "more than" or found[0] < best[0])
        ):
            best = found
    return best


@dataclass(frozen=True)
class Verdict:
    """What came of an aim in a scene. reached: None where it does not apply."""

    told: str
    reached: bool | None

    def __str__(self) -> str:
        return self.told if self.reached is None else f"{self.told} {_verdict(self.reached)}"


NOTHING = Verdict("", None)


def aims_table(measured: Measured) -> Table:
    """Each aim in each scene, as measured, and in how many it is reached."""
    header = (
        "scene",
        *(f"{QUALITIES[name].label}: FLIP ≤ {most:.2f}" for name, most in AIMS["flip"].items()),
        f"{BASE['intersection_steps']} steps: error ≤ {_percent(AIMS['steps'], 0)} of d",
        f"Balanced ≥ {FASTER_THAN_EEVEE:.0f} times as fast as EEVEE, {EEVEE_SAMPLES} samples",
        "and nearer to Cycles (FLIP)",
        f"≥ {FASTER_THAN_CYCLES:.0f} times as fast as Cycles at equal FLIP",
    )
    verdicts = {
        label: [
            *(_flip_aim(measured, scene, name, most) for name, most in AIMS["flip"].items()),
            _steps_aim(measured, scene),
            *_engine_aims(measured, scene),
        ]
        for scene, label in measured.labels.items()
    }
    rows = [(label, *map(str, of)) for label, of in verdicts.items()]
    counts = []
    for column in zip(*verdicts.values(), strict=True):
        asked = [v.reached for v in column if v.reached is not None]
        counts.append(f"{sum(asked)} of {len(asked)}" if asked else "")
    return Table(header, [*rows, ("reached", *counts)])


def _flip_aim(measured: Measured, scene: str, name: str, most: float) -> Verdict:
    row = measured.quality(scene, name)
    if row is None or "flip" not in row.values:
        return NOTHING
    return Verdict(_error(row["flip"]), row["flip"] <= most)


def _steps_aim(measured: Measured, scene: str) -> Verdict:
    if measured.about["scenes"][scene].get("under_water"):
        return Verdict("no search from below", None)
    base = point(DEFAULT, {})
    row = next((r for r in measured.of(scene, DEFAULT) if r.settings == base), None)
    if row is None or "refracted_median_share" not in row.values:
        return NOTHING
    share = row["refracted_median_share"]
    return Verdict(_percent(share, 2), share <= AIMS["steps"])


def _engine_aims(measured: Measured, scene: str) -> tuple[Verdict, Verdict, Verdict]:
    """Speed beside EEVEE, nearness beside EEVEE, speed beside Cycles."""
    row = measured.quality(scene, "BALANCED")
    engines = [e for e in measured.engines if e.scene == scene]
    if row is None or not engines or "ratio" not in row.values:
        return NOTHING, NOTHING, NOTHING
    speed = near = cycles = NOTHING
    eevee = next((e for e in engines if e.engine == "EEVEE" and e.samples == EEVEE_SAMPLES), None)
    if eevee is not None:
        times = eevee.values["ratio"] / row["ratio"]
        speed = Verdict(f"{math.floor(10 * times) / 10:.1f}", times >= FASTER_THAN_EEVEE)
        ours = _to_converged(measured, row)
        if math.isfinite(ours) and math.isfinite(eevee.to_converged):
            told = f"{_error(ours)} against {_error(eevee.to_converged)}"
            near = Verdict(told, ours < eevee.to_converged)
    at_equal, word = cycles_ratio_at(engines, row["flip"])
    if math.isfinite(at_equal):
        times = at_equal / row["ratio"]
        told = f"{word} {math.floor(10 * times) / 10:.1f}".strip()
        cycles = Verdict(told, times >= FASTER_THAN_CYCLES and word != "at most")
    return speed, near, cycles


def agreement_table(measured: Measured) -> Table:
    """Cycles' pictures without visible noise against the image truths, on the water."""
    rows = []
    for e in measured.engines:
        if e.picture is None or not (e.converged or e.direct):
            continue
        cells = []
        for technique in (DEFAULT, "TRACED"):
            model = next(iter(measured.of(e.scene, technique)), None)
            true = measured.reference(model) if model else None
            if true is None:
                cells += ["", ""]
                continue
            radiance, water = true
            bright = np.average(e.picture.mean(axis=2), weights=water) / np.average(
                radiance.mean(axis=2), weights=water
            )
            cells += [_error(_flip(measured, e.scene, radiance, e.picture, water)), f"{bright:.3f}"]
        rows.append((f"{measured.labels[e.scene]}: {e.label}", *cells))
    header = ("picture", "to the model: FLIP", "brightness", "to the physics: FLIP", "brightness")
    return Table(header, rows)


def _flip(
    measured: Measured, scene: str, reference: np.ndarray, picture: np.ndarray, water: np.ndarray
) -> float:
    from scripts.reference.measures import picture_error

    return picture_error(reference, picture, water, exposure=measured.exposure(scene)).flip


def _about(measured: Measured) -> str:
    machine, about = measured.about["machine"], measured.about
    commits = list(dict.fromkeys(line["commit"] for line in measured.lines.values() if line.get("commit")))
    other = ", ".join(dict.fromkeys(e.commit for e in measured.engines if e.commit))
    width, height = measured.rows[0].size
    shared = [row["shared"] for row in measured.rows if "shared" in row.values] or [math.nan]
    points = Counter(row.scene for row in measured.rows if {"ratio", "flip"} <= row.values.keys())
    counted = ", ".join(f"{measured.labels[scene]} {number}" for scene, number in points.items())
    return (
        f"{machine['renderer']}, {machine['driver']}, {machine['cores']} cores, Blender "
        f"{machine['blender']}; "
        f"{width} × {height}; measured {about['began']} to {about['ended']} at commit {', '.join(commits)}"
        f"{f', EEVEE and Cycles at {other}' if other else ''}; "
        f"references of {float(about['photons']):.0e} photons in each window and {about['rays']} rays a "
        f"pixel. While times were measured, other programs had {_percent(float(np.median(shared)), 0)} of "
        f"the processor (median; at most {_percent(max(shared), 0)}). Points with time and error: {counted}."
    ).replace("e+0", "e")


def write_report(folder: Path, to: Path) -> Path:
    """Write the report on the measurements in `folder` into `to`; returns the path of its text.

    ValueError where nothing was measured.
    """
    measured = read_measured(folder)
    images = to / IMAGES
    images.mkdir(parents=True, exist_ok=True)
    columns = [n for n in (*ERRORS, *TIMES) if any(n in row.values for row in measured.rows)]
    write_rows(to / "trade.csv", measured.rows, columns)
    text = [INTRODUCTION, _about(measured), HOW]
    text += ["## Aims", aims_table(measured).markdown()]
    text += _section_scenes(measured, images)
    text += _section_settings(measured, images)
    text += [LIMITS, floors_table(measured).markdown()]
    path = to / "trade.md"
    path.write_text("\n\n".join(part for part in text if part) + "\n")
    return path


def _section_scenes(measured: Measured, images: Path) -> list[str]:
    from _trade_plots import plot_scene

    text = ["## Qualities"]
    for technique in (DEFAULT, "TRACED"):
        if any(row.technique == technique for row in measured.rows):
            text.append(f"{TECHNIQUES[technique].label}:")
            text.append(qualities_table(measured, technique).markdown())
    text += ["The front of the means over all scenes, Lake:", front_table(measured, DEFAULT).markdown()]
    text.append("\n".join(on_front_lines(measured)))
    text.append("## Time against error")
    for scene, label in measured.labels.items():
        rows = [r for r in measured.of(scene) if {"ratio", "flip"} <= r.values.keys()]
        engines = [
            {"engine": e.engine, "short": _short(e), **e.values}
            for e in measured.engines
            if e.scene == scene and not e.direct
        ]
        told = measured.about["scenes"][scene]["description"]
        text.append(f"### {label}\n\n{told}.")
        if rows:
            plot_scene(rows, engines, f"{label}: time against error", images / f"{scene}.png")
            text.append(f"![{label}: time against error]({IMAGES}/{scene}.png)")
        if _maps(measured, scene, images / f"{scene}_maps.jpg"):
            text.append(f"![{label}: qualities and their error]({IMAGES}/{scene}_maps.jpg)")
    engines = engines_table(measured)
    if engines.rows:
        text += [ENGINES, engines.markdown()]
        for scene, label in measured.labels.items():
            if _engine_maps(measured, scene, images / f"{scene}_engines.jpg"):
                text.append(f"![{label}: engines]({IMAGES}/{scene}_engines.jpg)")
        text += [AGREEMENT, agreement_table(measured).markdown()]
    return text


def _short(engine: Engine) -> str:
    return f"{engine.samples}" + (" denoised" if engine.denoised else "")


def _maps(measured: Measured, scene: str, path: Path) -> bool:
    """The reference and each quality, and below it its FLIP; False where a picture is missing."""
    from _trade_plots import contact_sheet, flip_colors, to_8_bit

    from scripts.reference.measures import displayed, error_maps

    exposure = measured.exposure(scene)
    above, below = [], []
    for name in QUALITIES:
        row = measured.quality(scene, name)
        picture = measured.picture(row) if row else None
        true = measured.reference(row) if row else None
        if picture is None or true is None:
            continue
        if not above:
            above.append(("image truth", to_8_bit(displayed(true[0], exposure))))
            below.append(("FLIP of each: black 0, pale 1", None))
        maps = error_maps(true[0], picture, exposure)
        above.append((QUALITIES[name].label, to_8_bit(displayed(picture, exposure))))
        below.append((f"mean on the water {_error(row['flip'])}", flip_colors(maps.flip)))
    if not above:
        return False
    contact_sheet([above, below], path)
    return True


def _engine_maps(measured: Measured, scene: str, path: Path) -> bool:
    """Cycles' converged picture, ours and other engines', and below their FLIP from it; False without."""
    from _trade_plots import contact_sheet, flip_colors, to_8_bit

    from scripts.reference.measures import displayed, error_maps

    converged = _converged(measured, scene)
    balanced = measured.quality(scene, "BALANCED")
    if converged is None or converged.picture is None or balanced is None:
        return False
    exposure = measured.exposure(scene)
    shown = [("Lake, Balanced", measured.picture(balanced), balanced["ratio"])]
    plain = measured.without_caustics(scene)
    if plain is not None:
        shown.append(("Lake, no caustics", measured.picture(plain), plain["ratio"]))
    for engine, samples, denoised in (
        ("EEVEE", EEVEE_SAMPLES, False),
        ("CYCLES", 16, False),
        ("CYCLES", 16, True),
    ):
        shown += [
            (e.label, e.picture, e.values["ratio"])
            for e in measured.engines
            if (e.scene, e.engine, e.samples, e.denoised) == (scene, engine, samples, denoised)
        ]
    above = [(converged.label, to_8_bit(displayed(converged.picture, exposure)))]
    below: list[tuple[str, np.ndarray | None]] = [("FLIP of each: black 0, pale 1", None)]
    for label, picture, ratio in shown:
        if picture is not None:
            above.append((f"{label}: time {_ratio(ratio)}", to_8_bit(displayed(picture, exposure))))
            flip = error_maps(converged.picture, picture, exposure).flip
            mean = np.average(flip, weights=measured.reference(balanced)[1])
            below.append((f"mean on the water {_error(mean)}", flip_colors(flip)))
    contact_sheet([above, below], path)
    return True


def _section_settings(measured: Measured, images: Path) -> list[str]:
    from _trade_plots import plot_geometry, plot_settings

    text = ["## One setting at a time"]
    text.append(
        "Around the base, whose value is bold: error on the left axis (blue), time on the right (orange). "
        "Thin lines are scenes, thick ones their means."
    )
    for technique in (DEFAULT, "TRACED"):
        rows = [r for r in measured.rows if r.technique == technique and {"ratio", "flip"} <= r.values.keys()]
        name = f"settings_{technique.lower()}.png"
        label = TECHNIQUES[technique].label
        if rows and plot_settings(rows, technique, images / name):
            text.append(f"![{label}: one setting at a time]({IMAGES}/{name})")
    for technique in TECHNIQUES:
        if technique not in (DEFAULT, "TRACED"):
            table = other_settings_table(measured, technique)
            text += [table.markdown()] if table.rows else []
    text.append("## Rays and light")
    if plot_geometry(measured.rows, measured.labels, images / "geometry.png"):
        text.append(f"![Errors of rays and of caustics]({IMAGES}/geometry.png)")
    text += ["Errors of rays at the base, medians over the water's pixels and over the scenes:"]
    text.append(geometry_table(measured).markdown())
    caustics = caustics_table(measured)
    if caustics.rows:
        text.append("Caustics against the count of photons: correlation, contrast and energy (1 is equal):")
        text.append(caustics.markdown())
    return text
