# SPDX-License-Identifier: GPL-3.0-or-later
"""Every test in this folder starts from an empty Blender file with the extension registered."""

from __future__ import annotations

from types import ModuleType

import pytest


@pytest.fixture(autouse=True)
def _fresh_file(blender: ModuleType) -> None:
    """Asking for ``blender`` resets the file; a test need not name the fixture to get that."""
