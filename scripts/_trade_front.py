# SPDX-License-Identifier: GPL-3.0-or-later
"""The measured points of `benchmark.py trade`: means over scenes, the front, and what lies on it."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from _trade_points import DIALS, Settings, from_cells, quality_point, to_cells

from lake_water_addon.core.quality import QUALITIES, quality_settings
from lake_water_addon.core.trade import Point, pareto_front

FASTER = 0.9
"""Times repeat to a tenth, as wide as the middle half of pairs: what is not faster by more is as fast."""
BETTER = 0.98
"""FLIP repeats exactly, but nobody sees a fiftieth of it: what is not better by more is as good."""

QUALITY_DIALS = tuple(name for name in quality_settings("BEST", 320) if name in DIALS)
"""What a quality sets. Points that differ in anything else show other water, not the same one better."""


@dataclass(frozen=True)
class Row:
    """One measured point of one scene. values: by column; those that were not measured are missing."""

    scene: str
    technique: str
    settings: Settings
    size: tuple[int, int]
    values: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def key(self) -> tuple:
        """Equal for the same point in another scene."""
        return (self.technique, tuple(self.settings.items()))

    @cached_property
    def quality(self) -> str:
        """Which of QUALITIES it is, or empty."""
        names = (n for n in QUALITIES if quality_point(self.technique, n, max(self.size)) == self.settings)
        return next(names, "")

    def __getitem__(self, column: str) -> float:
        return self.values.get(column, math.nan)


def row_of(cells: Mapping[str, str]) -> Row:
    """A line of the table. Cells that are no number are left out of the values."""
    values = {}
    for name, text in cells.items():
        if name in DIALS or not text:
            continue
        try:
            values[name] = float(text)
        except ValueError:
            continue
    width, height = map(int, cells["size"].split("x"))
    return Row(cells["scene"], cells["technique"], from_cells(cells), (width, height), values)


def read_rows(path: Path) -> list[Row]:
    """What `write_rows` wrote."""
    with path.open(newline="") as file:
        return [row_of(cells) for cells in csv.DictReader(file)]


def write_rows(path: Path, rows: Sequence[Row], columns: Sequence[str]) -> None:
    """A CSV file: scene, technique and quality, the dials, then `columns` of the values."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("scene", "technique", "quality", *DIALS, "size", *columns))
        for row in rows:
            values = (f"{row[name]:.4g}" if name in row.values else "" for name in columns)
            size = "x".join(map(str, row.size))
            writer.writerow(
                (row.scene, row.technique, row.quality, *to_cells(row.settings).values(), size, *values)
            )


def mean_rows(rows: Iterable[Row], technique: str) -> list[Row]:
    """The points of a technique that were measured in every scene of the rows, with the mean of each value.

    Of times and ratios the geometric mean: a scene that is slow as a whole counts no more than others.
    """
    rows = [row for row in rows if "ratio" in row.values and "flip" in row.values]
    scenes = {row.scene for row in rows}
    by_key: dict[tuple, list[Row]] = {}
    for row in rows:
        if row.technique == technique:
            by_key.setdefault(row.key, []).append(row)
    means = []
    for of_point in by_key.values():
        if {row.scene for row in of_point} != scenes:
            continue
        values = {}
        for name in set().union(*(row.values for row in of_point)):
            given = np.array([row[name] for row in of_point if name in row.values])
            is_time = name.startswith("ratio") or name.endswith("seconds")
            values[name] = float(np.exp(np.log(given).mean()) if is_time else given.mean())
        first = of_point[0]
        means.append(Row("mean", technique, first.settings, first.size, values))
    return means


def as_points(rows: Iterable[Row], error: str = "flip") -> list[Point]:
    """For `core.trade`; seconds are multiples of the dry scene's."""
    return [Point(row.settings, row["ratio"], row[error]) for row in rows]


def front(rows: Iterable[Row], error: str = "flip") -> list[Row]:
    """The rows that no other is as good as in both time and error, the fastest first."""
    rows = list(rows)
    chosen = {id(p.settings): p for p in pareto_front(as_points(rows, error))}
    return sorted((row for row in rows if id(row.settings) in chosen), key=lambda row: row["ratio"])


def quality_rows(rows: Iterable[Row]) -> list[Row]:
    """Those that differ from a quality in nothing but what a quality sets: the ones it competes with."""
    rows = list(rows)
    model = next((row for row in rows if row.quality), None)
    if model is None:
        return []

    # The search's steps are what a quality does without, by following rays.
    freed = {*QUALITY_DIALS, "intersection_steps", "c", "q"}

    def rest(row: Row) -> dict[str, object]:
        return {name: value for name, value in row.settings.items() if name not in freed}

    return [r for r in rows if rest(r) == rest(model) and not {"c", "q"} & r.settings.keys()]


def better_than(row: Row, rows: Iterable[Row], error: str = "flip") -> list[Row]:
    """The rows that are both faster and better, by more than FASTER and BETTER allow: none for a point of the
    front."""
    return [
        other
        for other in rows
        if other["ratio"] <= FASTER * row["ratio"] and other[error] <= BETTER * row[error]
    ]
