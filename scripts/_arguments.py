# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of the scripts' command-line options: each takes the text and says what is wrong with it."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from typing import NamedTuple

COUNTS = {2: "two", 3: "three", 4: "four"}


def number(text: str) -> float:
    """A finite decimal number."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


class Limit(NamedTuple):
    """What a picture may take, TIME in s, or how far off it may be, in PIXELS or FLIP. text: as given."""

    text: str
    kind: str
    value: float


def _limit(text: str, units: dict[str, tuple[str, float]], example: str) -> Limit:
    """units: kind and factor by what may follow the number."""
    match = re.fullmatch(r"\s*([0-9.]+(?:e[-+]?\d+)?)\s*([a-z]+)\s*", text.lower())
    if match is None or match[2] not in units:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number and its unit like {example}")
    kind, factor = units[match[2]]
    value = factor * number(match[1])
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text}: must be more than 0")
    return Limit(text.strip(), kind, value)


def time_limit(text: str) -> Limit:
    """Milliseconds or seconds that a picture may take."""
    return _limit(text, {"ms": ("TIME", 1e-3), "s": ("TIME", 1.0)}, "33ms or 2s")


def error_limit(text: str) -> Limit:
    """Pixels or FLIP that a picture may be off."""
    return _limit(text, {"px": ("PIXELS", 1.0), "flip": ("FLIP", 1.0)}, "1px or 0.05flip")


def identifier(text: str) -> str:
    """A name as Blender writes it: GPU_POINTS for gpu-points."""
    return text.upper().replace("-", "_")


def count(text: str) -> int:
    """A whole number of at least 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is too small, give at least 1")
    return value


def size(text: str) -> tuple[int, int]:
    """Two whole numbers of at least 1 with an x between them."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isascii() and p.isdigit() for p in parts):
        raise argparse.ArgumentTypeError(f"{text!r}: give two whole numbers like 640x480")
    first, second = int(parts[0]), int(parts[1])
    if not first or not second:
        raise argparse.ArgumentTypeError(f"{text}: both numbers must be at least 1")
    return first, second


def numbers(length: int) -> Callable[[str], tuple[float, ...]]:
    """So many numbers with commas between them."""

    def parse(text: str) -> tuple[float, ...]:
        try:
            values = tuple(number(part) for part in text.split(","))
        except ValueError:
            values = ()
        if len(values) != length:
            example = ",".join(("0", "0.2", "0.1", "1")[:length])
            raise argparse.ArgumentTypeError(f"{text!r}: give {COUNTS[length]} numbers like {example}")
        return values

    return parse
