# SPDX-License-Identifier: GPL-3.0-or-later
"""Version numbers of what is extracted."""

from __future__ import annotations

import itertools

# One counter for the process, though it is a global: a version is never given twice, whoever extracts.
_counter = itertools.count(1)


def next_version() -> int:
    """A number greater than every one before."""
    return next(_counter)
