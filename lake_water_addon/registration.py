# SPDX-License-Identifier: GPL-3.0-or-later
"""Registers the modules of the extension in order, all of them or none."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from types import ModuleType

import bpy

# Later modules use what earlier ones registered. Each has register() and unregister(), and undoes its own
# half-done register() before it raises.
MODULES = (
    "properties",
    "preferences",
    "handlers",
    "operators",
    "presets",
    "budget",
    "engine",
    "calibrate_operator",
    "nodes.switching",
    "viewport",
    "panels",
)


def register(names: Sequence[str] = MODULES) -> None:
    """Import and register the modules in order.

    names: modules of this package. When one fails, those before it are unregistered in
    reverse order and the error goes on to the caller (Blender shows it in the preferences).
    """
    registered: list[ModuleType] = []
    try:
        for name in names:
            module = importlib.import_module(f".{name}", __package__)
            module.register()
            registered.append(module)
    except Exception as error:
        for module in reversed(registered):
            try:
                module.unregister()
            except Exception as second:
                error.add_note(f"While undoing this, {module.__name__}.unregister() failed too: {second}")
        raise


def unregister(names: Sequence[str] = MODULES) -> None:
    """Unregister the modules in reverse order.

    One that fails does not keep the others registered; the first error is raised at the end.
    """
    first: Exception | None = None
    for name in reversed(names):
        module = importlib.import_module(f".{name}", __package__)
        try:
            module.unregister()
        except Exception as error:
            error.add_note(f"raised by {module.__name__}.unregister()")
            first = first or error
    if first is not None:
        raise first


def register_classes(classes: Sequence[type]) -> None:
    """Register classes with Blender in order, all of them or none."""
    done: list[type] = []
    try:
        for cls in classes:
            bpy.utils.register_class(cls)
            done.append(cls)
    except Exception:
        unregister_classes(done)
        raise


def unregister_classes(classes: Sequence[type]) -> None:
    """Unregister classes in reverse order."""
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
