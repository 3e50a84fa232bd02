# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of a picture that a border render draws, in pixels: (left, bottom, right, top)."""

from __future__ import annotations

import bpy
import numpy as np

from .extract import camera_from_object

Border = tuple[int, int, int, int]


def picture_window(render: bpy.types.RenderSettings, width: int, height: int) -> Border:
    """Of a final render of so many pixels.

    Multiplies and truncates in float32 as Blender does, so that the size agrees with the one it expects.
    """
    if not render.use_border:
        return 0, 0, width, height
    borders = np.array(
        [render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y], np.float32
    )
    left, bottom, right, top = (borders * np.array([width, height] * 2, np.float32)).astype(int).tolist()
    return left, bottom, max(right, left + 1), max(top, bottom + 1)


def view_window(
    space: bpy.types.SpaceView3D,
    region: bpy.types.Region,
    region_data: bpy.types.RegionView3D,
    depsgraph: bpy.types.Depsgraph,
) -> Border:
    """Of a 3D view in Material Preview or Rendered: its own border, or through a camera the scene's.

    The whole region where there is no border. One that lies outside is a single pixel.
    """
    size = np.array([region.width, region.height], np.float64)
    if region_data.view_perspective == "CAMERA":
        render = depsgraph.scene.render
        used = render.use_border
        border = render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y
        frame = _camera_frame(space, region_data, depsgraph) if used else None
    else:
        used = space.use_render_border
        border = (
            space.render_border_min_x,
            space.render_border_min_y,
            space.render_border_max_x,
            space.render_border_max_y,
        )
        frame = np.array([[-1.0, -1.0], [1.0, 1.0]])
    if not used or frame is None:
        return 0, 0, region.width, region.height
    corners = frame[0] + np.array(border).reshape(2, 2) * (frame[1] - frame[0])
    low, high = np.rint((0.5 * corners + 0.5) * size)
    low = np.clip(low, 0, size - 1)
    high = np.clip(high, low + 1, size)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _camera_frame(
    space: bpy.types.SpaceView3D, region_data: bpy.types.RegionView3D, depsgraph: bpy.types.Depsgraph
) -> np.ndarray | None:
    """Low and high corner (2, 2) of the camera's picture in a view through it, in device coordinates.

    None when there is no camera that draws a flat picture.
    """
    scene = depsgraph.scene
    camera = space.camera if space.use_local_camera else scene.camera
    render = scene.render
    width, height = (
        max(side * render.resolution_percentage // 100, 1)
        for side in (render.resolution_x, render.resolution_y)
    )
    try:
        picture = camera_from_object(camera and camera.evaluated_get(depsgraph), scene, width, height)
    except ValueError:
        return None
    ours, views = picture.projection, np.array(region_data.window_matrix, dtype=np.float64)
    # At one unit of depth, device coordinates are scale * x + shift in both.
    scale, view_scale = ours[[0, 1], [0, 1]], views[[0, 1], [0, 1]]
    shift = ours[:2, 3] - ours[:2, 2]
    view_shift = views[:2, 3] - views[:2, 2]
    return (np.array([[-1.0, -1.0], [1.0, 1.0]]) - shift) / scale * view_scale + view_shift
