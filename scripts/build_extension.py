# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension: stage the package flat, validate it and write ``lake_water-<version>.zip``.

Blender wants ``blender_manifest.toml`` beside ``__init__.py``; the checkout keeps it at the root, so the
package is copied into a temporary folder first. Validation and the archive are the work of Blender's own
command-line tool, which the bpy wheel carries: no Blender binary is needed.

    python scripts/build_extension.py [--output-dir build] [--source CHECKOUT]

Exit status: 0 built, 1 the package or the tool refused, 2 wrong command line.
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import shutil
import stat
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

PACKAGE = "lake_water_addon"
MANIFEST = "blender_manifest.toml"
LICENSE = "LICENSE"

# Left behind by editors, interpreters and tests; never part of a release.
EXCLUDED_DIRECTORIES = frozenset({"__pycache__", "tests"})
EXCLUDED_SUFFIXES = frozenset({".pyc", ".pyo", ".blend1", ".orig", ".rej", ".swp"})

# The earliest time that a zip can hold: with it, the archive depends on the files' names and contents alone.
ARCHIVE_TIME = (1980, 1, 1, 0, 0, 0)


class BuildError(Exception):
    """The extension cannot be built; the message names the thing and what to do about it."""


def find_blender_tool() -> Path:
    """The extension tool inside the bpy wheel, found without importing bpy."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise BuildError("bpy is not installed for this Python: run `make setup` and use .venv/bin/python")
    package = Path(spec.origin).parent
    found = sorted(package.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        raise BuildError(f"the bpy package in {package} has no bl_pkg/cli/blender_ext.py")
    return found[-1]


def read_manifest(path: Path) -> tuple[str, str]:
    """The id and version that name the archive. Everything else in the manifest is the tool's to judge."""
    try:
        manifest = tomllib.loads(path.read_text(encoding="utf-8"))
        return str(manifest["id"]), str(manifest["version"])
    except OSError as error:
        raise BuildError(f"cannot read the manifest {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BuildError(f"the manifest {path} is not valid TOML: {error}") from error
    except KeyError as error:
        raise BuildError(f"the manifest {path} does not state {error}") from error


def package_files(package: Path) -> list[Path]:
    """Files of the package that belong in the archive, relative to it, in a fixed order."""
    if not (package / "__init__.py").is_file():
        raise BuildError(f"{package} has no __init__.py: it is not the extension's package")
    files = []
    for path in package.rglob("*"):
        relative = path.relative_to(package)
        if any(part in EXCLUDED_DIRECTORIES or part.startswith(".") for part in relative.parts):
            continue
        if path.is_file() and path.suffix not in EXCLUDED_SUFFIXES and not path.name.endswith("~"):
            files.append(relative)
    return sorted(files, key=lambda file: file.as_posix())


def check_sources(package: Path, files: Sequence[Path]) -> None:
    """Refuse sources that work in the checkout and break once installed.

    Installed, the package is ``bl_ext.<repository>.lake_water``: an absolute import of itself finds nothing.
    """
    faults = []
    for file in files:
        if file.suffix != ".py":
            continue
        try:
            tree = ast.parse((package / file).read_bytes(), filename=str(file))
        except (SyntaxError, ValueError) as error:
            raise BuildError(f"{package / file} is not valid Python: {error}") from error
        for node in ast.walk(tree):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            faults += [f"{file}:{node.lineno}: {name}" for name in names if name.split(".")[0] == PACKAGE]
    if faults:
        listing = "\n  ".join(faults)
        raise BuildError(f"imports of the package by its checkout name, to be made relative:\n  {listing}")


def stage(source: Path, target: Path) -> int:
    """Copy manifest, licence and package flat into ``target``; returns the number of files."""
    package = source / PACKAGE
    files = package_files(package)
    check_sources(package, files)
    pairs = [(package / file, target / file) for file in files]
    for name in (MANIFEST, LICENSE):
        if (package / name).exists():
            raise BuildError(f"{package / name} would be overwritten by the one at the root: remove it")
        pairs.append((source / name, target / name))
    for origin, copy in pairs:
        copy.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(origin, copy)
        except OSError as error:
            raise BuildError(f"cannot copy {origin}: {error.strerror}") from error
    return len(pairs)


def run_tool(tool: Path, *arguments: str | Path) -> None:
    """Run Blender's extension tool; its words become the error when it refuses."""
    command = [sys.executable, str(tool), *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        words = (result.stdout + result.stderr).strip() or f"exit status {result.returncode}, no message"
        raise BuildError(f"Blender's extension tool refused ({arguments[0]}):\n{words}")


def make_reproducible(archive: Path, target: Path) -> None:
    """Write ``archive`` to ``target`` with what differs between machines taken out.

    The tool stores the files in the order that the file system lists them, with their times and modes.
    """
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w") as new:
        for entry in sorted(old.infolist(), key=lambda entry: entry.filename):
            info = zipfile.ZipInfo(entry.filename, ARCHIVE_TIME)
            info.compress_type = entry.compress_type
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            new.writestr(info, old.read(entry))


def build(source: Path, output_dir: Path) -> Path:
    """Build the archive of the checkout ``source`` into ``output_dir`` and return its path."""
    tool = find_blender_tool()
    name, version = read_manifest(source / MANIFEST)
    archive = output_dir / f"{name}-{version}.zip"
    try:
        output_dir.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".staging-", dir=output_dir) as staging:
            package = Path(staging, "package")
            stage(source, package)
            run_tool(tool, "validate", package)
            built, fresh = Path(staging, "built.zip"), Path(staging, archive.name)
            run_tool(tool, "build", "--source-dir", package, "--output-filepath", built)
            make_reproducible(built, fresh)
            run_tool(tool, "validate", fresh)
            fresh.replace(archive)
    except OSError as error:
        raise BuildError(f"cannot write {error.filename or output_dir}: {error.strerror}") from error
    return archive


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    root = Path(__file__).resolve().parents[1]
    parser = argparse.ArgumentParser(description="Build and validate the extension's zip.")
    parser.add_argument(
        "--output-dir", type=Path, default=root / "build", help="folder of the zip (default: build)"
    )
    parser.add_argument("--source", type=Path, default=root, help="checkout to build (default: this one)")
    options = parser.parse_args(arguments)
    try:
        archive = build(options.source.resolve(), options.output_dir.resolve())
    except BuildError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 1
    print(f"{archive} ({archive.stat().st_size / 1024:.0f} KiB), valid")
    return 0


if __name__ == "__main__":
    sys.exit(main())
