# SPDX-License-Identifier: GPL-3.0-or-later
"""Registering leaves nothing behind: all modules or none, a hundred times over."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType

import bpy
import pytest

import lake_water_addon
from lake_water_addon import handlers, registration


def blender_state() -> dict[str, object]:
    """Everything of Blender that an add-on's register() can add to."""
    return {
        "handlers": {
            name: [f"{f.__module__}.{f.__qualname__}" for f in functions]
            for name in dir(bpy.app.handlers)
            if isinstance(functions := getattr(bpy.app.handlers, name), list)
        },
        "types": sorted(dir(bpy.types)),
        "operators": sorted(dir(bpy.ops.lake_water)),
        "object properties": sorted(p.identifier for p in bpy.types.Object.bl_rna.properties),
        "scene properties": sorted(p.identifier for p in bpy.types.Scene.bl_rna.properties),
        "panels of the engine": sorted(
            name
            for name in dir(bpy.types)
            if "LAKE_WATER" in getattr(getattr(bpy.types, name), "COMPAT_ENGINES", ())
        ),
        "engines": sorted(
            cls.__name__ for cls in bpy.types.RenderEngine.__subclasses__() if cls.is_registered
        ),
    }


@pytest.fixture
def unregistered() -> Iterator[dict[str, object]]:
    """The state of Blender without the extension, which the session's fixture has registered."""
    lake_water_addon.unregister()
    state = blender_state()
    assert state["operators"] == [] and state["panels of the engine"] == [], "unregister() left something"
    yield state
    if not hasattr(bpy.types.Scene, "lake_water"):
        lake_water_addon.register()


def test_a_hundred_registrations_leave_nothing(unregistered: dict[str, object]) -> None:
    lake_water_addon.register()
    registered = blender_state()
    lake_water_addon.unregister()
    for _ in range(99):
        lake_water_addon.register()
        lake_water_addon.unregister()
    assert blender_state() == unregistered
    lake_water_addon.register()
    assert blender_state() == registered
    assert registered != unregistered, "register() did nothing"


@pytest.mark.parametrize("position", range(len(registration.MODULES) + 1))
def test_failure_of_one_module_rolls_back_the_others(
    unregistered: dict[str, object], monkeypatch: pytest.MonkeyPatch, position: int
) -> None:
    broken = ModuleType("lake_water_addon.broken")

    def register() -> None:
        raise RuntimeError("broken on purpose")

    broken.register = register
    monkeypatch.setitem(sys.modules, "lake_water_addon.broken", broken)
    names = [*registration.MODULES]
    names.insert(position, "broken")
    with pytest.raises(RuntimeError, match="broken on purpose"):
        registration.register(names)
    assert blender_state() == unregistered


def test_module_that_cannot_be_imported_rolls_back_the_others(unregistered: dict[str, object]) -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        registration.register([*registration.MODULES, "no_such_module"])
    assert blender_state() == unregistered


def test_failing_unregister_does_not_keep_the_others(
    unregistered: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = ModuleType("lake_water_addon.broken")

    def unregister() -> None:
        raise RuntimeError("broken on purpose")

    broken.unregister = unregister
    monkeypatch.setitem(sys.modules, "lake_water_addon.broken", broken)
    lake_water_addon.register()
    with pytest.raises(RuntimeError, match="broken on purpose"):
        registration.unregister([*registration.MODULES, "broken"])
    assert blender_state() == unregistered


def test_second_copy_is_refused_and_leaves_the_first_alone() -> None:
    before = blender_state()
    with pytest.raises(RuntimeError, match="Another copy of Lake Water"):
        lake_water_addon.register()
    assert blender_state() == before


def test_handlers_survive_loading_a_file_and_hear_of_it() -> None:
    heard: list[str] = []
    listener = handlers.Listener(
        loaded=lambda: heard.append("loaded"),
        updated=lambda scene, depsgraph: heard.append("updated"),
        frame_changed=lambda scene, depsgraph: heard.append("frame"),
    )
    handlers.subscribe(listener)
    try:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        assert heard == ["loaded"]
        bpy.ops.mesh.primitive_cube_add()
        bpy.context.scene.frame_set(7)
        assert heard == ["loaded"], "a scene without water must call nobody"
        bpy.ops.lake_water.add_water()
        bpy.context.view_layer.update()
        assert "updated" in heard, "new water was not noticed"
        heard.clear()
        bpy.context.scene.frame_set(8)
        assert "frame" in heard
        heard.clear()
        bpy.data.objects.remove(bpy.context.object)
        bpy.context.view_layer.update()
        assert "updated" in heard, "the loss of the last water was not noticed"
        heard.clear()
        bpy.context.scene.frame_set(9)
        assert heard == []
    finally:
        handlers.unsubscribe(listener)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert heard == [], "called after unsubscribe()"


def test_error_in_one_listener_reaches_the_console_and_not_the_others(
    capfd: pytest.CaptureFixture[str],
) -> None:
    heard: list[str] = []

    def fail() -> None:
        raise RuntimeError("listener broken on purpose")

    broken, sound = handlers.Listener(loaded=fail), handlers.Listener(loaded=lambda: heard.append("loaded"))
    handlers.subscribe(broken)
    handlers.subscribe(sound)
    try:
        bpy.ops.wm.read_factory_settings(use_empty=True)
    finally:
        handlers.unsubscribe(broken)
        handlers.unsubscribe(sound)
    assert heard == ["loaded"]
    assert "listener broken on purpose" in capfd.readouterr().err
