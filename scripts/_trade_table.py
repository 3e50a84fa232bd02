# SPDX-License-Identifier: GPL-3.0-or-later
"""A table of measurements on the disk, which a later run goes on with."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path


class Table:
    """A CSV file that grows by a row at a time, each on the disk before the next is measured.

    key: the columns that make two rows the same measurement. What was written with other columns is kept.
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
        self._known = {self._of(row) for row in self.rows}
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_suffix(".part")
        with new.open("w", newline="") as file:
            writer = csv.DictWriter(file, self.columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows)
        new.replace(path)

    def _of(self, row: Mapping[str, str]) -> tuple[str, ...]:
        return tuple(row.get(name, "") for name in self._key)

    def has(self, row: Mapping[str, str]) -> bool:
        """Whether that measurement is there already."""
        return self._of(row) in self._known

    def append(self, row: Mapping[str, object]) -> None:
        """Write a row at once."""
        cells = {name: _cell(value) for name, value in row.items()}
        with self.path.open("a", newline="") as file:
            csv.DictWriter(file, self.columns, restval="", lineterminator="\n").writerow(cells)
            file.flush()
            os.fsync(file.fileno())
        self.rows.append(cells)
        self._known.add(self._of(cells))


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.5g}" if math.isfinite(value) else ""
    return str(value)
