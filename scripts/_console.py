# SPDX-License-Identifier: GPL-3.0-or-later
"""The script and the person at the keyboard: progress, Blender's chatter, Ctrl-C.

Standard library only, because Blender's own Python has no progress bar to import.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from types import FrameType
from typing import TextIO

STOPPED = "stopped; the same command with --resume goes on with the first missing frame"

# What Blender and Mesa say although all is well; whatever else they say is passed on.
NOISE = re.compile(
    r"EGL Error \(0x(3009|300C)\)|^(\S+ +)?render +\| (Saved|Video append)|^(\S+ +)?blend +\| Read blend|"
    r"^Fra:\d|^Saved: |^ *Time: [\d:.]+ \(Saving|^Info: |"
    r"^(\S+ +)?color_management +\| Using OCIO|^OBJ import of"
)

RECENT = 20  # frames that the estimate looks back on: the first one is slower, it compiles the shaders


def duration(seconds: float) -> str:
    """Seconds as 4 s, 1:07 or 2:03:09, rounded up: an estimate that reads 0 while work is left is no use."""
    whole = int(-(-seconds // 1))
    minutes, s = divmod(whole, 60)
    hours, m = divmod(minutes, 60)
    if hours:
        return f"{hours}:{m:02d}:{s:02d}"
    return f"{m}:{s:02d}" if m else f"{s} s"


class Progress:
    """Counts frames of a render. stream: where to write; total: frames to be rendered in this run."""

    def __init__(self, stream: TextIO, total: int) -> None:
        self.stream = stream
        self.total = total
        self.times: list[float] = []
        self.bar = stream.isatty() and os.environ.get("TERM") != "dumb"
        self._last = time.monotonic()

    @property
    def seconds_left(self) -> float:
        """Median of the recent frames' times, times the frames that are left."""
        return median(self.times[-RECENT:]) * (self.total - len(self.times)) if self.times else 0.0

    def start(self) -> None:
        """Draw the empty bar and start the clock."""
        self._last = time.monotonic()
        if self.bar and self.total:
            self._draw("")

    def step(self, frame: int) -> float:
        """A frame is in its place. Returns the seconds since the last one."""
        now = time.monotonic()
        seconds = now - self._last
        self._last = now
        self.times.append(seconds)
        left = duration(self.seconds_left) if len(self.times) < self.total else ""
        if self.bar:
            self._draw(f"frame {frame}, {seconds:.2f} s" + (f", {left} left" if left else ""))
        else:
            count = f"{len(self.times)}/{self.total}"
            self.line(f"frame {frame} ({count}): {seconds:.2f} s" + (f", {left} left" if left else ""))
        return seconds

    def line(self, text: str) -> None:
        """A line of text of its own, above the bar."""
        clear = "\r\x1b[K" if self.bar else ""
        self.stream.write(f"{clear}{text}\n")
        self.stream.flush()

    def close(self) -> None:
        """Leave the bar as it is and go to the next line."""
        if self.bar and self.times:
            self.stream.write("\n")
            self.stream.flush()

    def _draw(self, text: str) -> None:
        count = f" {len(self.times)}/{self.total} "
        width = shutil.get_terminal_size().columns
        cells = max(min(30, width - len(count) - len(text) - 3), 0)
        full = cells * len(self.times) // self.total
        bar = f"[{'#' * full}{'.' * (cells - full)}]" if cells > 3 else ""
        self.stream.write("\r\x1b[K" + (bar + count + text)[: width - 1])
        self.stream.flush()


class Interrupted(BaseException):
    """Ctrl-C or a request to terminate. signum: the signal."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum


class Interrupts:
    """Ctrl-C ends the script at once between frames, and after the frame while one is drawn.

    A second Ctrl-C in a frame ends the process there and then; only the unfinished file is removed.
    """

    def __init__(self) -> None:
        self.caught: int | None = None
        self.say: Callable[[str], None] = print
        self._part: Path | None = None
        self._at_once = False

    def install(self) -> None:
        """Take over the signals: Blender's own handler would break the frame off and go on with the next."""
        for signum in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signum, self._handle)

    def ignore(self) -> None:
        """From now on nothing is stopped any more: the script is about to end anyway."""
        for signum in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signum, signal.SIG_IGN)

    def check(self) -> None:
        """Raise Interrupted if a signal has come (Blender swallows what is raised inside its callbacks)."""
        if self.caught is not None:
            raise Interrupted(self.caught)

    @contextlib.contextmanager
    def after(self, part: Path, *, at_once: bool = False) -> Iterator[None]:
        """Let the block finish; `part` is the file that it is writing. at_once: give the file up instead."""
        self.check()
        self._part, self._at_once = part, at_once
        try:
            yield
        finally:
            self._part = None

    def _handle(self, signum: int, frame: FrameType | None) -> None:
        again, self.caught = self.caught is not None, signum
        if self._part is None:
            raise Interrupted(signum)
        if again or self._at_once:
            self.say(STOPPED)
            self._part.unlink(missing_ok=True)
            os._exit(128 + signum)
        self.say("stopping after this frame; Ctrl-C again stops at once")


class Console:
    """Where messages go, whatever Blender does with the standard streams. verbose: show its chatter too."""

    def __init__(self, verbose: bool) -> None:
        self.verbose = verbose
        # Copies, which still lead to the person while `quiet` has turned the originals away.
        self.out: TextIO = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="replace", buffering=1)
        self.err: TextIO = os.fdopen(os.dup(2), "w", encoding="utf-8", errors="replace", buffering=1)

    def warn(self, text: str) -> None:
        """A line on standard error."""
        self.err.write(f"render.py: {text}\n")

    @contextlib.contextmanager
    def quiet(self) -> Iterator[None]:
        """Collect what Blender prints in the block, and pass on what is more than noise."""
        if self.verbose:
            yield
            return
        sys.stdout.flush()
        sys.stderr.flush()
        with tempfile.TemporaryFile() as file:
            for number in (1, 2):
                os.dup2(file.fileno(), number)
            try:
                yield
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os.dup2(self.out.fileno(), 1)
                os.dup2(self.err.fileno(), 2)
                file.seek(0)
                text = file.read().decode("utf-8", "replace")
        lines = [line for line in text.splitlines() if line.strip(" |") and not NOISE.search(line)]
        if lines:
            self.err.write("\n".join(lines) + "\n")
