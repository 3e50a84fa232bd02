# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of docs/light.md, docs/techniques.md, docs/limits.md and docs/water_line.md, side by side.

    .venv/bin/python docs/pictures.py docs/images
    .venv/bin/python docs/pictures.py docs/images --only caustics

The water line's: high waves at the jetty and at a boulder, with and without the remedy. Without: the
shaders' two lines that keep each texture to its side of the waves are switched off, and what is left is the
thesis's clip plane. Below, a detail of both.
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
sys.path[:0] = [str(ROOT), str(ROOT / "scripts")]

import lake_water_addon  # noqa: E402 - after the path
from lake_water_addon.core.techniques import TECHNIQUES  # noqa: E402
from lake_water_addon.engine import last_render_report, release_final_host  # noqa: E402
from lake_water_addon.render import shader_library  # noqa: E402
from lake_water_addon.scenes import LakeScene, build_lake  # noqa: E402

SIZE = (960, 540)
DETAIL = (320, 180)
WAVES = 4.0  # times the lake's own
DIVE_HEIGHTS = (0.2, 0.08, 0.04, 0.0, -0.06, -0.4)  # m above the calm surface
REMEDY = {
    "if (beyond > one_texel)": "if (false)",
    "unknown = mark_inside != 0 && !gl_FrontFacing": "unknown = mark_inside == -1",
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
        report = last_render_report() if scene.render.engine == "LAKE_WATER" else None
        if report and report["error"]:
            raise SystemExit(f"docs/pictures.py: {report['error']}")
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


def beside(pictures: list[Image.Image]) -> Image.Image:
    """Pictures of one size in a row."""
    width, height = pictures[0].size
    sheet = Image.new("RGB", (len(pictures) * width, height))
    for i, picture in enumerate(pictures):
        sheet.paste(picture, (i * width, 0))
    return sheet


def stacked(pictures: list[Image.Image]) -> Image.Image:
    """Pictures of one size, one below the other."""
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, len(pictures) * height))
    for i, picture in enumerate(pictures):
        sheet.paste(picture, (0, i * height))
    return sheet


def variants(lake: LakeScene, place: tuple, target: tuple, *settings: dict) -> Image.Image:
    """One view with each of several settings of the scene, from left to right.

    place, target: of the camera, from the middle of the lake's surface, in m.
    """
    scene, center = bpy.context.scene, Vector(lake.center)
    look(lake.camera, center + Vector(place), center + Vector(target))
    pictures = []
    for setting in settings:
        for name, value in setting.items():
            setattr(scene.lake_water, name, value)
        pictures.append(render(scene))
        for name in setting:
            scene.lake_water.property_unset(name)
    return beside(pictures)


def caustics(lake: LakeScene) -> Image.Image:
    on, off = {"use_glow": False}, {"use_glow": False, "use_caustics": False}
    return variants(lake, (2.0, 6.0, 8.0), (4.5, 2.0, -2.0), on, off)


def shadows(lake: LakeScene) -> Image.Image:
    return variants(lake, (-4.5, -9.5, 4.0), (-9.0, -5.0, -0.3), {}, {"use_shadows": False})


def glow(lake: LakeScene) -> Image.Image:
    return variants(lake, (15.0, 8.0, 3.0), (0.0, 0.0, 0.5), {}, {"use_glow": False})


def under_water(lake: LakeScene) -> Image.Image:
    return variants(
        lake,
        (-3.0, 8.0, -1.5),
        (2.0, -2.0, -0.7),
        {},
        {"use_caustics": False, "use_shadows": False},
    )


def window(lake: LakeScene) -> Image.Image:
    """Up from 2 m under water through a wide lens: the thesis's approximation, and Snell's window."""
    lake.camera.data.lens = 11.0
    thesis = {"use_exact_under_water": False}
    return variants(lake, (-6.0, 2.0, -2.0), (-5.2, 2.4, 0.0), {}, thesis)


def high_waves(lake: LakeScene) -> None:
    for wave in lake.water.lake_water.waves:
        wave.amplitude *= WAVES


