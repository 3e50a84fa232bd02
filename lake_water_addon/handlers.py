# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's application handlers, in one place, and those who want to hear of changes.

`viewport.py` and `engine.py` subscribe a `Listener`. A scene without water costs one
look-up per update; nobody is called.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import bpy
from bpy.app.handlers import persistent

from .sun_lights import SunFinder
from .water_objects import WaterFinder

SceneCallback = Callable[[bpy.types.Scene, bpy.types.Depsgraph], None]


@dataclass(frozen=True, eq=False)
class Listener:
    """What to call when something happens; leave out what does not matter.

    loaded: another file is open, drop everything that belongs to the old one.
    undone: an undo or redo step; data-blocks may have gone, come back or moved in memory.
    updated: the depsgraph of a scene with water changed. frame_changed: such a scene's frame changed.
    calibrated: `scene.lake_water.calibration` is another. stopped: an animation of the scene plays no more.
    """

    loaded: Callable[[], None] | None = None
    undone: Callable[[], None] | None = None
    updated: SceneCallback | None = None
    frame_changed: SceneCallback | None = None
    calibrated: Callable[[bpy.types.Scene], None] | None = None
    stopped: Callable[[bpy.types.Scene], None] | None = None


@dataclass
class _State:
    """What lives between register() and unregister()."""

    finder: WaterFinder = field(default_factory=WaterFinder)
    suns: SunFinder = field(default_factory=SunFinder)
    listeners: list[Listener] = field(default_factory=list)
    statistics: tuple[str, ...] = ()

    def forget_objects(self) -> None:
        """Keep no reference to any object."""
        self.finder.forget()
        self.suns.forget()


_state: _State | None = None


def _require_state() -> _State:
    if _state is None:
        raise RuntimeError("Lake Water is not registered: call lake_water_addon.register() first")
    return _state


def subscribe(listener: Listener) -> None:
    """Call the listener from now on, until `unsubscribe` or the end of the registration."""
    _require_state().listeners.append(listener)


def unsubscribe(listener: Listener) -> None:
    """No longer call the listener; one that is not subscribed is no error."""
    if _state is not None and listener in _state.listeners:
        _state.listeners.remove(listener)


def waters(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The water objects of the scene, cheap enough for a panel's poll()."""
    return _require_state().finder.waters(scene)


def has_sun(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether the scene has a sun light, cheap enough for a panel. view_layer: one of the scene's."""
    return _require_state().suns.has_sun(scene, view_layer)


def publish_statistics(lines: Sequence[str]) -> None:
    """Lines of text that the Display panel shows below its switch, such as the time of each pass."""
    _require_state().statistics = tuple(lines)


def statistics() -> tuple[str, ...]:
    """The lines published last."""
    return _state.statistics if _state is not None else ()


def notify_calibrated(scene: bpy.types.Scene) -> None:
    """Tell all listeners that the scene has another calibration."""
    for listener in tuple(_require_state().listeners):
        _call(listener.calibrated, scene)


def _call(callback: Callable[..., None] | None, *args: object) -> None:
    """Call one listener. Its error is printed and must not keep the others from hearing."""
    if callback is None:
        return
    try:
        callback(*args)
    except Exception:
        traceback.print_exc()


@persistent
def _forget_objects(*_args: object) -> None:
    """Before the objects in memory are exchanged: no reference may outlive them."""
    if _state is not None:
        _state.forget_objects()


@persistent
def _load_post(_filepath: str, *_args: object) -> None:
    if _state is None:
        return
    _state.forget_objects()
    _state.statistics = ()
    for listener in tuple(_state.listeners):
        _call(listener.loaded)


@persistent
def _undo_post(_scene: bpy.types.Scene, *_args: object) -> None:
    if _state is None:
        return
    _state.forget_objects()
    for listener in tuple(_state.listeners):
        _call(listener.undone)


@persistent
def _depsgraph_update_post(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _state is None or not _state.finder.changed(scene, depsgraph):
        return
    for listener in tuple(_state.listeners):
        _call(listener.updated, scene, depsgraph)


@persistent
def _frame_change_post(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _state is None or not _state.finder.changed(scene, depsgraph):
        return
    for listener in tuple(_state.listeners):
        _call(listener.frame_changed, scene, depsgraph)


@persistent
def _animation_playback_post(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph) -> None:
    if _state is None:
        return
    for listener in tuple(_state.listeners):
        _call(listener.stopped, scene)


HANDLERS = (
    ("load_pre", _forget_objects),
    ("undo_pre", _forget_objects),
    ("redo_pre", _forget_objects),
    ("load_post", _load_post),
    ("undo_post", _undo_post),
    ("redo_post", _undo_post),
    ("depsgraph_update_post", _depsgraph_update_post),
    ("frame_change_post", _frame_change_post),
    ("animation_playback_post", _animation_playback_post),
)


def register() -> None:
    """Start to listen."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    _state = _State()
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)


def unregister() -> None:
    """Stop to listen and forget everyone."""
    global _state  # noqa: PLW0603
    for name, function in HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)
    _state = None
