# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension as a person gets it: built, validated, installed from the zip, used, disabled, removed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
SESSION = Path(__file__).with_name("installed_session.py")


def build(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run scripts/build_extension.py as a person does."""
    command = [sys.executable, ROOT / "scripts" / "build_extension.py", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension's zip, built from this checkout. The script validates what it builds."""
    folder = tmp_path_factory.mktemp("build")
    result = build("--output-dir", folder)
    assert result.returncode == 0, f"the extension does not build:\n{result.stderr}"
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["version"]
    return folder / f"lake_water-{version}.zip"


@pytest.fixture(scope="module")
def session(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What installed_session.py saw, in a Blender with an empty user folder; `folder` is where it ran."""
    folder = tmp_path_factory.mktemp("session")
    result = subprocess.run(
        [sys.executable, "-I", SESSION, archive, folder / "picture.png"],
        cwd=folder,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    output = f"{result.stdout}\n{result.stderr}"
    assert result.returncode == 0, f"the session with the installed extension failed:\n{output}"
    assert "Traceback" not in output, f"something raised and Blender went on:\n{output}"
    return {**json.loads(result.stdout.splitlines()[-1]), "folder": folder}


def test_zip_holds_the_package_flat_and_nothing_else(archive: Path) -> None:
    with zipfile.ZipFile(archive) as zipped:
        names = set(zipped.namelist())
    assert {"blender_manifest.toml", "LICENSE", "__init__.py", "core/waves.py"} <= names
    package = ROOT / "lake_water_addon"
    sources = {path.relative_to(package).as_posix() for path in package.rglob("*.glsl")}
    assert sources, "no GLSL in the checkout"
    assert sources <= names, "GLSL files are missing from the zip"
    folders = {"tests", "scripts", "docs", "lake_water_addon", "__pycache__"}
    strangers = {name for name in names if folders & set(name.split("/")) or name.startswith(".")}
    assert not strangers


def test_zip_is_the_same_when_built_again(archive: Path, tmp_path: Path) -> None:
    assert build("--output-dir", tmp_path).returncode == 0
    assert (tmp_path / archive.name).read_bytes() == archive.read_bytes()


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ({}, "cannot read the manifest"),
        ({"blender_manifest.toml": "id = \n"}, "is not valid TOML"),
        ({"blender_manifest.toml": "id = 'lake_water'\n"}, "does not state 'version'"),
        (
            {
                "blender_manifest.toml": "id = 'lake_water'\nversion = '1.0.0'\n",
                "LICENSE": "",
                "lake_water_addon/__init__.py": "",
            },
            "Blender's extension tool refused",
        ),
        (
            {
                "blender_manifest.toml": "id = 'lake_water'\nversion = '1.0.0'\n",
                "LICENSE": "",
                "lake_water_addon/__init__.py": "from lake_water_addon.core import waves\n",
            },
            "__init__.py:1: lake_water_addon.core",
        ),
    ],
    ids=["no manifest", "broken manifest", "no version", "incomplete manifest", "absolute import"],
)
def test_build_refuses_with_a_reason(tmp_path: Path, sources: dict[str, str], message: str) -> None:
    for name, text in sources.items():
        file = tmp_path / "source" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    result = build("--source", tmp_path / "source", "--output-dir", tmp_path / "out")
    assert result.returncode == 1
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.glob("out/*.zip"))


def test_installed_extension_works_without_the_checkout(session: dict[str, Any]) -> None:
    assert not session["checkout importable"], "the session could have used the checkout instead of the zip"
    assert Path(session["file"]).is_relative_to(session["folder"] / "user")
    assert session["enabled"]["operators"]
    assert session["water"]["enabled"]
    assert session["water"]["waves"] >= 4


def test_installed_extension_renders_the_lake(session: dict[str, Any]) -> None:
    assert session["engine"] == "LAKE_WATER"
    picture = np.asarray(Image.open(session["folder"] / "picture.png").convert("RGB"), dtype=float) / 255.0
    assert picture.shape == (90, 160, 3)
    assert picture.std(axis=(0, 1)).max() > 0.05, "the picture is blank"
    assert picture.mean() > 0.02, "the picture is black"
    # A lake under a sky: the two ends of the picture cannot look alike.
    top, bottom = picture[:15].mean(axis=(0, 1)), picture[-15:].mean(axis=(0, 1))
    assert np.abs(top - bottom).max() > 0.05, f"sky {top} and foreground {bottom} look alike"


def test_disabled_extension_leaves_nothing(session: dict[str, Any]) -> None:
    kinds = set(session["enabled"]) - {"modules"}  # Python keeps what was imported until it is uninstalled
    missing = [kind for kind in kinds if not session["enabled"][kind]]
    assert not missing, f"nothing of this kind was found while enabled, so nothing is checked: {missing}"
    left = {kind: session["disabled"][kind] for kind in kinds if session["disabled"][kind]}
    assert not left
    for kind in kinds:
        assert session["enabled again"][kind] == session["enabled"][kind], kind


def test_uninstalled_extension_leaves_nothing(session: dict[str, Any]) -> None:
    assert session["uninstalled"] == session["before"]
    files = [path for path in (session["folder"] / "user").rglob("*") if "lake_water" in path.name]
    assert not files
