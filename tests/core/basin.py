# SPDX-License-Identifier: GPL-3.0-or-later
"""Flat water over a flat bottom with exact textures: geometry tells what a technique makes of them."""

from dataclasses import replace

import numpy as np

from lake_water_addon.core import cameras
from lake_water_addon.core.air_lookup import WaterTextures
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from tests.gpu import scenes

DEPTH = 3.0
FADE = 1e-9  # no border: the textures are functions

CAMERAS = {
    "perspective": scenes.look_at((1, -9, 5), (0, 0, -1)),
    "low": scenes.look_at((1, -9, 0.6), (0, 0, 0)),
    "straight down": scenes.look_at((0, 0, 7), (0, 0, 0)),
    "orthographic": scenes.look_at((1, -9, 5), (0, 0, -1), ortho=12.0),
}
_shifted = CAMERAS["perspective"]
CAMERAS["shifted lens"] = replace(
    _shifted, projection=np.array([[1, 0, 0.3, 0], [0, 1, -0.4, 0], [0] * 4, [0] * 4]) + _shifted.projection
)


class Basin:
    """Water at z = 0 and DEPTH m of it over a level bottom, seen by a camera; `body` is planned for it.

    The refraction camera is the main camera. heading: of the water frame.
    """

    def __init__(
        self,
        camera="perspective",
        *,
        heading=0.0,
        location=(0.0, 0.0, 0.0),
        depth=DEPTH,
        fov_ext=1.0,
        **settings,
    ):
        view_of = CAMERAS[camera]
        water = scenes.water(**{"waves": (), **settings})
        c, s = np.cos(heading), np.sin(heading)
        matrix = water.matrix.copy()
        matrix[:2, :2] = [[c, -s], [s, c]]
        scene = scenes.snapshot((), (), (), (replace(water, matrix=matrix),))
        scene, view_of = scenes.moved(scene, view_of, location)
        plan = plan_frame(scene, view_of, FrameSettings(texture_size=64, fov_ext=fov_ext))
        (body,) = plan.bodies
        self.view, self.projection = plan.camera.view, body.refraction.projection
        self.fov_ext = fov_ext
        self.body = replace(body, refraction=replace(body.refraction, view=self.view))
        self.depth = depth
        self.orthographic = cameras.is_orthographic(self.projection)

    def surface(self, count=200, seed=1):
        """(points, to_eye): the surface seen at random places of the picture's lower half, well inside."""
        uv = np.random.default_rng(seed).uniform((0.2, 0.15), (0.8, 0.45), (count, 2))
        near, far = self._sight(0.5 + (uv - 0.5) / self.fov_ext)
        points = near + (near[:, 2] / (near[:, 2] - far[:, 2]))[:, None] * (far - near)
        return points, self.to_eye(points)

    def _sight(self, uv):
        """Where the lines of sight at coordinates of the textures begin and end."""
        inverse = np.linalg.inv(self.projection @ self.view)
        ends = []
        for depth in (-1.0, 1.0):
            clip = np.column_stack([2.0 * uv - 1.0, np.full(len(uv), depth), np.ones(len(uv))]) @ inverse.T
            ends.append(clip[:, :3] / clip[:, 3:])
        return ends

    def to_eye(self, points):
        """(n, 3) unit directions from points to the camera."""
        if self.orthographic:
            return np.broadcast_to(self.view[2, :3], points.shape)
        away = cameras.eye_position(self.view) - points
        return away / np.linalg.norm(away, axis=1, keepdims=True)

    def bottom_through(self, points):
        """(n, 3) where the lines of sight through points meet the bottom."""
        away = self.to_eye(points)
        return points - away * ((points[:, 2] + self.depth) / away[:, 2])[:, None]

    def bottom_at(self, uv):
        """(n, 3) what of the bottom is seen at coordinates of the refraction texture."""
        near, far = self._sight(uv)
        part = (-self.depth - near[:, 2]) / (far[:, 2] - near[:, 2])
        return near + part[:, None] * (far - near)

    def coordinates(self, points):
        """(n, 2) where points lie in the refraction texture."""
        return cameras.to_texture(self.projection, points @ self.view[:3, :3].T + self.view[:3, 3])

    def textures(self, refraction=(1.0, 1.0, 1.0), reflection=(1.0, 1.0, 1.0), sky=(0.0, 0.0, 0.0)):
        """Refraction and reflection: colours, or functions of coordinates (n, 2) -> (n, 3)."""

        def picture(color):
            def lookup(uv):
                rgb = (
                    color(uv) if callable(color) else np.broadcast_to(np.asarray(color, float), (len(uv), 3))
                )
                return np.column_stack([rgb, np.ones(len(uv))])

            return lookup

        def bottom_depth(uv):
            return -(self.bottom_at(uv) @ self.view[2, :3] + self.view[2, 3])

        return WaterTextures(
            picture(refraction),
            bottom_depth,
            picture(reflection),
            lambda d: np.broadcast_to(np.asarray(sky, float), d.shape),
            FADE,
        )


def up(points):
    """(n, 3) normals of flat water."""
    return np.broadcast_to(cameras.UP, points.shape)


def constant(*rgba):
    """A picture of one colour."""
    return lambda uv: np.broadcast_to(np.array(rgba, float), (len(uv), 4))
