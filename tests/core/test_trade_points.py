# SPDX-License-Identifier: GPL-3.0-or-later
"""What `scripts/benchmark.py trade` measures, keeps and chooses from, without drawing anything."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

from _trade_front import Row, better_than, front, mean_rows, quality_rows, row_of
from _trade_points import BASE, SWEEPS, from_cells, point, points, quality_point, sweep_points, to_cells
from _trade_report import Engine, cycles_ratio_at
from _trade_table import Table

from lake_water_addon.core.parameters import OWN, has_effect
from lake_water_addon.core.quality import QUALITIES
from lake_water_addon.core.techniques import TECHNIQUES


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_points_name_what_the_technique_reads_and_each_is_there_once(technique: str) -> None:
    found = points(technique, 320)
    assert len({tuple(p.items()) for p in found}) == len(found)
    for settings in found:
        assert all(name == "samples" or has_effect(name, technique) for name in settings)
        assert {"samples", "texture_size", "fov_ext"} <= set(settings)
    assert point(technique, {}) in found
    assert quality_point(technique, "FINE", 320) in found


def test_every_dial_of_the_issue_is_swept() -> None:
    swept = {sweep.dial: {p.get(sweep.dial) for p in sweep_points("LAKE", sweep)} for sweep in SWEEPS}
    assert swept["intersection_steps"] >= {1, 16}
    assert swept["texture_size"] >= {128, 2048}
    assert swept["fov_ext"] >= {1.0, 2.0}
    assert swept["samples"] >= {1, 4, 16}
    assert swept["c"] >= {0.0, 100.0}
    assert swept["use_caustics"] == {True, False}
    for name in (
        "caustics_size",
        "caustics_method",
        "photon_size",
        "caustics_steps",
        "light_depth_size",
        "q",
    ):
        assert len(swept[name]) > 1, name


def test_every_own_dial_belongs_to_one_technique() -> None:
    for sweep in SWEEPS:
        if sweep.dial in OWN:
            having = [t for t in TECHNIQUES if sweep_points(t, sweep)]
            assert having == [OWN[sweep.dial].technique]


def test_what_does_not_count_is_not_named() -> None:
    assert "c" not in point("LAKE", {"c": 3.0})
    assert point("LAKE", {"c": 3.0, "reflection_steps": 0})["c"] == 3.0
    assert "q" not in point("LAKE", {"q": 4.5})
    assert point("SIMPLE_LAKE", {"q": 4.5, "c": 3.0}).items() >= {"q": 4.5, "c": 3.0}.items()
    assert "caustics_size" not in point("LAKE", {"use_caustics": False})
    assert "intersection_steps" not in point("POND", {})


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_row_of_the_table_is_the_point_again(technique: str) -> None:
    for settings in points(technique, 320):
        again = from_cells(to_cells(settings))
        assert again == settings
        assert {n: type(v) for n, v in again.items()} == {n: type(v) for n, v in settings.items()}


def test_a_table_goes_on_where_it_stopped(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    table = Table(path, ("name", "value", "commit"), ("name",))
    table.append({"name": "a", "value": 0.1, "commit": "x"})
    table.append({"name": "b", "value": float("nan"), "commit": "x"})
    assert path.read_text() == "name,value,commit\na,0.1,x\nb,,x\n"
    path.write_text(path.read_text() + "c,0.3")  # killed while it wrote a third
    again = Table(path, ("name", "value", "more", "commit"), ("name",))
    assert [again.has({"name": name}) for name in "abc"] == [True, True, False]
    again.append({"name": "c", "value": 0.3, "more": 2, "commit": "y"})
    assert path.read_text() == "name,value,more,commit\na,0.1,,x\nb,,,x\nc,0.3,2,y\n"


def test_a_time_that_was_taken_on_a_busy_machine_can_be_taken_again(tmp_path: Path) -> None:
    table = Table(tmp_path / "table.csv", ("name", "seconds", "shared"), ("name",))
    table.append({"name": "a", "seconds": 2.0, "shared": 0.4})
    row = {"name": "a"}
    assert table.has(row)
    assert table.has(row, 0.5)
    assert not table.has(row, 0.1)
    table.append({"name": "a", "seconds": 1.0, "shared": 0.01})
    assert Table(tmp_path / "table.csv", (), ("name",)).has(row, 0.1)


def made(scene: str, ratio: float, flip: float, **changes: object) -> Row:
    settings = point("LAKE", {**BASE, **changes})
    return Row(scene, "LAKE", settings, (320, 240), {"ratio": ratio, "flip": flip})


def test_means_are_of_points_that_every_scene_has() -> None:
    rows = [
        made("a", 2.0, 0.1),
        made("b", 8.0, 0.3),
        made("a", 1.0, 0.2, samples=2),
    ]
    (mean,) = mean_rows(rows, "LAKE")
    assert mean.settings == rows[0].settings
    assert mean["ratio"] == pytest.approx(4.0)  # geometric
    assert mean["flip"] == pytest.approx(0.2)


def test_the_front_and_what_is_better_than_a_point() -> None:
    rows = [
        made("a", 1.0, 0.30, samples=1),
        made("a", 2.0, 0.20, samples=2),
        made("a", 3.0, 0.25, samples=4),
        made("a", 4.0, 0.10, samples=8),
    ]
    assert front(rows) == [rows[0], rows[1], rows[3]]
    assert better_than(rows[2], rows) == [rows[1]]
    assert better_than(rows[1], rows) == []
    # As fast within a tenth, or as good within a fiftieth: the same.
    as_fast = replace(rows[1], values={"ratio": 1.9, "flip": 0.15})
    as_good = replace(rows[1], values={"ratio": 1.0, "flip": 0.1999})
    assert better_than(rows[1], [*rows, as_fast, as_good]) == []


def test_qualities_compete_with_what_differs_in_exactness_alone() -> None:
    quality = Row("a", "LAKE", quality_point("LAKE", "FINE", 320), (320, 240), {})
    assert quality.quality == "FINE"
    rivals = [made("a", 1.0, 0.1, samples=2), made("a", 1.0, 0.1, photon_size=512)]
    others = [
        made("a", 1.0, 0.1, use_caustics=False),
        made("a", 1.0, 0.1, caustics_method="CPU"),
        made("a", 1.0, 0.1, reflection_steps=0, c=10.0),
    ]
    assert quality_rows([quality, *rivals, *others]) == [quality, *rivals]


def test_cells_that_are_no_numbers_are_left_out() -> None:
    cells = {**to_cells(point("LAKE", {})), "scene": "a", "technique": "LAKE", "size": "320x240"}
    row = row_of({**cells, "flip": "0.1", "ssim": "", "commit": "abc"})
    assert row.values == {"flip": 0.1}
    assert row.size == (320, 240)
    assert row.settings == point("LAKE", {})
    assert set(QUALITIES) >= {"DRAFT", "BALANCED", "FINE", "BEST"}


def cycles(samples: int, ratio: float, to_converged: float, *, denoised: bool = False) -> Engine:
    about = {"denoised": denoised, "direct": False, "converged": False, "picture": None, "others": 0.0}
    return Engine("a", "CYCLES", "", samples, **about, values={"ratio": ratio}, to_converged=to_converged)


@pytest.mark.parametrize(
    ("flip", "ratio", "word"),
    [(0.15, 400.0, ""), (0.15 / 2**0.5, 800.0, ""), (0.4, 100.0, "at most"), (0.05, 1600.0, "more than")],
)
def test_the_time_of_cycles_at_equal_error(flip: float, ratio: float, word: str) -> None:
    noisy = [cycles(4, 100.0, 0.3), cycles(16, 400.0, 0.15), cycles(64, 1600.0, 0.075)]
    found, told = cycles_ratio_at(noisy, flip)
    assert (found, told) == (pytest.approx(ratio), word)
    # The denoiser counts where it is there sooner.
    better = [*noisy, cycles(4, 130.0, 0.12, denoised=True), cycles(16, 440.0, 0.1, denoised=True)]
    found, told = cycles_ratio_at(better, 0.15)
    assert (found, told) == (pytest.approx(130.0), "at most")
