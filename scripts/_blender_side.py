# SPDX-License-Identifier: GPL-3.0-or-later
"""The render script's dealings with Blender: the GPU, the extension, the scene, its settings, one frame."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import math
import os
import sys
import time
import tomllib
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import numpy as np
from _console import Console, Interrupts
from _frame_files import RenderProblem, UsageProblem, disk_full, is_whole_picture
from _gpu_start import max_picture_size
from _video import escape
from mathutils import Vector

PACKAGE = "lake_water_addon"  # in a checkout
EXTENSION = "lake_water"  # installed: bl_ext.<repository>.lake_water
ENGINE = "LAKE_WATER"
# Properties that options of the same name (without "use_") set. Their ranges and choices are stated where
# they are defined. The quality comes before what it sets.
SUN_SETTINGS = (
    *("use_caustics", "caustics_method", "caustics_size", "photon_size", "caustics_steps"),
    *("use_shadows", "light_depth_size"),
    *("use_glow", "glow_strength", "glow_exponent", "glow_threshold"),
)
SCENE_SETTINGS = (
    *("technique", "quality", "samples", "fov_ext", "texture_size", "intersection_steps"),
    *("least_grid_resolution", "refraction_steps", "reflection_steps"),
    *("use_exact_fresnel", "use_exact_under_water"),
    *SUN_SETTINGS,
)
WATER_SETTINGS = ("k", "q", "c", "ior", "water_color", "depth")
# Which switches have to be on (one of them is enough) for a setting to change the picture.
NEEDS = {
    **dict.fromkeys(("caustics_method", "caustics_size", "photon_size", "caustics_steps"), ("use_caustics",)),
    "light_depth_size": ("use_shadows", "use_caustics"),
    **dict.fromkeys(("glow_strength", "glow_exponent", "glow_threshold"), ("use_glow",)),
}
VIEWS = ("above", "under", "dive")
# Of the demonstration lake, in m: a turntable over its sunken floor, and a dive before that.
UNDER_RADIUS, UNDER_HEIGHT, UNDER_LOOK_HEIGHT = 2.0, -0.8, -0.5
DIVE_DISTANCE, DIVE_HEIGHT, DIVE_DEPTH, DIVE_TARGET_DEPTH = 4.5, 0.7, 1.2, 0.5
DEMO_RESOLUTION = (960, 540)
DEMO_FRAMES = 96


def enabled_extension() -> str | None:
    """The module name of an enabled Lake Water, None where this Blender has none.

    The bpy wheel starts with factory preferences: nothing is enabled there.
    """
    for addon in bpy.context.preferences.addons:
        if addon.module.rpartition(".")[2] in (EXTENSION, PACKAGE) and addon.module in sys.modules:
            return addon.module
    return None


@contextlib.contextmanager
def loaded_package() -> Iterator[ModuleType]:
    """The enabled extension, or the checkout's package, registered for the time of the block."""
    name = enabled_extension()
    if name is not None:
        yield sys.modules[name]
        return
    package = importlib.import_module(PACKAGE)
    package.register()
    try:
        yield package
    finally:
        package.unregister()  # frees what it holds on the GPU while there still is one


def part_of(package: ModuleType, name: str) -> ModuleType:
    """A module of the extension, under whatever name that is installed."""
    return importlib.import_module(f"{package.__name__}.{name}")


@dataclass
class Job:
    """What is to be rendered. water: the scene's water objects; notes: what a person should know.

    budget: what was chosen for --budget or --max-error, as `_budget.choose` has it.
    """

    package: ModuleType
    scene: bpy.types.Scene
    water: list[bpy.types.Object]
    frames: list[int]
    generated: bool
    notes: list[str]
    budget: dict[str, Any] | None = None

    @property
    def default_camera(self) -> str:
        """What --camera is when it is not given."""
        return "turntable" if self.generated else "scene"


