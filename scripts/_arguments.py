# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of the scripts' command-line options: each takes the text and says what is wrong with it."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

COUNTS = {2: "two", 3: "three", 4: "four"}


def number(text: str) -> float:
    """A finite decimal number."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


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
