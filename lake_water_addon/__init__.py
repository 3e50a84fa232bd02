# SPDX-License-Identifier: GPL-3.0-or-later
"""Lake Water: real-time lake water with refraction and reflection, a Blender extension."""


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    from . import registration

    registration.unregister()
