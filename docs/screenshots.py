# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the extension in Blender's window: its panel, and the water in three shading modes.

    blender -P docs/screenshots.py -- docs/images

Needs a Blender 5.2 with a window (Xvfb will do). Builds the demonstration lake, opens the tab "Lake Water",
plays some frames in each shading mode and saves viewport_solid.png, viewport_material_preview.png and
viewport_rendered.png. Uses the installed extension where it is enabled, else this checkout's package.
Options: --detail D (of the lake), --frames N (played before each picture). Exit status: 0 all pictures are
there, 1 something failed, 2 wrong command line.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[1]
TAB = "Lake Water"
SHADING = {
    "viewport_solid": "SOLID",
    "viewport_material_preview": "MATERIAL",
    "viewport_rendered": "RENDERED",
}
SETTLE = 0.2  # seconds that Blender gets to handle events between two steps


class ScreenshotError(Exception):
    """The pictures cannot be made; the message says why."""


def read_options() -> argparse.Namespace:
    """The command line after Blender's own ``--``."""
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    parser = argparse.ArgumentParser(prog="blender -P docs/screenshots.py --")
    parser.add_argument("folder", type=Path, help="where the pictures go; made if it is not there")
    parser.add_argument("--detail", type=float, default=1.0, help="level of detail of the lake (default 1)")
    parser.add_argument("--frames", type=int, default=10, help="frames played before a picture (default 10)")
    return parser.parse_args(own)


def enable_extension() -> None:
    """Use the installed extension if it is enabled, else register the checkout's package."""
    if hasattr(bpy.types.Scene, "lake_water"):
        return
    sys.path.insert(0, str(ROOT))
    import lake_water_addon

    lake_water_addon.register()


def view3d() -> tuple[bpy.types.Window, bpy.types.Area, bpy.types.Region, bpy.types.SpaceView3D]:
    """Window, area, main region and space of the first 3D viewport."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                return window, area, next(r for r in area.regions if r.type == "WINDOW"), area.spaces.active
    raise ScreenshotError("no window shows a 3D viewport")


def in_viewport() -> bpy.types.Context:
    """Context override of the viewport. To be made anew after each redraw, which drops area and region."""
    window, area, region, space = view3d()
    return bpy.context.temp_override(window=window, area=area, region=region, space_data=space)


def redraw() -> None:
    """Draw the window once, now."""
    with in_viewport():
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)


def is_blank(path: Path) -> bool:
    """Whether a picture holds a single colour, as Blender's own screenshot does on some drivers."""
    image = bpy.data.images.load(str(path))
    try:
        rows = image.size[1]
        row = 4 * image.size[0]
        values = [image.pixels[r * row : (r + 1) * row] for r in range(0, rows, max(rows // 16, 1))]
    finally:
        bpy.data.images.remove(image)
    return all(value[:3] == values[0][:3] for line in values for value in zip(*[iter(line)] * 4, strict=True))


def screenshot(path: Path) -> None:
    """The whole window as a PNG: by Blender, or by ImageMagick's ``import`` from the X server."""
    redraw()
    window, area, region, _ = view3d()
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.screenshot(filepath=str(path), check_existing=False)
    if not is_blank(path):
        return
    if not (os.environ.get("DISPLAY") and shutil.which("import")):
        raise ScreenshotError("Blender's own screenshot is blank on this driver: install ImageMagick")
    redraw()
    subprocess.run(["import", "-window", "root", str(path)], check=True)
    if is_blank(path):
        raise ScreenshotError(f"{path} is blank")


def wait_for_shaders() -> Iterator[float]:
    """Material Preview draws grey until EEVEE's shaders are compiled."""
    redraw()
    yield SETTLE
    while bpy.app.is_job_running("SHADER_COMPILATION"):
        yield SETTLE
    redraw()
    yield SETTLE


def steps(options: argparse.Namespace) -> Iterator[float]:
    """The whole session; each yield gives Blender that many seconds to handle events."""
    enable_extension()
    options.folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)
    yield SETTLE

    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    with in_viewport():
        bpy.ops.lake_water.add_lake(detail=options.detail)
    scene = bpy.context.scene
    yield SETTLE

    _, area, _, space = view3d()
    space.show_region_ui = True
    redraw()  # the tabs of a sidebar are known once it was drawn
    next(region for region in area.regions if region.type == "UI").active_panel_category = TAB
    space.region_3d.view_perspective = "CAMERA"
    space.overlay.show_overlays = False
    space.shading.use_scene_lights = space.shading.use_scene_world = True  # in Material Preview
    with in_viewport():
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.view3d.view_center_camera()
    redraw()
    yield SETTLE

    for name, shading in SHADING.items():
        view3d()[3].shading.type = shading
        if shading == "RENDERED":
            scene.render.engine = "LAKE_WATER"
        yield from wait_for_shaders()
        for _ in range(options.frames):
            scene.frame_set(scene.frame_current + 1)
            redraw()
            yield 0.0
        path = options.folder / f"{name}.png"
        screenshot(path)
        print(f"screenshots: {path}")
        yield SETTLE


def drive(sequence: Iterator[float]) -> None:
    """Run the steps from a timer and end Blender after the last one."""

    def tick() -> float | None:
        try:
            return next(sequence)
        except StopIteration:
            status = 0
        except ScreenshotError as error:
            print(f"screenshots: {error}", file=sys.stderr)
            status = 1
        except Exception:
            traceback.print_exc()
            status = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)  # wm.quit_blender has no exit status, and asks about unsaved changes

    # Persistent: a new file is loaded on the way.
    bpy.app.timers.register(tick, first_interval=0.5, persistent=True)


if __name__ == "__main__":
    command_line = read_options()
    if bpy.app.background:
        print("screenshots: needs Blender's window: run without -b", file=sys.stderr)
        sys.exit(1)
    bpy.context.preferences.use_preferences_save = False  # what follows is for this session only
    bpy.context.preferences.view.show_splash = False
    drive(steps(command_line))