def prepare(package: ModuleType, options: Namespace) -> Job:
    """Open or make the scene and put the options into it. Raises RenderProblem."""
    blend = Path(bpy.data.filepath) if bpy.data.filepath and options.scene is None else options.scene
    notes: list[str] = []
    if options.view is not None and options.camera == "scene":
        raise UsageProblem(
            f"--view {options.view} moves the camera, and --camera scene does not: give one of them"
        )
    if blend is None:
        lake = _demonstration_lake(package, options)
    else:
        if options.seed is not None or options.detail is not None:
            raise UsageProblem(
                f"--seed and --detail make the demonstration lake: leave them away with {blend}"
            )
        if options.view is not None:
            raise UsageProblem(f"--view is for the demonstration lake: leave it away with {blend}")
        if options.scene is not None:
            open_file(options.scene)
        lake = None
    scene = bpy.context.scene
    try:
        scene.render.engine = ENGINE
    except TypeError:
        raise RenderProblem(f"the render engine {ENGINE} is not registered: is Lake Water enabled?") from None
    water = part_of(package, "water_objects").waters_of(scene)
    frames = _frame_numbers(scene, options, lake is not None)
    _set_resolution(scene, options, lake is not None)
    if options.preset is not None:
        _apply_preset(package, scene, water, options)
    _apply_settings(package, scene, water, options, notes)
    _require_gpu_size(package, scene)
    has_sun = part_of(package, "handlers").has_sun(scene, scene.view_layers[0])
    notes += _without_effect(package, scene, options, has_sun)
    if options.water_level is not None:
        _set_water_level(scene, water, options.water_level)
    if options.obj is not None:
        _place_obj(package, scene, lake, water, options.obj)
    _set_picture(scene, options, notes)
    job = Job(package, scene, water, frames, lake is not None, notes)
    if (options.camera or job.default_camera) == "turntable":
        _set_turntable(job, lake, options.view or VIEWS[0])
    elif scene.camera is None:
        raise UsageProblem(
            f'the scene "{scene.name}" has no camera: select one there and press Ctrl+Numpad 0, '
            "or give --camera turntable"
        )
    if not water:
        notes.append(
            "the scene has no water: it is rendered without (in Blender, Make Water turns a mesh into it)"
        )
    return job


def open_file(path: Path) -> None:
    """Open a .blend file. Raises RenderProblem."""
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        reason = str(error).strip().removeprefix("Error: ")
        raise UsageProblem(f"{path} cannot be opened ({reason}): give a .blend file") from None


def _demonstration_lake(package: ModuleType, options: Namespace) -> Any:
    """The generated lake (a LakeScene) in an otherwise empty file."""
    values = {}
    limits = bpy.ops.lake_water.add_lake.get_rna_type().properties
    for name in ("seed", "detail"):
        value = getattr(options, name)
        if value is not None:
            _require_range(limits[name], value, f"--{name}")
            values[name] = value
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    try:
        lake = part_of(package, "scenes").build_lake(scene, **values)
    except ValueError as error:
        raise UsageProblem(f"--seed, --detail: {error}") from None
    scene.camera = lake.camera
    return lake


def _frame_numbers(scene: bpy.types.Scene, options: Namespace, generated: bool) -> list[int]:
    """The frames to render; the scene's range is set to them."""
    if options.frame_start is not None:
        scene.frame_start = options.frame_start
        if scene.frame_start != options.frame_start:
            raise UsageProblem(f"--frame-start {options.frame_start} is beyond what Blender allows")
    if options.frames is not None:
        scene.frame_end = scene.frame_start + (options.frames - 1) * scene.frame_step
    elif options.target.kind == "STILL":
        scene.frame_end = scene.frame_start
    elif generated:
        scene.frame_end = scene.frame_start + DEMO_FRAMES - 1
    if scene.frame_end < scene.frame_start:
        raise UsageProblem(
            f"the scene's frame range, {scene.frame_start} to {scene.frame_end}, is empty: give --frames"
        )
    return list(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))


def _option(name: str) -> str:
    """The option of a property."""
    return "--" + name.removeprefix("use_").replace("_", "-")


