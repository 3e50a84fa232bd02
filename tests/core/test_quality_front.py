# SPDX-License-Identifier: GPL-3.0-or-later
"""The qualities are points of the measured front: docs/trade.csv, as `benchmark.py trade` wrote it.

Of the means over all scenes, of the technique that a new scene has. Another measured point, which differs in
nothing but what a quality sets, may be faster or better; both, by more than FASTER and BETTER of
`_trade_front` say, it may not. Those two are as wide as times repeat on one machine, and as an eye sees FLIP:
without them the test would ask for the luck of one run.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

from _trade_front import Row, better_than, mean_rows, quality_rows, read_rows
from _trade_points import DEFAULT, quality_point

from lake_water_addon.core.quality import QUALITIES
from lake_water_addon.core.techniques import DEFAULT_TECHNIQUE

TABLE = Path(__file__).resolve().parents[2] / "docs" / "trade.csv"


@pytest.fixture(scope="module")
def rivals() -> list[Row]:
    """Means over the scenes of all points that a quality competes with."""
    return quality_rows(mean_rows(read_rows(TABLE), DEFAULT))


def measured(rivals: list[Row], name: str) -> Row:
    wanted = quality_point(DEFAULT, name, max(rivals[0].size))
    found = [row for row in rivals if row.settings == wanted]
    assert found, f"{name} is {wanted}, which was not measured: run scripts/benchmark.py trade again"
    return found[0]


def test_the_table_is_of_the_default_technique_in_all_scenes(rivals: list[Row]) -> None:
    rows = read_rows(TABLE)
    assert DEFAULT == DEFAULT_TECHNIQUE
    assert len({row.scene for row in rows}) >= 6
    assert len(rivals) >= 10


@pytest.mark.parametrize("name", QUALITIES)
def test_a_quality_is_on_the_front(rivals: list[Row], name: str) -> None:
    row = measured(rivals, name)
    better = better_than(row, rivals)
    assert not better, (
        f"{name} takes {row['ratio']:.3g} times the dry scene and leaves a FLIP of {row['flip']:.4f}; "
        f"{better[0]['ratio']:.3g} and {better[0]['flip']:.4f} are to be had with {better[0].settings}"
    )


def test_each_quality_takes_longer_and_leaves_less_error_than_the_one_before(rivals: list[Row]) -> None:
    rows = [measured(rivals, name) for name in QUALITIES]
    for one, next_one in pairwise(rows):
        assert one["ratio"] < next_one["ratio"]
        assert one["flip"] > next_one["flip"]


def test_balanced_is_close_to_the_truth_in_every_scene() -> None:
    """Mean FLIP on the water of at most 0.10, which is what it is for."""
    rows = [row for row in read_rows(TABLE) if row.technique == DEFAULT and row.quality == "BALANCED"]
    assert len(rows) >= 6
    for row in rows:
        assert row["flip"] <= 0.10, f"{row.scene}: {row['flip']}"
