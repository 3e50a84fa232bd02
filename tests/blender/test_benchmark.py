# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/benchmark.py as a person runs it, on a lake and a picture so small that it takes seconds."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SCRIPT = SCRIPTS / "benchmark.py"
SIZES = ("--resolution", "64x48", "--texture-size", "64", "--caustics-size", "64", "--photon-size", "32")
TINY = ("frames", "--detail", "0.1", *SIZES, "--repeats", "2")
KINDS = ["scene", "plain", "shadows", "compute-256", "cpu-256", "glow", "split"]
TECHNIQUES = {"LAKE", "SIMPLE_LAKE", "POND", "RIPPLE", "TRACED"}
FRAMES = 4  # of each kind: two rounds, each with one frame for its own time and one for its passes


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The script in a process of its own."""
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def scripts() -> Iterator[None]:
    """The script's helper modules can be imported."""
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What a run writes, with what it prints under "printed"."""
    path = tmp_path_factory.mktemp("benchmark") / "figures.json"
    options = ("--techniques", "--memory-frames", 2, "--json", path)
    result = run(*TINY, "--kinds", *KINDS, "moving-sun", "memory", *options)
    assert result.returncode == 0, result.stdout + result.stderr
    return {**json.loads(path.read_text()), "printed": result.stdout}


def test_each_kind_has_its_figures(figures: dict) -> None:
    asked = {*KINDS, "scene-shadows", *(f"technique-{t.lower().replace('_', '-')}" for t in TECHNIQUES)}
    assert set(figures["kinds"]) == asked
    for name, kind in figures["kinds"].items():
        lower, upper = kind["frame_ms_quartiles"]
        assert 0.0 < lower <= kind["frame_ms"] <= upper, name
        assert kind["frames_per_second"] * kind["frame_ms"] == pytest.approx(1000.0), name
        assert 0.0 < kind["extraction_ms"] < kind["frame_ms"], name
        assert 0.0 < kind["planning_ms"] < kind["frame_ms"], name
        assert kind["frames"] == FRAMES, name
    assert figures["scene"]["resolution"] == [64, 48]
    assert figures["first_frame"]["kind"] == "scene"
    assert {"renderer", "driver", "blender", "python"} <= set(figures["machine"])
    assert "grid" not in figures


@pytest.mark.parametrize(
    ("kind", "ran", "missing"),
    [
        ("scene", {"scene"}, {"refraction", "reflection", "photons", "caustics", "water", "glow", "fog"}),
        ("plain", {"refraction", "reflection", "scene", "water"}, {"photons", "caustics", "glow", "fog"}),
        ("shadows", {"refraction", "reflection", "scene", "water"}, {"photons", "caustics", "glow", "fog"}),
        ("compute-256", {"photons", "caustics", "refraction", "water"}, {"glow", "fog"}),
        ("cpu-256", {"photons", "caustics", "refraction", "water"}, {"glow", "fog"}),
        ("glow", {"photons", "caustics", "refraction", "water", "glow"}, {"fog"}),
        ("split", {"photons", "caustics", "surface heights", "refraction", "water", "fog"}, {"glow"}),
        ("technique-traced", {"photons", "caustics", "refraction", "reflection", "water"}, {"glow", "fog"}),
        # Flat water: its caustics do not change with the time.
        ("technique-ripple", {"refraction", "reflection", "water"}, {"photons", "caustics", "glow", "fog"}),
    ],
)
def test_the_passes_are_those_of_the_kind(figures: dict, kind: str, ran: set[str], missing: set[str]) -> None:
    passes = figures["kinds"][kind]["passes_ms"]
    assert ran <= set(passes)
    assert not missing & set(passes)
    assert all(passes[name] > 0.0 for name in ran)
    assert not {"shadow depth", "light depth"} & set(passes), "drawn again though only the time changed"


def test_the_light_depth_is_drawn_anew_while_the_sun_moves(figures: dict) -> None:
    assert {"shadow depth", "light depth"} <= set(figures["moving_sun"]["passes_ms"])


def test_each_camera_begins_where_its_name_says(figures: dict) -> None:
    sides = {name: kind["sides"] for name, kind in figures["kinds"].items()}
    assert sides["split"] == {"SPLIT": FRAMES}
    assert sides["scene"] == {}
    assert all(sides[name] == {"AIR": FRAMES} for name in ("plain", "glow", "technique-traced"))


def test_only_caustics_by_the_processor_make_something_in_each_frame(figures: dict) -> None:
    made = {name: kind["made"] for name, kind in figures["kinds"].items() if kind["made"]}
    assert made == {"cpu-256": {"textures": FRAMES}}
    assert figures["memory"]["made"] == {}


def test_ratios_are_those_of_measured_kinds(figures: dict) -> None:
    compared = {(ratio["over"], ratio["under"]) for ratio in figures["ratios"]}
    assert compared == {
        ("plain", "scene"),
        ("shadows", "plain"),
        ("shadows", "compute-256"),
        ("shadows", "cpu-256"),
        ("cpu-256", "compute-256"),
    }
    for ratio in figures["ratios"]:
        lower, upper = ratio["quartiles"]
        assert lower <= ratio["median"] <= upper


def test_the_techniques_are_compared_with_the_scene_without_water(figures: dict) -> None:
    assert set(figures["techniques"]) == TECHNIQUES
    for technique in figures["techniques"].values():
        assert 0.0 < technique["water_pass_ms"] < technique["frame_ms"]
        assert technique["ratio_to_scene_without_water"] > 1.0


def test_the_report_is_one_of_tables(figures: dict, scripts: None) -> None:
    from _bench_report import report

    for kind in figures["kinds"].values():
        assert kind["label"] in figures["printed"]
    tables = [
        [line for line in part.splitlines()]
        for part in report(figures, markdown=True).split("\n\n")
        if part.startswith("|")
    ]
    assert len(tables) == 4  # kinds, passes, ratios, techniques
    for table in tables:
        assert len({line.count("|") for line in table}) == 1
        assert set(table[1]) <= set("|-: ")


def test_a_ratio_is_the_median_of_pairs_of_one_round(scripts: None) -> None:
    from _bench_frames import Times, _ratio
    from _bench_kinds import Ratio

    # The machine slows down from round to round: the ratio of medians would be 4.
    over = Times(frame=[2.0, 8.0, 24.0], passes={"photons": [1.0, 1.0, 1.0], "caustics": [1.0, 2.0, 3.0]})
    under = Times(frame=[1.0, 2.0, 8.0], passes={"photons": [1.0, 0.5, 0.5], "caustics": [1.0, 1.0, 0.5]})
    times = {"a": over, "b": under}
    at_most = _ratio(Ratio("frames", "a", "b", aim=2.5), times)
    assert (at_most["median"], at_most["met"]) == (3.0, False)
    at_least = _ratio(Ratio("frames", "a", "b", aim=2.5, at_least=True), times)
    assert (at_least["median"], at_least["met"]) == (3.0, True)
    passes = _ratio(Ratio("light", "a", "b", passes=("photons", "caustics")), times)
    assert (passes["median"], passes["met"]) == (2.0, None)


@pytest.mark.parametrize(
    ("arguments", "kinds", "further"),
    [
        ((), True, True),
        (("--kinds", "all", "--techniques"), True, True),
        (("--techniques",), False, False),
    ],
)
def test_techniques_are_compared_alone_or_with_all(
    scripts: None, arguments: tuple[str, ...], kinds: bool, further: bool
) -> None:
    from _bench_kinds import DRY, FURTHER, KINDS, TECHNIQUE_KINDS
    from benchmark import parse_arguments

    options = parse_arguments(["frames", *arguments])
    assert (set(KINDS) <= set(options.kinds)) == kinds
    assert DRY in options.kinds
    assert (set(TECHNIQUE_KINDS) <= set(options.kinds)) == bool(arguments)
    assert options.further == (list(FURTHER) if further else [])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("frames", "--kinds", "everything"), "invalid choice: 'everything'"),
        (("frames", "--kinds", "memory"), "give at least one kind of frame besides memory"),
        (("frames", "--json", "missing/figures.json"), "the folder of missing/figures.json does not exist"),
        (("frames", "--detail", "0.01"), "must lie between 0.1 and 4"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments: tuple[str, ...], message: str) -> None:
    result = run(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
