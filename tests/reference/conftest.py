# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame renderer for the tests that hold the extension's picture against the reference."""

import pytest


@pytest.fixture(scope="session")
def renderer(gpu):
    from lake_water_addon.render.frame import FrameRenderer

    return FrameRenderer()
