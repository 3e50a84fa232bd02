# SPDX-License-Identifier: GPL-3.0-or-later
"""Who evaluates the water's nodes, and when: as the engine and the viewports want it.

LAKE_WATER and the draw handler displace the surface on the graphics card, and Blender must not do the
same work once more. So, for each water object:

- while all its scenes render with LAKE_WATER, nothing drives modifier and material, and the modifier
  is off;
- with another engine they are driven, and the modifier is on for renders (F12, `blender -b`);
- it is on for viewports while one of them is in Rendered mode with such an engine, and always where
  there is no window and so no draw handler.

What changes the answer, and how it is noticed: the engine set by a person or by Python (the depsgraph
handler: the scene is tagged), on the command line (`render_init`); a viewport's shading mode, a closed
area or window (each is followed by a redraw: a draw handler compares, and a timer changes the data);
new, duplicated or linked water and waves added or removed (the depsgraph handler, and that for a new
frame: a script may have had no update in between); loading, undo.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.app.handlers import persistent

from .. import handlers
from ..water_objects import waters_of
from . import carry

OWN_ENGINE = "LAKE_WATER"
ENGINES_WITHOUT_NODES = {OWN_ENGINE, "BLENDER_WORKBENCH"}


@dataclass(frozen=True)
class Viewports:
    """Whether some, and whether all, of the viewports show the water of Blender's own engine."""

    some: bool
    all: bool


class _State:
    """What lives between register() and unregister()."""

    def __init__(self) -> None:
        self.listener: handlers.Listener | None = None
        self.draw_handle: object | None = None
        self.viewports = Viewports(False, False)  # what the objects were set up for last


_state: _State | None = None


def shows_nodes(space: bpy.types.SpaceView3D, engine: str) -> bool:
    """Whether a viewport shows the water of Blender's own engine, and the draw handler must keep out."""
    return space.shading.type == "RENDERED" and engine not in ENGINES_WITHOUT_NODES


def _look_at_viewports() -> Viewports:
    """What the windows show; in background mode, with nothing drawn, some do and nothing is hidden by it."""
    if bpy.app.background:
        return Viewports(True, False)
    shown = [
        shows_nodes(area.spaces.active, window.scene.render.engine)
        for manager in bpy.data.window_managers
        for window in manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]
    return Viewports(any(shown), bool(shown) and all(shown))


def _is_for_other_engine(obj: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Whether a scene that has the object, such as the one given, renders with another engine."""
    if scene.render.engine != OWN_ENGINE:
        return True
    if len(bpy.data.scenes) == 1:
        return False
    return any(user.render.engine != OWN_ENGINE for user in obj.users_scene)


def update(scene: bpy.types.Scene) -> None:
    """Dress and switch a scene's water objects as they are to be now. Changes nothing that is right."""
    _state.viewports = _look_at_viewports()
    for obj in handlers.waters(scene):
        _update_object(obj, scene, _state.viewports)


def _update_object(obj: bpy.types.Object, scene: bpy.types.Scene, viewports: Viewports) -> None:
    wanted = _is_for_other_engine(obj, scene)
    if carry.is_editable(obj):
        if not carry.is_dressed(obj):
            carry.dress(obj)
        if carry.waves_shown(obj) != (carry.wave_count(obj) if wanted else None):
            carry.set_waves(obj, wanted=wanted)
    carry.set_visibility(obj, render=wanted, viewport=wanted and viewports.some)
    # As wires, so that no viewport draws faces below the draw handler's water (see water_objects.py). Where
    # no handler draws, the wires of a fine grid would cover the water.
    display = "TEXTURED" if viewports.all else "WIRE"
    if scene.lake_water.show_in_viewport and obj.display_type in {"TEXTURED", "WIRE"} - {display}:
        obj.display_type = display


def update_file() -> None:
    """All scenes of the file, and node groups that an older version built."""
    carry.upgrade_groups()
    for scene in bpy.data.scenes:
        if waters_of(scene):
            update(scene)


def _updated(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph) -> None:
    update(scene.original)


@persistent
def _render_init(scene: bpy.types.Scene, *_args: object) -> None:
    """The command line sets the engine (`-E`) and tells nobody."""
    if _state is not None:
        update(scene)


@persistent
def _save_pre(*_args: object) -> None:
    for scene in bpy.data.scenes:
        for obj in waters_of(scene):
            if carry.is_editable(obj):
                carry.note_values(obj)


def _enabled_late() -> None:
    """The extension was enabled with a file open, or by a script after Blender had loaded one (`-P`)."""
    for scene in bpy.data.scenes:
        for obj in waters_of(scene):
            if carry.is_editable(obj) and carry.is_dressed(obj):
                carry.drive_again(obj)
    update_file()


def _after_drawing() -> None:
    """Draw handler: data must not be changed while drawing, so a timer does it."""
    if _state is None or _look_at_viewports() == _state.viewports:
        return
    if not bpy.app.timers.is_registered(_follow_viewports):
        bpy.app.timers.register(_follow_viewports, first_interval=0.0)


def _follow_viewports() -> None:
    if _state is not None:
        for scene in bpy.data.scenes:
            update(scene)


def register() -> None:
    """Start to follow engine and viewports."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    _state = _State()
    _state.listener = handlers.Listener(
        loaded=update_file, undone=update_file, updated=_updated, frame_changed=_updated
    )
    handlers.subscribe(_state.listener)
    bpy.app.handlers.render_init.append(_render_init)
    bpy.app.handlers.save_pre.append(_save_pre)
    if isinstance(bpy.data, bpy.types.BlendData):  # not while Blender starts: then a file is loaded later
        _enabled_late()
    if not bpy.app.background:
        add = bpy.types.SpaceView3D.draw_handler_add
        _state.draw_handle = add(_after_drawing, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Leave the objects as they are."""
    global _state  # noqa: PLW0603
    if _state is None:
        return
    if _state.draw_handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_state.draw_handle, "WINDOW")
    if bpy.app.timers.is_registered(_follow_viewports):
        bpy.app.timers.unregister(_follow_viewports)
    bpy.app.handlers.save_pre.remove(_save_pre)
    bpy.app.handlers.render_init.remove(_render_init)
    handlers.unsubscribe(_state.listener)
    _state = None
