# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of docs/water_line.md: high waves at the jetty and at a boulder, with and without the remedy.

    .venv/bin/python docs/pictures.py docs/images

Without: the shaders' two lines that keep each texture to its side of the waves are switched off, and what is
left is the thesis's clip plane. Each picture stands beside its twin, and below them a detail of both.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from mathutils import Vector
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import lake_water_addon  # noqa: E402 - after the path
from lake_water_addon.engine import last_render_report, release_final_host  # noqa: E402
from lake_water_addon.render import shader_library  # noqa: E402
from lake_water_addon.scenes import LakeScene, build_lake  # noqa: E402

SIZE = (960, 540)
DETAIL = (320, 180)
WAVES = 4.0  # times the lake's own
REMEDY = {
    "if (beyond > one_texel)": "if (false)",
    "if (mark_inside != 0 && !gl_FrontFacing)": "if (mark_inside == -1)",
}


@contextmanager
def without_remedy() -> Iterator[None]:
    """Shaders compiled meanwhile clip at the plane only."""
    read_source = shader_library.read_source

    def weakened(name: str, *arguments: object) -> str:
        text = read_source(name, *arguments)
        if name == "scene_frag.glsl":
            for line, instead in REMEDY.items():
                if line not in text:
                    raise SystemExit(
                        f"docs/pictures.py: {name} has no line {line!r} any more: name the new one"
                    )
                text = text.replace(line, instead)
        return text

    shader_library.read_source = weakened
    try:
        yield
    finally:
        shader_library.read_source = read_source


def look(camera: bpy.types.Object, position: Vector, target: Vector) -> None:
    camera.parent = None
    camera.animation_data_clear()
    camera.constraints.clear()
    camera.location = position
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (target - position).to_track_quat("-Z", "Y")


def render(scene: bpy.types.Scene) -> Image.Image:
    release_final_host()  # with its shaders
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        if last_render_report()["error"]:
            raise SystemExit(f"docs/pictures.py: {last_render_report()['error']}")
        return Image.open(scene.render.filepath).convert("RGB")


def pair(scene: bpy.types.Scene, detail: tuple[int, int]) -> Image.Image:
    """With the remedy on the left, without it on the right; below, DETAIL pixels from `detail` on, larger."""
    pictures = [render(scene)]
    with without_remedy():
        pictures.append(render(scene))
    sheet = Image.new("RGB", (2 * SIZE[0], 2 * SIZE[1]))
    for i, picture in enumerate(pictures):
        box = (*detail, detail[0] + DETAIL[0], detail[1] + DETAIL[1])
        sheet.paste(picture, (i * SIZE[0], 0))
        sheet.paste(picture.crop(box).resize(SIZE, Image.Resampling.LANCZOS), (i * SIZE[0], SIZE[1]))
    return sheet


def make_lake() -> LakeScene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    lake = build_lake(scene)
    scene.camera = lake.camera
    scene.render.engine = "LAKE_WATER"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    for wave in lake.water.lake_water.waves:
        wave.amplitude *= WAVES
    return lake


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where the pictures go")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    lake_water_addon.register()
    try:
        lake = make_lake()
        scene = bpy.context.scene
        boat = bpy.data.objects["Lake Boat"].matrix_world.translation
        scene.frame_set(25)
        look(lake.camera, boat + Vector((-5.0, 5.0, 2.2)), boat)
        pair(scene, (600, 340)).save(folder / "water_line_jetty.jpg", quality=88)
        boulder = bpy.data.objects["Lake Boulder 0"].matrix_world.translation
        scene.frame_set(55)
        look(lake.camera, 0.6 * boulder + Vector((0.0, 0.0, 1.8)), boulder)
        pair(scene, (560, 190)).save(folder / "water_line_boulder.jpg", quality=88)
    finally:
        lake_water_addon.unregister()


if __name__ == "__main__":
    main()