def _require_range(prop: bpy.types.Property, value: Any, option: str) -> None:
    """Refuse a value that Blender would clamp or does not know. Raises UsageProblem."""
    if prop.type == "BOOLEAN":
        return
    if prop.type == "ENUM":
        known = [item.identifier for item in prop.enum_items]
        if value not in known:
            raise UsageProblem(f"{option} {value}: choose one of {', '.join(known)}")
        return
    for number in value if isinstance(value, tuple) else (value,):
        if (
            not prop.hard_min <= np.float32(number) <= prop.hard_max
        ):  # Blender holds limits and values as float32
            raise UsageProblem(
                f"{option} {number:g}: out of range, give {prop.hard_min:g} to {prop.hard_max:g}"
            )


def _apply_preset(
    package: ModuleType, scene: bpy.types.Scene, water: Sequence[bpy.types.Object], options: Namespace
) -> None:
    """The preset that is asked for, on every water object; its name into the options as it is spelled."""
    presets = part_of(package, "presets")
    if not water:
        raise UsageProblem("--preset: the scene has no water to set it on")
    try:
        path = presets.find(options.preset)
        options.preset = path.stem.replace("_", " ")
        presets.apply(path, bpy.context, water)
    except presets.PresetError as error:
        raise UsageProblem(f"--preset: {error}") from None


def _image(package: ModuleType, path: Path, option: str, kind: str, notes: list[str]) -> bpy.types.Image:
    """The image of a file, for a map of a kind as in `TechniqueSettings.maps`; what is odd goes to notes."""
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        reason = str(error).strip().removeprefix("Error: ")
        raise UsageProblem(f"{option}: {path} cannot be opened ({reason}): give an image") from None
    problem = part_of(package, "extraction.materials").image_problem(image)
    if problem is not None:
        raise UsageProblem(f"{option}: image {problem}: give another")
    map_images = part_of(package, "map_images")
    if kind in map_images.LABELS:
        image.colorspace_settings.name = "Non-Color"
        notes += [f"{option}: {m}" for m in map_images.image_messages(image, kind) if m not in notes]
    return image


def _apply_settings(
    package: ModuleType,
    scene: bpy.types.Scene,
    water: Sequence[bpy.types.Object],
    options: Namespace,
    notes: list[str],
) -> None:
    """Options of the same name as parameters, into the scene's and every water object's settings."""
    place_of = part_of(package, "properties").place_of
    own = part_of(package, "core.parameters").OWN
    of_water = (*WATER_SETTINGS, *own)
    if not water:
        given = [name for name in (*of_water, "water_level") if getattr(options, name) is not None]
        if given:
            raise UsageProblem(f"{_option(given[0])}: the scene has no water to set it on")
    places = [(name, scene.lake_water, name) for name in SCENE_SETTINGS]
    places += [(name, *place_of(name, scene, obj)) for obj in water for name in of_water]
    for parameter, group, name in places:
        value = getattr(options, parameter)
        if value is None:
            continue
        option = _option(parameter)
        prop = group.bl_rna.properties[name]
        if prop.type == "POINTER":
            value = _image(package, value, option, own[parameter].kind, notes)
        else:
            _require_range(prop, value, option)
        try:
            setattr(group, name, value)
        except AttributeError:
            raise UsageProblem(
                f"{option}: {group.id_data.name} is linked from another file and cannot be changed: "
                "make it local or a library override there"
            ) from None


def _require_gpu_size(package: ModuleType, scene: bpy.types.Scene) -> None:
    """Refuse textures that the GPU cannot hold. Raises UsageProblem."""
    limit = max_picture_size()
    windows = part_of(package, "core.plan").CASCADES  # one above the other in one texture
    for name, times in {
        **dict.fromkeys(("texture_size", "caustics_size", "photon_size"), 1),
        "light_depth_size": windows,
    }.items():
        size = getattr(scene.lake_water, name)
        if size * times > limit:
            raise UsageProblem(f"{_option(name)} {size}: this GPU takes at most {limit // times}")


