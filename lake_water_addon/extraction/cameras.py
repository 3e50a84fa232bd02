# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras and 3D views as a rigid view matrix and an OpenGL projection, in float64."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..core.snapshot import Camera


def camera_from_object(obj: bpy.types.Object, scene: bpy.types.Scene, width: int, height: int) -> Camera:
    """The camera that renders a picture of width by height pixels through a camera object.

    obj: evaluated camera object, perspective or orthographic; lens shift, sensor fit and
    clip range are its own, the pixel aspect is the scene's. The object's scale is ignored.
    Computed in float64 from the settings, not from Blender's float32 matrix.
    Raises ValueError for no camera object, a panoramic or custom camera, or a size below 1.
    """
    if obj is None or obj.type != "CAMERA":
        name = f'"{obj.name}"' if obj is not None else "The scene's camera"
        raise ValueError(f"{name} is not a camera: choose one in the scene properties")
    if width < 1 or height < 1:
        raise ValueError(f"The picture is {width} x {height} pixels: both must be at least 1")
    data = obj.data
    if data.type not in {"PERSP", "ORTHO"}:
        raise ValueError(
            f'The camera "{obj.name}" is {data.type.lower()}: Lake Water draws perspective and '
            "orthographic cameras only; change the lens type in the camera's properties"
        )
    projection = _projection(data, width, height, scene.render.pixel_aspect_x, scene.render.pixel_aspect_y)
    return Camera(view=_rigid_inverse(np.array(obj.matrix_world, dtype=np.float64)), projection=projection)


def camera_from_view(region_data: bpy.types.RegionView3D) -> Camera:
    """The camera of a 3D view, looking through a camera object or not.

    Its projection is the view's window matrix, camera space to clip space, with Blender's float32 digits.
    """
    view = np.array(region_data.view_matrix, dtype=np.float64)
    return Camera(
        view=_rigid_inverse(np.linalg.inv(view)),
        projection=np.array(region_data.window_matrix, dtype=np.float64),
    )


def _projection(
    data: bpy.types.Camera, width: int, height: int, aspect_x: float, aspect_y: float
) -> np.ndarray:
    """(4, 4) OpenGL clip matrix of a perspective or orthographic camera.

    The sensor's fitted side spans `lens`' angle (or `ortho_scale`); the other follows from
    the picture's shape. Shifts are in units of the fitted side.
    """
    fit = data.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if width * aspect_x >= height * aspect_y else "VERTICAL"
        sensor = data.sensor_width
    else:
        sensor = data.sensor_width if fit == "HORIZONTAL" else data.sensor_height
    # Sides in units of the fitted one; a pixel is aspect_y / aspect_x times as high as wide.
    pixel_height = aspect_y / aspect_x
    fitted = width if fit == "HORIZONTAL" else height * pixel_height
    half = 0.5 * np.array([width, height * pixel_height]) / fitted
    shift = np.array([data.shift_x, data.shift_y])
    near, far = float(data.clip_start), float(data.clip_end)
    p = np.zeros((4, 4))
    if data.type == "ORTHO":
        half, shift = half * data.ortho_scale, shift * data.ortho_scale
        p[0, 0], p[1, 1] = 1.0 / half
        p[0, 3], p[1, 3] = -shift / half
        p[2, 2] = -2.0 / (far - near)
        p[2, 3] = -(far + near) / (far - near)
        p[3, 3] = 1.0
    else:
        tangent = sensor / data.lens  # of the fitted side
        p[0, 0], p[1, 1] = 1.0 / (half * tangent)
        p[0, 2], p[1, 2] = shift / half
        p[2, 2] = -(far + near) / (far - near)
        p[2, 3] = -2.0 * far * near / (far - near)
        p[3, 2] = -1.0
    return p


def _rigid_inverse(matrix: np.ndarray) -> np.ndarray:
    """(4, 4) inverse of an object-to-world matrix with its scale and shear removed.

    The viewing axis (Z) is kept, then the up axis (Y) as far as it is perpendicular; a mirrored
    matrix (negative scale) yields the rotation that looks the same way.
    """
    z = _unit(matrix[:3, 2], (0.0, 0.0, 1.0))
    y = matrix[:3, 1] - (matrix[:3, 1] @ z) * z
    y = _unit(y, np.cross(z, _unit(matrix[:3, 0], (1.0, 0.0, 0.0))))
    rotation = np.stack([np.cross(y, z), y, z])  # rows: the camera's axes
    view = np.eye(4)
    view[:3, :3] = rotation
    view[:3, 3] = -rotation @ matrix[:3, 3]
    return view


def _unit(vector: np.ndarray, otherwise: Sequence[float] | np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-12 else np.asarray(otherwise, dtype=np.float64)
