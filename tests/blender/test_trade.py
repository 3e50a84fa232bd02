# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/benchmark.py trade as a person runs it: one scene, in pictures so small that it takes seconds."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SCENE = "tiled_pool"
TINY = ("trade", "--scenes", SCENE, "--techniques", "lake", "traced", "--quick", "--resolution", "32x24")
ROUGH = ("--photons", "20000", "--rays", "1", "--repeats", "2", "--workers", "2")


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The script in a process of its own."""
    command = [sys.executable, str(SCRIPTS / "benchmark.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a run leaves, and how it ended."""
    folder = tmp_path_factory.mktemp("trade")
    result = run(*TINY, *ROUGH, "--output", folder)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.strip().endswith(str(folder / "report" / "trade.md"))
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def number(row: dict[str, str], column: str) -> float:
    return float(row[column])


@pytest.fixture(scope="module")
def scripts() -> Iterator[None]:
    """The script's helper modules can be imported."""
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


def test_every_point_has_its_time_and_its_error(folder: Path, scripts: None) -> None:
    from _trade_points import points, to_cells

    wanted = [
        {"technique": technique, **to_cells(settings)}
        for technique in ("LAKE", "TRACED")
        for settings in points(technique, 32, quick=True)
    ]
    assert len(wanted) >= 6
    for name in ("errors.csv", "times.csv"):
        measured = rows(folder / name)
        assert [{key: row[key] for key in wanted[0]} for row in measured] == wanted, name
        assert {row["scene"] for row in measured} == {SCENE}


def test_times_are_ratios_to_the_dry_scene(folder: Path) -> None:
    for row in rows(folder / "times.csv"):
        assert number(row, "seconds") > 0.0 < number(row, "dry_seconds")
        assert number(row, "ratio_low") <= number(row, "ratio") <= number(row, "ratio_high")
        assert number(row, "ratio") > 1.0
        assert int(row["pairs"]) == 2


def test_errors_lie_where_errors_can(folder: Path) -> None:
    for row in rows(folder / "errors.csv"):
        for name in ("flip", "hdr_flip", "flip_all", "refracted_beyond", "refracted_missed"):
            assert 0.0 <= number(row, name) <= 1.0, name
        assert 0.0 < number(row, "flip") < 0.5
        assert 0.0 < number(row, "refracted_median_m") < 1.0
        assert number(row, "ssim") <= 1.0
    lake = [row for row in rows(folder / "errors.csv") if row["technique"] == "LAKE"]
    lake = [row for row in lake if row["use_caustics"] == "yes"]
    assert lake
    assert all(0.5 < number(row, "caustics_energy") < 1.5 for row in lake)


@pytest.mark.parametrize("technique", ["LAKE", "TRACED"])
def test_a_finer_texture_leaves_less_error(folder: Path, scripts: None, technique: str) -> None:
    from _trade_front import row_of
    from _trade_points import point

    measured = [row_of(row) for row in rows(folder / "errors.csv")]
    by_settings = {row.key: row for row in measured}
    fine, coarse = (
        by_settings[technique, tuple(point(technique, changes).items())]
        for changes in ({}, {"texture_size": 128})
    )
    assert fine["flip"] < coarse["flip"]
    assert fine["refracted_median_m"] < coarse["refracted_median_m"]


def test_the_report_has_tables_plots_and_all_points(folder: Path) -> None:
    from PIL import Image

    text = (folder / "report" / "trade.md").read_text()
    assert "| scene | Balanced: FLIP ≤ 0.10 | Best: FLIP ≤ 0.05 |" in text
    assert "| reached | " in text
    named = [part.split(")")[0] for part in text.split("](images/")[1:]]
    assert f"trade/{SCENE}.png" in named
    assert f"trade/{SCENE}_maps.jpg" in named
    for name in named:
        with Image.open(folder / "report" / "images" / name) as image:
            assert min(image.size) >= 200, name
    points = rows(folder / "report" / "trade.csv")
    assert len(points) == len(rows(folder / "errors.csv"))
    assert all(point["ratio"] and point["flip"] for point in points)
    assert {point["quality"] for point in points} >= {"DRAFT", "BALANCED"}
    about = json.loads((folder / "run.json").read_text())
    assert about["machine"]["renderer"] in text
    for table in (part for part in text.split("\n\n") if part.startswith("|")):
        assert len({line.replace("\\|", "").count("|") for line in table.splitlines()}) == 1, table


def test_a_second_run_measures_nothing_again(folder: Path) -> None:
    tables = [folder / name for name in ("errors.csv", "times.csv")]
    before = [path.read_text() for path in tables]
    lines = before[1].splitlines(keepends=True)
    tables[1].write_text(
        "".join(lines[:-1]) + lines[-1][: len(lines[-1]) // 2]
    )  # it was killed while it wrote
    result = run(*TINY, *ROUGH, "--output", folder)
    assert result.returncode == 0, result.stdout + result.stderr
    assert tables[0].read_text() == before[0]
    again = tables[1].read_text().splitlines(keepends=True)
    assert again[:-1] == lines[:-1]
    assert len(again) == len(lines)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scenes", "puddle"), "--scenes: puddle is none of lake_near, "),
        (("--techniques", "mirror"), "invalid choice: 'MIRROR'"),
        (("--errors-only", "--times-only"), "not allowed with argument"),
        (("--report-only",), "there are no measurements in "),
    ],
)
def test_what_cannot_be_measured_is_refused(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    result = run("trade", "--output", tmp_path / "none", *arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