def _without_effect(
    package: ModuleType, scene: bpy.types.Scene, options: Namespace, has_sun: bool
) -> list[str]:
    """Notes about options that change nothing in the picture, by what the scene is set to."""
    settings = scene.lake_water
    parameters = part_of(package, "core.parameters")
    label = part_of(package, "core.techniques").TECHNIQUES[settings.technique].label
    notes = [
        f"{_option(name)} has no effect with the technique {label}"
        for name in (*parameters.WATER, *parameters.OWN, *parameters.SCENE)
        if getattr(options, name) is not None and not parameters.has_effect(name, settings.technique)
    ]
    given = [name for name in SUN_SETTINGS if getattr(options, name) not in (None, False)]
    if given and not has_sun:
        return [*notes, f"{_option(given[0])} has no effect: the scene has no sun light"]
    for name in given:
        needed = NEEDS.get(name, ())
        if needed and not any(getattr(settings, switch) for switch in needed):
            switches = " or ".join(_option(switch) for switch in needed)
            notes.append(f"{_option(name)} has no effect without {switches}")
    return notes


def _set_water_level(scene: bpy.types.Scene, water: Sequence[bpy.types.Object], level: float) -> None:
    """Move the one water surface to world z = level, metres."""
    if len(water) != 1:
        names = ", ".join(obj.name for obj in water)
        raise UsageProblem(f"--water-level is for one water surface, and the scene has {len(water)}: {names}")
    obj = water[0]
    layer = scene.view_layers[0]
    layer.update()
    matrix = obj.matrix_world.copy()
    matrix.translation.z = level
    obj.matrix_world = matrix
    layer.update()
    reached = obj.evaluated_get(layer.depsgraph).matrix_world.translation.z
    if not math.isclose(reached, level, rel_tol=1e-5, abs_tol=1e-4):
        raise UsageProblem(
            f"--water-level: {obj.name} stays at {reached:g} m, held by an animation, a constraint "
            "or a driver: remove it in the scene"
        )


def _place_obj(
    package: ModuleType, scene: bpy.types.Scene, lake: Any, water: Sequence[bpy.types.Object], path: Path
) -> None:
    """Stand an object in the water, half of it below, on the lake's stage or in the water's middle."""
    if not water:
        raise UsageProblem("--obj: the scene has no water to stand it in")
    level = water[0].matrix_world.translation.z
    scene.view_layers[0].update()
    if lake is not None:
        where = {"location": lake.stage, "collection": lake.collection}
    else:
        low, high = _bounds(water[:1])
        where = {"location": (0.5 * (low + high))[:2], "height": min(2.5, 0.3 * min((high - low)[:2]))}
    try:
        part_of(package, "scenes").place_obj(scene, path, water_level=level, **where)
    except ValueError as error:
        raise UsageProblem(f"--obj: {error}") from None


def _set_resolution(scene: bpy.types.Scene, options: Namespace, generated: bool) -> None:
    """The size of the frames, which a quality goes by. Raises UsageProblem."""
    render = scene.render
    if options.resolution is not None or generated:
        for name, pixels in zip(
            ("resolution_x", "resolution_y"), options.resolution or DEMO_RESOLUTION, strict=True
        ):
            _require_range(render.bl_rna.properties[name], pixels, "--resolution")
            setattr(render, name, pixels)
        render.resolution_percentage = 100


