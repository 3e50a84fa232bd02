# SPDX-License-Identifier: GPL-3.0-or-later
"""What `benchmark.py trade` keeps on the disk: tables that a later run goes on with, and pictures."""

from __future__ import annotations

import csv
import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from _trade_points import DIALS

PICTURE_ERRORS = ("flip", "hdr_flip", "rmse", "ssim")
HIT_ERRORS = (
    "median_m",
    "median_share",
    "median_texels",
    "median_pixels",
    "mean_pixels",
    "beyond",
    "missed",
    "false",
)
CAUSTICS_ERRORS = ("correlation", "contrast", "energy")
ERRORS = (
    *PICTURE_ERRORS,
    *(f"{name}_all" for name in PICTURE_ERRORS),
    *(f"refracted_{name}" for name in HIT_ERRORS),
    *(f"reflected_{name}" for name in HIT_ERRORS),
    *(f"caustics_{name}" for name in CAUSTICS_ERRORS),
)
"""Columns: of the water's pixels and of the whole picture; of rays; of the light on the bottom.

median_share: of the length of the true ray. beyond, missed, false: shares, see `core.hits.HitErrors`.
"""
ENGINE_TIMES = ("seconds", "dry_seconds", "ratio", "shared")
TIMES = ("seconds", "dry_seconds", "ratio", "ratio_low", "ratio_high", "pairs", "shared")
"""Columns: medians of a picture and of the dry scene, s; median and quartiles of the pairs' ratios.

shared: part of the processor's time that other programs had meanwhile, 0 to 1.
"""


class Table:
    """A CSV file that grows by a row at a time, each on the disk before the next is measured.

    key: the columns that make two rows the same measurement; the last one counts. What was written with other
    columns is kept.
    """

    def __init__(self, path: Path, columns: Sequence[str], key: Sequence[str]) -> None:
        self.path, self.columns, self._key = path, tuple(columns), tuple(key)
        self.rows: list[dict[str, str]] = []
        header: Sequence[str] = ()
        if path.exists():
            with path.open(newline="") as file:
                reader = csv.DictReader(file)
                # A run that was killed may have left half a row.
                self.rows = [row for row in reader if None not in row.values() and None not in row]
                header = reader.fieldnames or ()
        self.columns += tuple(name for name in header if name not in self.columns)
        self._known = {self._of(row): row for row in self.rows}
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_suffix(".part")
        with new.open("w", newline="") as file:
            writer = csv.DictWriter(file, self.columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows)
        new.replace(path)

    def _of(self, row: Mapping[str, str]) -> tuple[str, ...]:
        return tuple(row.get(name, "") for name in self._key)

    def has(self, row: Mapping[str, str], shared_at_most: float = 1.0) -> bool:
        """Whether that measurement is there already; not if other programs had more of the processor."""
        kept = self._known.get(self._of(row))
        return kept is not None and float(kept.get("shared") or 0.0) <= shared_at_most

    def append(self, row: Mapping[str, object]) -> None:
        """Write a row at once."""
        cells = {name: _cell(value) for name, value in row.items()}
        with self.path.open("a", newline="") as file:
            csv.DictWriter(file, self.columns, restval="", lineterminator="\n").writerow(cells)
            file.flush()
            os.fsync(file.fileno())
        self.rows.append(cells)
        self._known[self._of(cells)] = cells


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.5g}" if math.isfinite(value) else ""
    return str(value)


KEY = ("scene", "technique", *DIALS, "size", "content")
"""Columns that name what was measured. size: of the picture; content: changes with the scene."""
ACCURACY = ("photons", "rays")


def errors_table(folder: Path) -> Table:
    """What was measured of errors."""
    return Table(folder / "errors.csv", (*KEY, *ACCURACY, *ERRORS, "commit"), (*KEY, *ACCURACY))


def times_table(folder: Path) -> Table:
    """What was measured of times."""
    return Table(folder / "times.csv", (*KEY, *TIMES, "commit"), KEY)


def engines_table(folder: Path) -> Table:
    """What was measured of other engines."""
    key = ("scene", "label", "size", "content")
    about = ("engine", "samples", "denoised", "direct", "converged", "picture")
    errors = (*PICTURE_ERRORS, *(f"{name}_all" for name in PICTURE_ERRORS))
    return Table(folder / "engines.csv", (*key, *about, *ENGINE_TIMES, *errors, "commit"), key)


def reference_file(folder: Path, row: Mapping[str, object], what: str) -> Path:
    """Where a reference of the scene of a row is kept. what: a key of OPTICS, or light."""
    accuracy = f"{float(row['photons']):.0e}x{row['rays']}".replace("e+0", "e")
    name = "-".join((str(row["scene"]), what, str(row["size"]), accuracy, str(row["content"])))
    return folder / "references" / f"{name}.npz"


def picture_file(folder: Path, row: Mapping[str, str]) -> Path:
    """Where the picture of a point is kept, for those that are."""
    digest = hashlib.blake2s(repr([row.get(name, "") for name in KEY]).encode(), digest_size=6).hexdigest()
    return folder / "pictures" / f"{row['scene']}-{row['technique'].lower()}-{digest}.npz"
