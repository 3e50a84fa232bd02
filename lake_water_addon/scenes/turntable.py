# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras that go once around a point, or down into the water and up again, in a loop without a seam."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
from mathutils import Matrix, Vector

PIVOT_NAME = "Turntable Pivot"


def animate_turntable(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    *,
    center: Sequence[float],
    radius: float,
    height: float,
    frames: int,
    look_height: float = 0.0,
    start_angle: float = -math.pi / 2.0,
) -> bpy.types.Object:
    """Let `camera` orbit `center` once in `frames` frames, counter-clockwise from above; returns the pivot.

    center: (x, y, z) in m, world space; height: of the camera above center's z, negative for one under water;
    look_height: above center's z of the point that the camera looks at. start_angle: direction of the first
    position from the center, radians from +X. The scene's range becomes frame_start .. frame_start + frames
    - 1: the frame after the last would be the first again. The camera is taken over: its parent, its own
    animation and its constraints are given up. ValueError for a radius or a number of frames that is not
    positive.
    """
    if frames < 1:
        raise ValueError(f"A turntable needs at least one frame, not {frames}.")
    if not radius > 0.0:
        raise ValueError(f"The turntable's radius must be positive, not {radius:g} m.")
    center = Vector(center)
    pivot = camera.parent
    if pivot is None or not pivot.name.startswith(PIVOT_NAME):
        pivot = bpy.data.objects.new(PIVOT_NAME, None)
        for collection in camera.users_collection or (scene.collection,):
            collection.objects.link(pivot)
    pivot.parent = None
    pivot.empty_display_size = 0.5
    pivot.rotation_mode = "XYZ"
    pivot.matrix_world = Matrix.Translation(center)

    _take_over(camera)
    camera.parent = pivot
    camera.parent_type = "OBJECT"
    camera.matrix_parent_inverse = Matrix.Identity(4)
    camera.rotation_mode = "XYZ"
    place = Vector((radius * math.cos(start_angle), radius * math.sin(start_angle), height))
    look = Vector((0.0, 0.0, look_height)) - place
    camera.matrix_basis = Matrix.Translation(place) @ look.to_track_quat("-Z", "Y").to_matrix().to_4x4()

    first = scene.frame_start
    scene.frame_end = first + frames - 1
    pivot.animation_data_clear()
    action = bpy.data.actions.new("Turntable")
    pivot.animation_data_create().action = action
    curve = action.fcurve_ensure_for_datablock(pivot, "rotation_euler", index=2)
    # Keyed one frame past the end, where it meets the first frame a whole turn later.
    for frame, angle in ((first, 0.0), (first + frames, 2.0 * math.pi)):
        curve.keyframe_points.insert(frame, angle).interpolation = "LINEAR"
    curve.extrapolation = "LINEAR"
    curve.update()
    return pivot


def animate_dive(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    *,
    place: Sequence[float],
    target: Sequence[float],
    height: float,
    depth: float,
    frames: int,
) -> None:
    """Let `camera` sink through the water's surface and come up again, in `frames` frames.

    place: (x, y, z) in m, world space, on the water plane; the camera goes from `height` above it to `depth`
    below and back, as a sine, and turns with its height: `target` (x, y, z) stays in the middle of the
    picture. The scene's range becomes frame_start .. frame_start + frames - 1: the frame after the last would
    be the first again. The camera is taken over: its parent, its own animation and its constraints are given
    up. ValueError for a number of frames that is not positive, and for a target straight above or below.
    """
    if frames < 1:
        raise ValueError(f"A dive needs at least one frame, not {frames}.")
    place, target = Vector(place), Vector(target)
    if (target - place).xy.length < 1e-3:
        raise ValueError("A dive looks ahead: its target cannot be straight above or below it.")
    _take_over(camera)
    camera.rotation_mode = "XYZ"
    first = scene.frame_start
    scene.frame_end = first + frames - 1
    action = bpy.data.actions.new("Dive")
    camera.animation_data_create().action = action
    location = [action.fcurve_ensure_for_datablock(camera, "location", index=i) for i in range(3)]
    rotation = [action.fcurve_ensure_for_datablock(camera, "rotation_euler", index=i) for i in range(3)]
    for frame in range(first, first + frames + 1):
        turn = math.cos(2.0 * math.pi * (frame - first) / frames)
        at = place + Vector((0.0, 0.0, 0.5 * (height - depth) + 0.5 * (height + depth) * turn))
        angles = (target - at).to_track_quat("-Z", "Y").to_euler("XYZ")
        for curves, values in ((location, at), (rotation, angles)):
            for curve, value in zip(curves, values, strict=True):
                curve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
    for curve in (*location, *rotation):
        curve.update()


def _take_over(camera: bpy.types.Object) -> None:
    """Free a camera of its parent, its animation and its constraints."""
    camera.animation_data_clear()
    for constraint in list(camera.constraints):
        camera.constraints.remove(constraint)
    camera.parent = None
