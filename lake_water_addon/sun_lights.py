# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a scene has a sun light: without one there are no caustics, shadows or glow."""

from __future__ import annotations

import bpy


def _is_sun(obj: bpy.types.Object) -> bool:
    return obj.type == "LIGHT" and obj.data.type == "SUN"


def _find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """A sun of the scene, or one in a collection that the scene instances."""
    collections = {}
    for obj in scene.objects:
        if _is_sun(obj):
            return obj
        if obj.instance_collection is not None:
            collections[obj.instance_collection.session_uid] = obj.instance_collection
    return next((obj for c in collections.values() for obj in c.all_objects if _is_sun(obj)), None)


class SunFinder:
    """Remembers each scene's sun, so that a panel need not look at every object.

    The references are kept only while Blender keeps the objects in place: `forget` them before
    and after loading and undo.
    """

    def __init__(self) -> None:
        self._suns: dict[int, bpy.types.Object] = {}  # by the scene's session_uid

    def forget(self) -> None:
        """Look at the objects again at the next question."""
        self._suns.clear()

    def has_sun(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> bool:
        """Whether the scene has a sun light, hidden or not. view_layer: one of the scene's."""
        if not any(light.type == "SUN" for light in bpy.data.lights):
            return False
        known = self._suns.get(scene.session_uid)
        if known is not None and _is_seen_sun(known, view_layer):
            return True
        found = _find(scene)
        if found is None:
            self._suns.pop(scene.session_uid, None)
            return False
        self._suns[scene.session_uid] = found
        return True


def _is_seen_sun(obj: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether an object, possibly deleted, is a sun that the view layer shows; 3 us in any scene."""
    try:
        return _is_sun(obj) and obj.visible_get(view_layer=view_layer)
    except ReferenceError:
        return False
