# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky's irradiance against closed forms and numerical integration."""

import numpy as np
import pytest

from lake_water_addon.core import sky

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def random_directions(count, seed=1):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def grid_directions(height):
    width = 2 * height
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    return sky.equirectangular_direction(np.stack([u, v], axis=-1))


def test_basis_is_orthonormal():
    height = 256
    basis = sky.sh_basis(grid_directions(height)).reshape(-1, 9)
    weights = np.repeat(sky.row_solid_angles(height) / (2 * height), 2 * height)
    np.testing.assert_allclose(basis.T @ (basis * weights[:, None]), np.eye(9), atol=1e-4)


@pytest.mark.parametrize("shape", [(1, 1), (5, 11), (64, 128), (300, 500)])
def test_constant_sky_gives_its_radiance_in_every_direction(shape):
    radiance = np.array([0.25, 1.0, 3.0])
    image = np.broadcast_to(radiance, (*shape, 3))
    from_image = sky.irradiance_sh(sky.project(sky.downsample(image)))
    for sh in (from_image, sky.constant_irradiance_sh(radiance)):
        values = sky.evaluate(sh, random_directions(50))
        np.testing.assert_allclose(values, np.broadcast_to(radiance, (50, 3)), rtol=2e-4)
    np.testing.assert_allclose(sky.mean_radiance(image), radiance, rtol=1e-12)


def test_linear_sky_has_the_closed_form():
    """L = a + b d gives E / pi = a + 2/3 b n: the cosine lobe's first two bands are exact."""
    direction = grid_directions(128)
    slope = np.array([0.3, -0.5, 0.7])
    image = (1.0 + direction @ slope)[..., None] * np.ones(3)
    normals = random_directions(50)
    expected = 1.0 + 2.0 / 3.0 * normals @ slope
    values = sky.evaluate(sky.irradiance_sh(sky.project(image)), normals)
    np.testing.assert_allclose(values[:, 1], expected, atol=2e-4)


def test_cosine_lobe_sky_against_integration():
    """A lobe max(0, a.d)^2 round an oblique axis: degree 2 is within 1 % of the peak of the true integral."""
    height = 128
    axis = np.array([0.48, -0.6, 0.64])
    direction = grid_directions(height)
    image = (np.maximum(direction @ axis, 0.0) ** 2)[..., None] * np.array([1.0, 2.0, 0.5])
    weights = np.repeat(sky.row_solid_angles(height) / (2 * height), 2 * height)
    normals = random_directions(40)
    cosine = np.maximum(direction.reshape(-1, 3) @ normals.T, 0.0)
    truth = (cosine * weights[:, None]).T @ image.reshape(-1, 3) / np.pi
    values = sky.evaluate(sky.irradiance_sh(sky.project(image)), normals)
    assert np.max(np.abs(values - truth)) < 0.01 * truth.max()


def test_irradiance_is_strongest_towards_the_bright_patch():
    """One bright texel at u = 0.25 is at +Y; turning the image by 90 degrees takes it to -X."""
    image = np.zeros((64, 128, 3))
    image[32, 32] = 100.0
    towards = sky.evaluate(sky.irradiance_sh(sky.project(image)), AXES)[:, 0]
    assert np.argmax(towards) == 1
    turned = sky.evaluate(sky.irradiance_sh(sky.project(image, np.pi / 2)), AXES)[:, 0]
    assert np.argmax(turned) == 3
    assert turned[3] == pytest.approx(towards[1], rel=1e-9)


def test_equirectangular_convention():
    """Blender's: the image's middle column is +X, u falls with the azimuth, the top row is up."""
    expected = {
        (1.0, 0.0, 0.0): (0.5, 0.5),
        (0.0, 1.0, 0.0): (0.25, 0.5),
        (0.0, -1.0, 0.0): (0.75, 0.5),
        (-1.0, 0.0, 0.0): (0.0, 0.5),
        (0.0, 0.0, 1.0): (0.5, 1.0),
    }
    for direction, uv in expected.items():
        np.testing.assert_allclose(sky.equirectangular_uv(np.array(direction)), uv, atol=1e-12)


@pytest.mark.parametrize("rotation", [0.0, 1.0, -2.5])
def test_uv_and_direction_are_inverse(rotation):
    d = random_directions(200)
    uv = sky.equirectangular_uv(d, rotation)
    np.testing.assert_allclose(sky.equirectangular_direction(uv, rotation), d, atol=1e-12)


def test_downsampling_keeps_the_mean():
    image = np.random.default_rng(3).random((512, 1024, 3))
    small = sky.downsample(image)
    assert small.shape == (sky.MAX_HEIGHT, 2 * sky.MAX_HEIGHT, 3)
    np.testing.assert_allclose(sky.mean_radiance(small), sky.mean_radiance(image), rtol=1e-12)
    full = sky.project(image)
    np.testing.assert_allclose(sky.project(small), full, atol=2e-3 * full[0].max())


def test_srgb_decoding():
    np.testing.assert_allclose(
        sky.linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])), [0.0, 0.0031308, 0.2140411, 1.0], rtol=1e-5
    )
