# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scenes by Blender's own engines: EEVEE and Cycles, with the water's nodes, as fairly as can be.

Fair to all: each pixel is the mean over its square, nothing is clamped, glossy light is not filtered, every
pixel has all samples, and the sun has no mirror image in the water. Cycles is else as Blender has it: light
bounces 4 times between diffuse things. EEVEE traces rays at full resolution and quality, and half as far
again as the picture reaches, as Lake Water's textures do. Its shadow maps have a quarter of their usual
resolution: on software OpenGL they else take four fifths of its time, for the same picture. Cycles gets
back-face culling, which it has not, as plants here are cards with two faces at one place.

Fair in time: what counts is the next frame of an animation in which the waves have moved, with data kept
between frames, from the evaluation of the scene to the last sample (and the denoiser, where there is one).
Not in it: the first frame's compilation of shaders, loading of images, and search trees of what stands
still; nor the writing of the picture. This is what a frame of Lake Water is measured by, too.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
from _trade_scenes import DETAIL, FRAME, BuiltScene, open_scene
from tqdm import tqdm

REPEATS, REPEAT_WITHIN = 3, 5.0
"""A short render is repeated so often, while no more seconds than that were spent."""
NO_FILTER = 0.01  # pixels; EEVEE then takes samples evenly from the pixel's square
SETTINGS: dict[str, dict[str, object]] = {
    "BLENDER_EEVEE": {
        "use_raytracing": True,
        "ray_tracing_options.resolution_scale": "1",
        "ray_tracing_options.screen_trace_quality": 1.0,
        "ray_tracing_options.screen_trace_thickness": 0.5,
        "use_overscan": True,
        "overscan_size": 25.0,  # % on each side: the default field of view extension of 1.5
        "shadow_resolution_scale": 0.25,
        "clamp_surface_direct": 0.0,
        "clamp_surface_indirect": 0.0,
    },
    "CYCLES": {
        "device": "CPU",
        "pixel_filter_type": "BOX",
        "filter_width": 1.0,
        "use_adaptive_sampling": False,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
    },
}
"""By engine: what differs from Blender's defaults in all pictures, under the names of its own group."""


@dataclass(frozen=True)
class Engine:
    """One way to render. name: of the engine in Blender; settings: of its own group, besides SETTINGS."""

    label: str
    name: str
    samples: int
    settings: dict[str, object] = field(default_factory=dict)

    @property
    def described(self) -> dict[str, object]:
        """Engine, samples and settings in one, as a table has them."""
        return {"engine": self.name, "samples": self.samples, **self.settings}


class EnginePoint(NamedTuple):
    """seconds: of a frame, see above; picture: (h, w, 3) scene-linear, first row at the bottom.

    others: part of the processor's time that other processes had meanwhile, 0 to 1: above a few hundredths,
    the seconds are of a machine that was shared.
    """

    label: str
    settings: dict[str, object]
    seconds: float
    picture: np.ndarray
    others: float


def _eevee(samples: int) -> Engine:
    return Engine(f"EEVEE, {samples} sample{'s' * (samples > 1)}", "BLENDER_EEVEE", samples)


def _cycles(samples: int, *, denoise: bool = False) -> Engine:
    label = f"Cycles, {samples} samples{', denoised' * denoise}"
    return Engine(label, "CYCLES", samples, {"use_denoising": denoise})


CONVERGED = _cycles(512)
"""The picture that path tracing comes to, but for noise that is no longer seen."""
DIRECT = Engine(
    "Cycles, 256 samples, direct light", "CYCLES", 256, {"use_denoising": False, "diffuse_bounces": 1}
)
"""Without light between diffuse things, as in the references and in Lake Water: for a check of those."""
ENGINES = (
    *(_eevee(samples) for samples in (1, 4, 16)),
    *(_cycles(samples, denoise=denoise) for denoise in (False, True) for samples in (4, 16, 64)),
    CONVERGED,
    DIRECT,
)


def engine_points(
    scene_name: str,
    *,
    size: tuple[int, int],
    folder: Path,
    detail: float = DETAIL,
    engines: Sequence[Engine] = ENGINES,
    others_at_most: float = 1.0,
    quiet: bool = False,
) -> Iterator[EnginePoint]:
    """What each engine shows of a trade scene, and how long that takes; in the order of `engines`.

    size: (width, height) in pixels. folder: where pictures are kept, for a later run to go on from. What is
    there is not rendered again, unless its `others` are more than `others_at_most`: once the machine is
    quiet, its time can be measured again. To render, the scene is opened in place of what Blender has open.
    """
    kept = [_file(folder, scene_name, size, detail, engine) for engine in engines]
    built: BuiltScene | None = None
    warm = None
    bar = tqdm(zip(engines, kept, strict=True), total=len(engines), desc=scene_name, disable=quiet)
    for engine, path in bar:
        bar.set_postfix_str(engine.label)
        if not path.exists() or _others(path) > others_at_most:
            if built is None:
                built = open_scene(scene_name, size, detail)
                _set_up(built)
            if warm != engine.name:
                _render(Engine("", engine.name, 1))
                warm = engine.name
            _keep(path, *_measure(engine))
        with np.load(path) as data:
            yield EnginePoint(
                engine.label, engine.described, float(data["seconds"]), data["picture"], float(data["others"])
            )