def _set_picture(scene: bpy.types.Scene, options: Namespace, notes: list[str]) -> None:
    """File format, and what of the size or the scene would get in the way."""
    render = scene.render
    width = render.resolution_x * render.resolution_percentage // 100  # as Blender rounds
    height = render.resolution_y * render.resolution_percentage // 100
    limit = max_picture_size()
    if max(width, height) > limit:
        raise UsageProblem(
            f"{width}x{height} pixels: this GPU draws at most {limit} a side, give a smaller --resolution"
        )
    if render.use_border and render.use_crop_to_border:
        width = int(render.border_max_x * width) - int(render.border_min_x * width)
        height = int(render.border_max_y * height) - int(render.border_min_y * height)
    if options.target.kind == "VIDEO" and (width % 2 or height % 2):
        raise UsageProblem(
            f"H.264 needs an even width and height, not {width}x{height}: give --resolution "
            f"{width + width % 2}x{height + height % 2}"
        )
    if render.use_multiview:
        render.use_multiview = False
        notes.append("the scene is set to stereoscopy, which Lake Water does not draw: one view is rendered")
    if render.use_sequencer and scene.sequence_editor is not None and len(scene.sequence_editor.strips):
        render.use_sequencer = False
        notes.append("the scene's video sequence is left out: the scene itself is rendered")
    render.use_persistent_data = True  # the engine keeps what has not changed from frame to frame
    render.use_file_extension = False  # the temporary names, as they are
    image = render.image_settings
    image.media_type = "IMAGE"
    image.file_format = options.target.picture_format
    image.color_management = "FOLLOW_SCENE"
    see_through = render.film_transparent and not options.target.frames_are_temporary
    image.color_mode = "RGBA" if see_through else "RGB"
    if image.file_format == "PNG":
        image.color_depth = "8"
    else:
        image.color_depth, image.exr_codec = "16", "ZIP"
    # The times of the passes are measured only on request: waiting for the GPU between them costs time.
    scene.lake_water.show_statistics = options.stats is not None


def _bounds(objects: Sequence[bpy.types.Object]) -> tuple[Vector, Vector]:
    """Lowest and highest corner of the objects' bounding boxes, world space, metres."""
    corners = [obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box]
    low, high = (Vector(choose(corner[i] for corner in corners) for i in range(3)) for choose in (min, max))
    return low, high


def _set_turntable(job: Job, lake: Any, view: str) -> None:
    """A camera that goes once round the lake, or round the scene's water, in the frames of the job.

    view: of the lake, one of VIEWS.
    """
    scene = job.scene
    frames = len(job.frames) * scene.frame_step  # the turn takes as long as the whole range
    scenes = part_of(job.package, "scenes")
    animate = scenes.animate_turntable
    if lake is not None and view != VIEWS[0]:
        scene.view_layers[0].update()
        level = job.water[0].matrix_world.translation.z  # as --water-level may have set it
        if view == "dive":
            stage, center = Vector(lake.stage), Vector(lake.center[:2])
            scenes.animate_dive(
                scene,
                lake.camera,
                place=(*stage + DIVE_DISTANCE * (center - stage).normalized(), level),
                target=(*lake.stage, level - DIVE_TARGET_DEPTH),
                height=DIVE_HEIGHT,
                depth=DIVE_DEPTH,
                frames=frames,
            )
            return
        animate(
            scene,
            lake.camera,
            center=(*lake.stage, level),
            radius=UNDER_RADIUS,
            height=UNDER_HEIGHT,
            look_height=UNDER_LOOK_HEIGHT,
            frames=frames,
        )
        return
    if lake is not None:
        animate(
            scene,
            lake.camera,
            center=lake.center,
            radius=lake.orbit_radius,
            height=lake.orbit_height,
            look_height=lake.look_height,
            frames=frames,
        )
        return
    scene.view_layers[0].update()
    shown = job.water or [o for o in scene.objects if o.type == "MESH" and not o.hide_render]
    if not shown:
        raise UsageProblem("--camera turntable: the scene has neither water nor a mesh to go round")
    low, high = _bounds(shown)
    radius = max(0.5 * (high - low).length, 0.1)
    data = bpy.data.cameras.new("turntable")
    data.clip_start, data.clip_end = 0.01 * radius, 100.0 * radius
    camera = bpy.data.objects.new("turntable", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    animate(scene, camera, center=0.5 * (low + high), radius=1.6 * radius, height=0.6 * radius, frames=frames)


def resolved_settings(job: Job, options: Namespace) -> dict[str, Any]:
    """All that decides what the frames look like, as far as this script knows: for --resume and --stats."""
    scene, render = job.scene, job.scene.render
    blend = bpy.data.filepath
    settings: dict[str, Any] = {
        "scene": f"{blend} of {_stamp(Path(blend))}" if blend else "demonstration lake",
        "frame start": job.frames[0],
        "frame step": scene.frame_step,
        "resolution": [render.resolution_x, render.resolution_y, render.resolution_percentage],
        "format": render.image_settings.file_format,
        "color mode": render.image_settings.color_mode,
        "camera": options.camera or job.default_camera,
        "extension": version_of(job.package),
        "Blender": bpy.app.version_string,
    }
    if job.generated:
        limits = bpy.ops.lake_water.add_lake.get_rna_type().properties
        for name in ("seed", "detail"):
            given = getattr(options, name)
            settings[name] = limits[name].default if given is None else given
        if settings["camera"] == "turntable":
            settings["view"] = options.view or VIEWS[0]
    if settings["camera"] == "turntable":
        settings["frames"] = len(job.frames)  # the camera's speed follows from it
    settings["preset"] = options.preset
    if job.budget is not None:
        settings["budget"] = job.budget
    for name in SCENE_SETTINGS:
        settings[name] = _plain(getattr(scene.lake_water, name))
    place_of = part_of(job.package, "properties").place_of
    own = part_of(job.package, "core.parameters").OWN
    read = [name for name in own if own[name].technique == scene.lake_water.technique]
    for obj in job.water:
        for name in (*WATER_SETTINGS, *read):
            settings[f"{obj.name} {name}"] = _plain(getattr(*place_of(name, scene, obj)))
        waves = part_of(job.package, "water_objects").settings_of(obj).waves
        settings[f"{obj.name} waves"] = [_plain(dataclasses.astuple(wave)) for wave in waves]
        settings[f"{obj.name} level"] = _plain(obj.matrix_world.translation.z)
    if options.obj is not None:
        settings["obj"] = f"{options.obj} of {_stamp(options.obj)}"
    return settings


def _stamp(path: Path) -> str:
    """Time and size of a file: another file under the same name has others."""
    status = path.stat()
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(status.st_mtime))
    return f"{when}.{status.st_mtime_ns % 10**9:09d}, {status.st_size} bytes"


