# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG frames to an H.264 video with Blender's own encoder: a scene with one strip of pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import bpy
from _console import Interrupts
from _frame_files import RenderProblem, disk_full, is_whole_mp4, png_size


def escape(path: Path) -> str:
    """A path as Blender's file settings want it, where {…} stands for a variable."""
    return str(path).replace("{", "{{").replace("}", "}}")


def encode(target: Path, frames: Sequence[Path], like: bpy.types.Scene, interrupts: Interrupts) -> None:
    """Write the frames, all in one folder, to `target` (.mp4) with the frame rate of the scene `like`.

    The frames are display-referred: they go in and out as sRGB with the view transform Standard, so
    that their values reach the encoder unchanged. Written whole or not at all. Raises RenderProblem.
    """
    part = target.with_name(".lake_water.part.mp4")
    scene = bpy.data.scenes.new("lake_water_encode")
    # Something in Python for every frame: only there can Python notice a signal.
    bpy.app.handlers.render_pre.append(_breathe)
    try:
        _fill(scene, frames, like)
        scene.render.filepath = escape(part)
        try:
            with interrupts.after(part, at_once=True):
                bpy.ops.render.render(animation=True, scene=scene.name)
        except RuntimeError as error:
            if _is_full(target.parent):
                raise RenderProblem(disk_full(target)) from None
            raise RenderProblem(f"Blender cannot encode {target}: {str(error).strip()}") from None
        if not is_whole_mp4(part):
            raise RenderProblem(disk_full(target) if _is_full(target.parent) else f"{target} came out broken")
        found = count_frames(part)
        if found != len(frames):
            raise RenderProblem(f"{target} came out with {found} of {len(frames)} frames")
        os.replace(part, target)
    finally:
        bpy.app.handlers.render_pre.remove(_breathe)
        part.unlink(missing_ok=True)
        bpy.data.scenes.remove(scene)


def _breathe(*_args: object) -> None:
    """Does nothing."""


def _fill(scene: bpy.types.Scene, frames: Sequence[Path], like: bpy.types.Scene) -> None:
    display, view = scene.display_settings, scene.view_settings
    display.display_device = "sRGB"
    view.view_transform, view.look = "Standard", "None"
    view.exposure, view.gamma, view.use_curve_mapping = 0.0, 1.0, False
    scene.sequencer_colorspace_settings.name = "sRGB"

    strip = scene.sequence_editor_create().strips.new_image("frames", str(frames[0]), 1, 1)
    strip.colorspace_settings.name = "sRGB"
    for frame in frames[1:]:
        strip.elements.append(frame.name)

    scene.frame_start, scene.frame_end, scene.frame_step = 1, len(frames), 1
    render = scene.render
    render.resolution_x, render.resolution_y = png_size(frames[0])
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = like.render.pixel_aspect_x, like.render.pixel_aspect_y
    render.fps, render.fps_base = like.render.fps, like.render.fps_base
    render.use_sequencer, render.use_compositing = True, False
    render.use_file_extension = False  # the path as given
    image = render.image_settings
    image.media_type, image.file_format, image.color_mode = "VIDEO", "FFMPEG", "RGB"
    ffmpeg = render.ffmpeg
    ffmpeg.format, ffmpeg.codec, ffmpeg.audio_codec = "MPEG4", "H264", "NONE"
    ffmpeg.constant_rate_factor, ffmpeg.ffmpeg_preset, ffmpeg.gopsize = "HIGH", "GOOD", 24


def _is_full(folder: Path) -> bool:
    """Whether nothing more can be written in the folder (some file systems refuse before all is used)."""
    probe = folder / ".lake_water_space.part"
    try:
        probe.write_bytes(os.urandom(1 << 16))
    except OSError:
        return True
    finally:
        probe.unlink(missing_ok=True)
    return False


def count_frames(path: Path) -> int:
    """Frames in a video, as Blender reads it; 0 if it cannot."""
    scene = bpy.data.scenes.new("lake_water_count")
    try:
        strip = scene.sequence_editor_create().strips.new_movie("video", str(path), 1, 1)
        return int(strip.duration)
    except RuntimeError:
        return 0
    finally:
        bpy.data.scenes.remove(scene)