def _file(folder: Path, scene_name: str, size: tuple[int, int], detail: float, engine: Engine) -> Path:
    told = json.dumps([bpy.app.version, detail, SETTINGS[engine.name], engine.described], sort_keys=True)
    number = hashlib.sha256(told.encode()).hexdigest()[:8]
    return folder / f"{scene_name}-{size[0]}x{size[1]}-{engine.name.lower()}-{engine.samples}-{number}.npz"


def _keep(path: Path, seconds: float, picture: np.ndarray, others: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part.npz")
    np.savez_compressed(part, seconds=seconds, picture=picture, others=others)
    part.replace(path)


def _others(path: Path) -> float:
    with np.load(path) as data:
        return float(data["others"])


def _set_up(built: BuiltScene) -> None:
    """All that makes the comparison fair, but engine and samples."""
    scene = bpy.context.scene
    render = scene.render
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    render.filter_size = NO_FILTER
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    for engine, group in _groups(scene).items():
        for path, value in SETTINGS[engine].items():
            *inner, name = path.split(".")
            setattr(functools.reduce(getattr, inner, group), name, value)
    _cull_in_cycles()
    # The lamp's mirror image, and the lamp seen through the surface: Lake Water's glow, which is off.
    built.sun.visible_glossy = built.sun.visible_transmission = False
    built.sun.data.specular_factor = built.sun.data.transmission_factor = 0.0


def _cull_in_cycles() -> None:
    """Let Cycles see through the backs of faces whose material says that they are not shown."""
    for material in bpy.data.materials:
        tree = material.node_tree
        if tree is None or not material.use_backface_culling:
            continue
        output = tree.get_output_node("ALL")
        shown = output.inputs["Surface"].links[0].from_socket
        output.target = "EEVEE"
        culled = tree.nodes.new("ShaderNodeOutputMaterial")
        culled.target = "CYCLES"
        mix = tree.nodes.new("ShaderNodeMixShader")
        tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
        tree.links.new(shown, mix.inputs[1])
        tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs["BSDF"], mix.inputs[2])
        tree.links.new(mix.outputs["Shader"], culled.inputs["Surface"])


def _groups(scene: bpy.types.Scene) -> dict[str, bpy.types.PropertyGroup]:
    """By engine: its settings."""
    return {"BLENDER_EEVEE": scene.eevee, "CYCLES": scene.cycles}


def _render(engine: Engine) -> None:
    scene = bpy.context.scene
    scene.render.engine = engine.name
    scene.eevee.taa_render_samples = scene.cycles.samples = engine.samples
    group = _groups(scene)[engine.name]
    for name, value in engine.settings.items():
        setattr(group, name, value)
    try:
        bpy.ops.render.render()  # evaluates the frame anew, and with it the waves
    finally:
        for name in engine.settings:
            group.property_unset(name)


def _measure(engine: Engine) -> tuple[float, np.ndarray, float]:
    """(seconds of a frame, picture, part of the processor that others had)."""
    bpy.context.scene.frame_set(FRAME)
    spent: list[float] = []
    busy, own, began = busy_seconds(), time.process_time(), time.perf_counter()
    while len(spent) < REPEATS and sum(spent) < REPEAT_WITHIN:
        start = time.perf_counter()
        _render(engine)
        spent.append(time.perf_counter() - start)
    wall = time.perf_counter() - began
    others = busy_seconds() - busy - (time.process_time() - own)
    return statistics.median(spent), _picture(), max(others, 0.0) / (wall * (os.cpu_count() or 1))


def busy_seconds() -> float:
    """Processor time of all processes together since the machine started; 0 where that is not told."""
    try:
        ticks = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    except OSError:
        return 0.0
    user, nice, system, _idle, _wait, irq, softirq, *_ = map(int, ticks)
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")


def _picture() -> np.ndarray:
    """The render result, (h, w, 3) float32, first row at the bottom."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "picture.exr")
        bpy.data.images["Render Result"].save_render(path, scene=scene)
        image = bpy.data.images.load(path)
        pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        picture = pixels.reshape(image.size[1], image.size[0], image.channels)[..., :3].copy()
        bpy.data.images.remove(image)
    return picture