def _plain(value: Any) -> Any:
    """A property's value for JSON; float32 without the digits that it does not have; an image's file."""
    if value is None or isinstance(value, bpy.types.Image):
        return value and f"{value.name}, {value.filepath or 'made by Blender'}"
    if isinstance(value, float):
        return float(f"{value:.6g}")
    return value if isinstance(value, (int, str, bool)) else [_plain(item) for item in value]


def version_of(package: ModuleType) -> str:
    """The version in the extension's manifest: beside the package where installed, above it in a checkout."""
    folder = Path(str(package.__file__)).parent
    for manifest in (folder / "blender_manifest.toml", folder.parent / "blender_manifest.toml"):
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8")).get("version", "unknown"))
    return "unknown"


def render_frame(
    job: Job, frame: int, target: Path, console: Console, interrupts: Interrupts
) -> dict[str, Any]:
    """Render a frame to `target`, whole or not at all. Returns the engine's report. Raises RenderProblem."""
    part = target.with_name(f".{target.stem}.part{target.suffix}")
    scene = job.scene
    with interrupts.after(part):
        try:
            problem = ""
            with console.quiet():
                scene.frame_set(frame)
                scene.render.filepath = escape(part)
                try:
                    bpy.ops.render.render(write_still=True, scene=scene.name)
                except RuntimeError as error:
                    problem = str(error).strip().removeprefix("Error: ")
            report = part_of(job.package, "engine").last_render_report()
            if report is None:
                raise RenderProblem(f"frame {frame}: {problem or 'Lake Water was not asked to draw it'}")
            if report["error"] or problem:
                raise RenderProblem(f"frame {frame}: {report['error'] or problem}")
            if not is_whole_picture(part):
                raise RenderProblem(f"frame {frame}: {disk_full(target)}")
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    return report
