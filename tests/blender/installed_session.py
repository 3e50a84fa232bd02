# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by test_installed_extension.py in a Blender of its own: the life of an installed extension.

    python -I installed_session.py ZIP PICTURE

Installs the zip, uses it, disables it, uninstalls it, and prints what it saw as JSON in the last line.
Blender's user folder is the one in BLENDER_USER_RESOURCES. The checkout is not on the path, so whatever
works here works from the zip alone.
"""

import importlib.util
import json
import sys

import bpy

REPOSITORY = "user_default"
MODULE = f"bl_ext.{REPOSITORY}.lake_water"
ZIP, PICTURE = sys.argv[1:]


def traces() -> dict[str, list[str]]:
    """Whatever of the extension Blender knows or Python holds at this moment, by kind."""
    attributes = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    handler_lists = {name: value for name, value in attributes.items() if isinstance(value, list)}
    types = {name: getattr(bpy.types, name) for name in dir(bpy.types)}
    return {
        "modules": [name for name in sys.modules if name.startswith(MODULE)],
        "classes": [name for name, cls in types.items() if getattr(cls, "__module__", "").startswith(MODULE)],
        "operators": dir(bpy.ops.lake_water),
        "properties": [
            f"{owner.__name__}.{name}"
            for owner in (bpy.types.Object, bpy.types.Scene)
            for name in owner.bl_rna.properties.keys()
            if name == "lake_water"
        ],
        "handlers": [
            f"{name}: {handler.__qualname__}"
            for name, handlers in handler_lists.items()
            for handler in handlers
            if getattr(handler, "__module__", "").startswith(MODULE)
        ],
        "engines": [
            cls.__name__
            for cls in bpy.types.RenderEngine.__subclasses__()
            if cls.__module__.startswith(MODULE) and cls.is_registered
        ],
        "panels of other engines": [
            name for name, cls in types.items() if "LAKE_WATER" in getattr(cls, "COMPAT_ENGINES", ())
        ],
        "preset folders": bpy.utils.preset_paths("lake_water"),
        "add-ons": [name for name in bpy.context.preferences.addons.keys() if name == MODULE],
    }


def add_water() -> dict[str, object]:
    """A water body by the operator, in the file that Blender starts with."""
    bpy.ops.lake_water.add_water()
    water = bpy.context.object
    return {"enabled": water.lake_water.enabled, "waves": len(water.lake_water.waves)}


def render() -> str:
    """A small picture of the demonstration lake by the engine; returns the engine's name."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.lake_water.add_lake(detail=0.1)
    scene = bpy.context.scene
    scene.render.engine = "LAKE_WATER"
    scene.render.resolution_x, scene.render.resolution_y = 160, 90
    scene.render.resolution_percentage = 100
    scene.lake_water.samples = 1
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = PICTURE
    bpy.ops.render.render(write_still=True)
    return scene.render.engine


report = {"checkout importable": importlib.util.find_spec("lake_water_addon") is not None}
report["before"] = traces()

bpy.ops.extensions.package_install_files(repo=REPOSITORY, filepath=ZIP, enable_on_install=True)
report["enabled"] = traces()
report["file"] = sys.modules[MODULE].__file__ if MODULE in sys.modules else None
report["water"] = add_water()
report["engine"] = render()

bpy.ops.preferences.addon_disable(module=MODULE)
report["disabled"] = traces()

bpy.ops.preferences.addon_enable(module=MODULE)
report["enabled again"] = traces()

repositories = [repository.module for repository in bpy.context.preferences.extensions.repos]
bpy.ops.extensions.package_uninstall(repo_index=repositories.index(REPOSITORY), pkg_id="lake_water")
report["uninstalled"] = traces()

print(json.dumps(report))
