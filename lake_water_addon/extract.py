# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's evaluated depsgraph to `core.snapshot`: what the hosts of a frame use."""

from .extraction.cameras import camera_from_object, camera_from_view
from .extraction.scene import SceneExtractor, view_visibility

__all__ = ["SceneExtractor", "camera_from_object", "camera_from_view", "view_visibility"]
