# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the frames of a render go, how one is known to be whole, and what a resumed render goes by.

Standard library only: the command line is checked with this before Blender is started.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import struct
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PICTURE_FORMATS = {".png": "PNG", ".exr": "OPEN_EXR"}
OTHER_SUFFIXES = {
    *(".mov", ".avi", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ogv", ".gif"),
    *(".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".tga", ".hdr"),
}
MAX_PATH = 1000  # Blender cuts paths off at 1024 bytes, without a word


class RenderProblem(Exception):
    """Why the render cannot go on, for a person: the thing and the remedy."""

    exit_code = 1


class UsageProblem(RenderProblem):
    """The command line, or what it names, is not usable."""

    exit_code = 2


@dataclass(frozen=True)
class Output:
    """What --output asks for.

    kind: 'VIDEO', 'SEQUENCE', 'STILL', or 'SHEET' where only a contact sheet is wanted. path: the
    video, the still or the sheet itself; for a sequence its folder. folder: where frames are written,
    one file each; prefix, digits, suffix: how their names are put together.
    """

    kind: str
    path: Path
    folder: Path
    prefix: str
    digits: int
    suffix: str

    @property
    def picture_format(self) -> str:
        """Blender's name of the frames' file format."""
        return PICTURE_FORMATS[self.suffix.lower()]

    @property
    def label(self) -> str:
        """What is made, for a person."""
        if self.kind == "SEQUENCE":
            return str(self.folder / f"{self.prefix}{'#' * self.digits}{self.suffix}")
        return str(self.path)

    @property
    def frames_are_temporary(self) -> bool:
        """Whether the frames only serve to make something else, and go when that is done."""
        return self.kind in {"VIDEO", "SHEET"}

    @property
    def record(self) -> Path:
        """The settings that made the frames, and which are done."""
        stem = self.prefix.strip("_-. ")
        return self.folder / (f"{stem}.render.json" if stem else "render.json")

    def frame(self, number: int) -> Path:
        """The file of one frame."""
        if self.kind == "STILL":
            return self.path
        sign = "-" if number < 0 else ""
        return self.folder / f"{self.prefix}{sign}{abs(number):0{self.digits}d}{self.suffix}"


def parse_output(text: str | None, sheet: str | None, picture: str | None, base: Path) -> Output:
    """Read --output (or --contact-sheet where there is no --output).

    picture: 'png' or 'exr' for the frames of a folder, None for png. base: the folder that Blender's
    leading `//` stands for. Raises UsageProblem.
    """
    if text is None:
        if sheet is None:
            raise UsageProblem(
                "nothing to make: give --output (FILE.mp4, a folder, or name_####.png) or --contact-sheet"
            )
        path = absolute(sheet, base)
        return Output("SHEET", path, path.with_name(path.name + ".frames"), "frame_", 4, ".png")
    if not text.strip():
        raise UsageProblem("--output is empty: give FILE.mp4, a folder, or name_####.png")
    path = absolute(text, base)
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        if picture == "exr":
            raise UsageProblem("--format exr is for a sequence: a video is made from PNG frames")
        return Output("VIDEO", path, path.with_name(path.name + ".frames"), "frame_", 4, ".png")
    if suffix in OTHER_SUFFIXES:
        raise UsageProblem(
            f"--output {text}: {suffix} is not written; give FILE.mp4 for a video, or a folder, "
            "name_####.png or name_####.exr for a sequence"
        )
    if suffix in PICTURE_FORMATS and picture not in (None, suffix[1:]):
        raise UsageProblem(f"--format {picture} contradicts --output {text}: give one of the two")
    hashes = re.fullmatch(r"([^#]*)(#+)([^#]*)", path.name)
    if hashes:
        prefix, places, end = hashes.groups()
        if suffix not in PICTURE_FORMATS:
            end += f".{picture or 'png'}"
        elif not end.lower().endswith(suffix):  # "a.####" has the suffix ".####"
            end += suffix
        return Output("SEQUENCE", path.parent, path.parent, prefix, len(places), end)
    if "#" in path.name:
        raise UsageProblem(f"--output {text}: put the frame number in one place, such as name_####.png")
    if suffix in PICTURE_FORMATS:
        return Output("STILL", path, path.parent, path.stem, 0, path.suffix)
    return Output("SEQUENCE", path, path, "frame_", 4, f".{picture or 'png'}")


def absolute(text: str, base: Path) -> Path:
    """An absolute path; a leading `//` means `base`, as everywhere in Blender."""
    if text.startswith("//"):
        text = os.path.join(base, text.lstrip("/"))
    path = Path(os.path.abspath(os.path.expanduser(text)))
    if len(os.fsencode(path)) > MAX_PATH:
        raise UsageProblem(f"the path {str(path)[:60]}… is too long for Blender: choose a shorter one")
    return path


def require_writable(folder: Path, option: str) -> list[Path]:
    """Make `folder` and try to write a file in it, so that nothing is rendered in vain.

    Returns the folders that had to be made, innermost first. Raises UsageProblem, or
    RenderProblem for a full disk.
    """
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".lake_water_", suffix=".part") as probe:
            probe.write(b"\0" * 4096)
    except OSError as error:
        remove_empty(made)
        raise storage_problem(error, folder, option) from None
    return made


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of the folders that are empty, in the order given."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def require_file_name(path: Path, option: str) -> None:
    """Refuse a folder where a file is to be written. Raises UsageProblem."""
    if path.is_dir():
        raise UsageProblem(f"{option} {path}: this is a folder; give a file name in it")


def storage_problem(error: OSError, path: Path, option: str = "") -> RenderProblem:
    """What to tell a person about an error of the file system."""
    label = f"{option} {path}" if option else str(path)
    if error.errno in (28, 122):  # ENOSPC, EDQUOT: the same numbers on every Linux
        return RenderProblem(disk_full(path))
    reason = error.strerror or str(error)
    return UsageProblem(f"{label} cannot be written ({reason}): choose another folder or its permissions")


def disk_full(path: Path) -> str:
    """The message for a full disk, with what is left on it."""
    folder = path if path.is_dir() else path.parent
    try:
        left = f"{shutil.disk_usage(folder).free / 2**20:.1f} MiB left"
    except OSError:
        left = "free space unknown"
    return (
        f"the disk of {folder} is full ({left}): free some space, then run the same command with --resume; "
        "finished frames are kept"
    )


def is_whole_picture(path: Path) -> bool:
    """Whether a PNG or OpenEXR file has its end: Blender reports success for one that a full disk cut off."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    return _is_whole_exr(data) if data[:4] == b"\x76\x2f\x31\x01" else _is_whole_png(data)


def _is_whole_png(data: bytes) -> bool:
    return data[:8] == b"\x89PNG\r\n\x1a\n" and data[-8:-4] == b"IEND"


def _is_whole_exr(data: bytes) -> bool:
    """A single-part scanline file: its table of offsets is filled in last, so that a zero means cut off.

    Layout: "OpenEXR File Layout", openexr.com.
    """
    try:
        at = 8
        while data[at] != 0:  # attributes: name\0 type\0 size value
            at = data.index(b"\0", data.index(b"\0", at) + 1) + 1
            (size,) = struct.unpack_from("<i", data, at)
            at += 4 + size
        at += 1
        (first,) = struct.unpack_from("<Q", data, at)
        count = (first - at) // 8
        if count < 1:
            return False
        offsets = struct.unpack_from(f"<{count}Q", data, at)
        if min(offsets) < first:
            return False
        (size,) = struct.unpack_from("<i", data, max(offsets) + 4)  # each chunk: y, size, pixels
    except (struct.error, ValueError, IndexError):
        return False
    return max(offsets) + 8 + size <= len(data)


def png_size(path: Path) -> tuple[int, int]:
    """(width, height) from the header of a PNG file."""
    with path.open("rb") as file:
        width, height = struct.unpack(">II", file.read(24)[16:24])
    return width, height


def is_whole_mp4(path: Path) -> bool:
    """Whether a file's boxes fill it exactly and the index ('moov'), which is written last, is among them."""
    try:
        length = path.stat().st_size
        seen = set()
        at = 0
        with path.open("rb") as file:
            while at < length:
                file.seek(at)
                size, kind = struct.unpack(">I4s", file.read(8))
                if size == 1:
                    (size,) = struct.unpack(">Q", file.read(8))
                if size < 8:
                    return False
                seen.add(kind)
                at += size
    except (OSError, struct.error):
        return False
    return at == length and {b"ftyp", b"moov", b"mdat"} <= seen


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all. Raises RenderProblem."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise storage_problem(error, path) from None


def ranges(numbers: Iterable[int]) -> list[list[int]]:
    """Sorted numbers as inclusive [first, last] runs: 1, 2, 3, 7 becomes [[1, 3], [7, 7]]."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return runs


def recorded_settings(output: Output) -> dict[str, Any]:
    """The settings that frames were made with, as their record says; empty where none can be read."""
    try:
        return dict(json.loads(output.record.read_text(encoding="utf-8"))["settings"])
    except (OSError, ValueError, KeyError, TypeError):
        return {}


class Record:
    """A small JSON file beside the frames: the settings that make them and which frames are done.

    A frame counts as done only if it is listed here and its file is whole, so that neither frames of
    an older render nor a file that somebody cut off is taken over.
    """

    def __init__(self, output: Output, settings: dict[str, Any]) -> None:
        self.output = output
        # Through JSON, so that a comparison sees what a file would hold.
        self.settings: dict[str, Any] = json.loads(json.dumps(settings))
        self.done: set[int] = set()

    def resume(self, frames: Sequence[int]) -> bool:
        """Take over what an earlier run has done; False where there is none.

        Raises UsageProblem where the frames there are not known to be of these settings.
        """
        path = self.output.record
        if not path.exists():
            strangers = [f for f in frames if self.output.frame(f).exists()]
            if strangers:
                raise UsageProblem(
                    f"--resume: {self.output.frame(strangers[0])} exists, but {path.name}, which would tell "
                    "how it was made, does not: leave --resume away to render all frames anew"
                )
            return False
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            then = dict(data["settings"])
            done = {n for first, last in data["done"] for n in range(first, last + 1)}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageProblem(
                f"--resume: {path} cannot be read ({error}): leave --resume away to render all frames anew"
            ) from None
        differences = [
            f"{key}: {then.get(key, 'not set')} then, {self.settings.get(key, 'not set')} now"
            for key in sorted(then.keys() | self.settings.keys())
            if then.get(key) != self.settings.get(key)
        ]
        if differences:
            raise UsageProblem(
                f"--resume: the frames in {self.output.folder} were made with other settings ("
                + "; ".join(differences)
                + "). Give the same settings, or leave --resume away to render all frames anew"
            )
        self.done = {f for f in done if is_whole_picture(self.output.frame(f))}
        return True

    def write(self) -> None:
        """Write the record. Raises RenderProblem."""
        data = {"settings": self.settings, "done": ranges(self.done)}
        write_text(self.output.record, json.dumps(data, indent=1) + "\n")

    def remove_frames(self) -> None:
        """Remove what this render has written, and the folder if nothing else is in it.

        A folder of temporary frames may also hold those of an older, longer render: they go too.
        """
        files = {self.output.frame(frame) for frame in self.done}
        if self.output.frames_are_temporary:
            files.update(self.output.folder.glob(f"{self.output.prefix}*{self.output.suffix}"))
        for file in files:
            file.unlink(missing_ok=True)
        self.output.record.unlink(missing_ok=True)
        remove_empty([self.output.folder])
