# SPDX-License-Identifier: GPL-3.0-or-later
"""A clear day's sky with soft clouds as an environment image; the sun's disc is left to the sun lamp."""

from __future__ import annotations

import bpy
import numpy as np

from .noise import GradientNoise, smoothstep

# Preetham, Shirley, Smits: "A Practical Analytic Model for Daylight", SIGGRAPH 1999, appendix A.2:
# the coefficients A..E of Perez's distribution as (factor of the turbidity, constant).
_PEREZ_Y = ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703))
_PEREZ_x = ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452))
_PEREZ_y = ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529))
_ZENITH_x = (
    (0.00166, -0.00375, 0.00209, 0.0),
    (-0.02903, 0.06377, -0.03202, 0.00394),
    (0.11693, -0.21196, 0.06052, 0.25886),
)
_ZENITH_y = (
    (0.00275, -0.00610, 0.00317, 0.0),
    (-0.04214, 0.08970, -0.04153, 0.00516),
    (0.15346, -0.26756, 0.06670, 0.26688),
)
_XYZ_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def equirectangular_directions(width: int, height: int) -> np.ndarray:
    """(height, width, 3) unit world directions of an environment image's pixels, row 0 at the bottom."""
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    azimuth = -(u - 0.5) * 2.0 * np.pi
    elevation = (v - 0.5) * np.pi
    horizontal = np.cos(elevation)[:, None]
    return np.stack(
        [
            horizontal * np.cos(azimuth)[None],
            horizontal * np.sin(azimuth)[None],
            np.sin(elevation)[:, None] * np.ones((1, width)),
        ],
        axis=-1,
    )


def _perez(cos_theta: np.ndarray, gamma: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    a, b, c, d, e = coefficients
    return (1.0 + a * np.exp(b / cos_theta)) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)


def clear_sky(directions: np.ndarray, sun: np.ndarray, turbidity: float) -> np.ndarray:
    """Radiance (..., 3), linear Rec.709, of the clear sky, scaled so that its mean luminance is 1.

    directions: (..., 3) unit; those below the horizon get the horizon's value. sun: (3,) unit, towards the
    sun.
    """
    cos_theta = np.maximum(directions[..., 2], 0.03)
    gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    theta_s = float(np.arccos(np.clip(sun[2], 0.05, 1.0)))
    powers = np.array([theta_s**3, theta_s**2, theta_s, 1.0])
    t = np.array([turbidity**2, turbidity, 1.0])
    zenith = (1.0, float(t @ np.array(_ZENITH_x) @ powers), float(t @ np.array(_ZENITH_y) @ powers))
    channels = []
    for table, at_zenith in zip((_PEREZ_Y, _PEREZ_x, _PEREZ_y), zenith, strict=True):
        k = np.array(table) @ np.array([turbidity, 1.0])
        reference = _perez(np.float64(1.0), np.float64(theta_s), k)
        channels.append(at_zenith * _perez(cos_theta, gamma, k) / reference)
    luminance, x, y = channels
    xyz = np.stack([luminance * x / y, luminance, luminance * (1.0 - x - y) / y], axis=-1)
    rgb = np.maximum(xyz @ _XYZ_TO_RGB.T, 0.0)
    solid_angle = np.sqrt(np.maximum(1.0 - directions[..., 2] ** 2, 0.0))
    weight = np.where(directions[..., 2] > 0.0, solid_angle, 0.0)
    mean = np.sum(weight * (rgb @ np.array([0.2126, 0.7152, 0.0722]))) / np.sum(weight)
    return rgb / mean


def sky_image(
    sun: np.ndarray,
    seed: int,
    *,
    width: int = 1024,
    mean: float = 0.62,
    turbidity: float = 2.6,
    cover: float = 0.46,
) -> np.ndarray:
    """The environment as (width/2, width, 3) scene-linear radiance, row 0 at the bottom (straight down).

    sun: (3,) unit, towards the sun. mean: mean luminance of the clear part, W/(m^2 sr). cover: 0 cloudless
    .. 1.
    """
    full = equirectangular_directions(width, width // 2)
    # The sky is computed a little way below the horizon too, where it fades into the ground.
    rows = int(0.45 * len(full))
    d = full[rows:]
    sun = np.asarray(sun, dtype=np.float64)
    sky = mean * clear_sky(d, sun, turbidity)
    # Preetham's aureole is far brighter than an 8-bit picture can show: the lamp carries that energy.
    peak = 2.6 * mean
    luminance = sky @ np.array([0.2126, 0.7152, 0.0722])
    soft = peak + 0.35 * np.log1p(np.maximum(luminance - peak, 0.0))
    sky *= (np.where(luminance > peak, soft, luminance) / np.maximum(luminance, 1e-9))[..., None]
    up = np.maximum(d[..., 2], 0.0)
    haze = mean * np.array([1.06, 1.12, 1.20])
    sky += (0.45 * np.exp(-up / 0.05))[..., None] * (haze - sky)
    # Two layers of cloud on planes above: cumulus, and streaks of cirrus.
    noise = GradientNoise(seed + 77)
    toward = np.clip(d @ sun, 0.0, 1.0)
    plane = d[..., :2] / (up + 0.09)[..., None]
    warped = plane * 1.15 + 0.35 * np.stack([noise(plane * 0.9), noise(plane * 0.9 + 31.0)], axis=-1)
    density = noise.fbm(warped, 6, 0.52)
    lit = noise.fbm(warped + 0.16 * sun[:2] / max(float(np.hypot(*sun[:2])), 1e-6), 4, 0.52)
    bank = noise(plane * 0.33 + 9.0)
    threshold = 0.62 - 0.9 * cover
    cloud = smoothstep(threshold, threshold + 0.55, density + 0.45 * bank) * smoothstep(0.015, 0.12, up)
    bright = np.clip(0.92 + 0.42 * (density - lit), 0.62, 1.25)
    cloud_color = mean * np.stack(
        [
            1.75 * bright + 0.5 * toward**6,
            1.72 * bright + 0.44 * toward**6,
            1.72 * bright + 0.34 * toward**6 + 0.05 * (1.25 - bright),
        ],
        axis=-1,
    )
    sky += (0.88 * cloud)[..., None] * (cloud_color - sky)
    streak = noise.fbm(plane * np.array([0.5, 1.9]) + 55.0, 5, 0.55)
    cirrus = smoothstep(0.12, 0.9, streak) * smoothstep(0.08, 0.35, up) * 0.4
    sky += (cirrus * (1.0 - cloud))[..., None] * (mean * 1.7 - sky)
    # Under the horizon: the meadow's reflected light, which only bounces can see.
    ground = mean * np.array([0.33, 0.35, 0.22])
    below = smoothstep(0.0, -0.12, d[..., 2])
    sky += below[..., None] * (ground - sky)
    image = np.empty(full.shape, dtype=np.float32)
    image[:rows] = ground
    image[rows:] = sky
    return image


def make_world(name: str, pixels: np.ndarray) -> bpy.types.World:
    """A world that shows scene-linear equirectangular (h, w, 3) pixels, packed as 32-bit float."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(f"{name} Environment", width, height, alpha=False, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    world = bpy.data.worlds.new(name)
    tree = world.node_tree
    tree.nodes.clear()
    environment = tree.nodes.new("ShaderNodeTexEnvironment")
    environment.image = image
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    environment.location, output.location = (-300, 0), (250, 0)
    tree.links.new(environment.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return world