def water_line_jetty(lake: LakeScene) -> Image.Image:
    scene = bpy.context.scene
    high_waves(lake)
    boat = bpy.data.objects["Lake Boat"].matrix_world.translation
    scene.frame_set(25)
    look(lake.camera, boat + Vector((-5.0, 5.0, 2.2)), boat)
    return pair(scene, (600, 340))


def water_line_boulder(lake: LakeScene) -> Image.Image:
    scene = bpy.context.scene
    high_waves(lake)
    boulder = bpy.data.objects["Lake Boulder 0"].matrix_world.translation
    scene.frame_set(55)
    look(lake.camera, 0.6 * boulder + Vector((0.0, 0.0, 1.8)), boulder)
    return pair(scene, (560, 190))


def dive(lake: LakeScene) -> Image.Image:
    """Six heights of a camera that sinks in front of the sunken floor, in two rows."""
    scene, center = bpy.context.scene, Vector(lake.center)
    stage = Vector((*lake.stage, center.z))
    place = stage + 4.5 * (center - stage).normalized()
    small = SIZE[0] * 2 // 3, SIZE[1] * 2 // 3
    pictures = []
    for i, height in enumerate(DIVE_HEIGHTS):
        scene.frame_set(scene.frame_start + i)
        look(lake.camera, place + Vector((0.0, 0.0, height)), stage + Vector((0.0, 0.0, -0.4)))
        pictures.append(render(scene).resize(small, Image.Resampling.LANCZOS))
    return stacked([beside(pictures[:3]), beside(pictures[3:])])


def techniques(lake: LakeScene) -> Image.Image:
    """The five techniques in their order, two in a row; the last place shows the water switched off."""
    scene, center = bpy.context.scene, Vector(lake.center)
    look(lake.camera, center + Vector((-4.0, -16.0, 4.0)), center + Vector((0.5, 0.0, -1.0)))
    pictures = []
    for name in TECHNIQUES:
        scene.lake_water.technique = name
        pictures.append(render(scene))
    lake.water.hide_render = True
    pictures.append(render(scene))
    return stacked([beside(pictures[i : i + 2]) for i in (0, 2, 4)])


def engines(lake: LakeScene) -> Image.Image:
    """The same frame, half as large, for Cycles takes minutes: Traced, Cycles, EEVEE."""
    scene, center = bpy.context.scene, Vector(lake.center)
    scene.render.resolution_percentage = 50
    look(lake.camera, center + Vector((-4.0, -16.0, 4.0)), center + Vector((0.5, 0.0, -1.0)))
    scene.lake_water.technique = "TRACED"
    pictures = [render(scene)]
    scene.cycles.samples = 128
    scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_indirect = scene.cycles.blur_glossy = 0.0  # both would darken what shines
    scene.eevee.taa_render_samples = 4
    for engine in ("CYCLES", "BLENDER_EEVEE"):
        scene.render.engine = engine
        pictures.append(render(scene))
    return beside(pictures)


def limits(_: LakeScene) -> Image.Image:
    """Each technique at its best in a view of the trade's own; see limits.py."""
    from limits import sheet

    return sheet()


PICTURES = {
    "techniques": techniques,
    "engines": engines,
    "limits": limits,
    "caustics": caustics,
    "shadows": shadows,
    "glow": glow,
    "under_water": under_water,
    "window": window,
    "dive": dive,
    "water_line_jetty": water_line_jetty,
    "water_line_boulder": water_line_boulder,
}


def make_lake() -> LakeScene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    lake = build_lake(scene)
    scene.camera = lake.camera
    scene.render.engine = "LAKE_WATER"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    return lake


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where the pictures go")
    parser.add_argument("--only", choices=PICTURES, nargs="+", default=list(PICTURES), help="some of them")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    lake_water_addon.register()
    try:
        for name in options.only:
            PICTURES[name](make_lake()).save(options.folder / f"{name}.jpg", quality=88)
            print(options.folder / f"{name}.jpg")
    finally:
        lake_water_addon.unregister()


if __name__ == "__main__":
    main()
