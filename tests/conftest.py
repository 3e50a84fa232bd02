# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures shared by the tests.

``tests/core`` runs on numpy alone, so nothing here imports bpy before a test asks for it. A test that needs
Blender takes ``blender``; a test that needs a GPU context takes ``gpu``. A missing bpy, a failed registration
or a missing GL context is an error, never a skip: a green run means that everything was tried.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def bpy_module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The bpy module, with preferences and extensions in a folder of this run's own.

    Blender reads the variable once, when bpy is imported: without it a test run could read, or change, the
    settings of the person who runs it.
    """
    os.environ["BLENDER_USER_RESOURCES"] = str(tmp_path_factory.mktemp("blender_user"))
    import bpy

    return bpy


@pytest.fixture(scope="session")
def registered_addon(bpy_module: ModuleType) -> Iterator[ModuleType]:
    """The extension, registered from the checkout for the whole run and unregistered at its end."""
    import lake_water_addon

    lake_water_addon.register()
    yield lake_water_addon
    lake_water_addon.unregister()


@pytest.fixture
def blender(bpy_module: ModuleType, registered_addon: ModuleType) -> ModuleType:
    """bpy with the extension registered and an empty file: no object, no camera, default settings."""
    bpy_module.ops.wm.read_factory_settings(use_empty=True)
    return bpy_module


@pytest.fixture(scope="session")
def gpu(bpy_module: ModuleType) -> ModuleType:
    """The gpu module with a context that works without a display (software OpenGL where there is no GPU)."""
    import gpu as gpu_module

    try:
        gpu_module.init()
    except SystemError as error:
        pytest.fail(f"no OpenGL context ({error}): `make setup` installs EGL and Mesa", pytrace=False)
    return gpu_module
