# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame renderer for all picture tests, so that shaders are compiled once."""

import pytest


@pytest.fixture(scope="session")
def renderer(gpu):
    from lake_water_addon.render.frame import FrameRenderer

    return FrameRenderer()
