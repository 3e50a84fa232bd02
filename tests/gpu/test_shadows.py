# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows and the light below a calm surface, against rays cast by Blender itself and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, light, shadows
from tests.gpu import scenes
from tests.gpu.pictures import draw, draw_plan, draw_textures, planned
from tests.gpu.rays import RayCaster, pixel_rays

SIZE = (80, 60)
IRRADIANCE = np.array([3.0, 2.5, 2.0])
SKY = np.array([0.1, 0.15, 0.2])
BAND = 2.75
"""Texels around the edge of a shadow within which a pixel may differ from the ray's answer: the filter
reaches 1.5 texels along each axis, 2.1 across, and a lookup is moved by up to half of one."""


def sun_at(elevation, azimuth=210.0):
    """A sun so many degrees above the horizon."""
    up, around = np.radians(elevation), np.radians(azimuth)
    direction = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    return scenes.Sun(direction, IRRADIANCE)


def tilted(angle, azimuth=0.0, x=0.0, y=0.0, z=0.0):
    """(4, 4) of something that stands at (x, y, z), leaning by `angle` degrees towards `azimuth`."""
    a, b = np.radians(angle), np.radians(azimuth)
    turn = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1.0]])
    lean = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    matrix = scenes.translation(x, y, z)
    matrix[:3, :3] = turn @ lean @ turn.T
    return matrix


def yard(sun, **changes):
    """Dry ground with a box, a post, a roof on a wall, and a leaning slab."""
    ground = scenes.grid_mesh("ground", 2, 40.0)
    box = scenes.box_mesh("box", (1.0, 1.5, 0.8))
    post = scenes.box_mesh("post", (0.2, 0.2, 2.0))
    roof = scenes.box_mesh("roof", (2.0, 1.5, 0.15))
    slab = scenes.box_mesh("slab", (1.5, 1.5, 0.3))
    paints = [scenes.Material(str(i), np.array(c)) for i, c in enumerate(((0.5, 0.5, 0.5), (0.6, 0.3, 0.2)))]
    parts = (
        ("ground", "0", [np.eye(4)]),
        ("box", "1", [scenes.translation(-3, 1, 0.8)]),
        ("post", "1", [scenes.translation(0, -2, 2.0)]),
        ("roof", "1", [scenes.translation(3, 2, 2.5)]),
        ("box", "0", [scenes.translation(3, 3, 0.8)]),
        ("slab", "1", [tilted(50.0, 20.0, 2.0, -4.0, 0.4)]),
    )
    options = {"sun": sun, "sky": scenes.constant_sky(SKY), **changes}
    return scenes.snapshot((ground, box, post, roof, slab), paints, parts, **options)


ABOVE_THE_YARD = scenes.look_at((-7, -11, 8), (0, 0, 0.5), SIZE, fov=0.9)


def offsets(direction, radius):
    """(16, 3) offsets across a direction: around circles of the radius and of half of it."""
    right, up, _ = light.light_axes(direction)
    angle = np.arange(8) * np.pi / 4.0
    circle = np.cos(angle)[:, None] * right + np.sin(angle)[:, None] * up
    return radius * np.concatenate([circle, 0.5 * circle])


def in_plane(normals, direction, offset):
    """(n, 3): offsets (3,) or (n, 3) across a direction, moved along it into planes with these normals."""
    slope = normals @ direction
    slope = np.where(np.abs(slope) > 1e-6, slope, 1e-6)
    return offset - (np.sum(normals * offset, axis=1) / slope)[:, None] * direction


def open_to(casters, points, normals, direction, offset):
    """(n,) whether light in `direction` (3,) reaches the planes of the faces beside points (n, 3).

    offset: (3,) or (n, 3), across the direction. The plane goes on beyond the face's own border.
    """
    along = (in_plane(normals, direction, offset) - offset) @ direction
    return casters.first(points + offset, direction) >= along - 2e-3


def sunlit(casters, points, normals, direction, texel):
    """(lit (n,), sure (n,)): whether light reaches the points, and whether rays nearby say the same.

    Nearby: within BAND texels across the light, and up to half a texel above the face.
    """
    lit = open_to(casters, points, normals, direction, np.zeros(3))
    sure = np.ones(len(points), bool)
    for height in (0.0, shadows.NORMAL_OFFSET):
        raised = points + (height * texel)[:, None] * normals
        for offset in offsets(direction, BAND):
            sure &= open_to(casters, raised, normals, direction, texel[:, None] * offset) == lit
    return lit, sure


def texel_sizes(windows, points):
    """(n,) m: size of a texel of the coarsest window that has a part in the answer at each point."""
    found, unknown = np.zeros(len(points)), np.ones(len(points), bool)
    for camera in windows:
        at = points @ camera.view[:3, :3].T + camera.view[:3, 3]
        texel = shadows.in_window(camera.projection, camera.resolution, at)
        # A lookup is moved by up to half a texel.
        near = shadows.window_weight(camera.resolution, texel + 0.5, 1.0) + shadows.window_weight(
            camera.resolution, texel - 0.5, 1.0
        )
        found = np.where(unknown & (near > 0.0), camera.texel.max(), found)
        whole = shadows.window_weight(
            camera.resolution, texel, shadows.WINDOW_BLEND * camera.resolution + 1.0
        )
        unknown &= whole < 1.0
    assert not np.any(found == 0.0), "a point in the picture is in no window"
    return found


def seen_points(casters, view, projection, size):
    """What each pixel sees: found (n,), points (n, 3), normals towards the viewer (n, 3), materials (n,)."""
    origin, direction = pixel_rays(view, projection, size)
    hits = casters.cast(origin, direction)
    points = origin + np.where(hits.found, hits.distance, 0.0)[:, None] * direction
    facing = np.sum(hits.normal * direction, axis=1, keepdims=True)
    return hits.found, points, np.where(facing > 0.0, -hits.normal, hits.normal), hits.material


def dry_answer(scene, plan, camera, size=SIZE):
    """(radiance (h, w, 3), sure (h, w)) by rays. Pixels with sky, or next to another face, are not sure."""
    casters = RayCaster(scene)
    found, points, normals, material = seen_points(casters, camera.view, camera.projection, size)
    direction = -scene.sun.direction
    lit, sure = sunlit(casters, points, normals, direction, texel_sizes_where(plan.shadows, points, found))
    sun = np.maximum(-(normals @ direction), 0.0) * lit
    radiance = casters.albedo[material] * (sun[:, None] * IRRADIANCE / np.pi + SKY)
    sure &= found & ~edges(material, normals, size).ravel()
    shape = size[::-1]
    return radiance.reshape(*shape, 3), sure.reshape(shape), (lit & found).reshape(shape)


def texel_sizes_where(windows, points, found):
    texel = np.zeros(len(points))
    texel[found] = texel_sizes(windows, points[found])
    return texel


def edges(material, normals, size):
    """(h, w) where a neighbouring pixel shows another face: a pixel's middle may be on either."""
    shape = size[::-1]
    label = np.column_stack([material, np.round(normals, 3)]).reshape(*shape, 4)
    edge = np.zeros(shape, bool)
    for axis in (0, 1):
        other = np.any(label != np.roll(label, 1, axis), axis=-1)
        edge |= other | np.roll(other, -1, axis)
    return edge


DRY = {
    "perspective": ABOVE_THE_YARD,
    "from near the ground": scenes.look_at((4, -9, 1.0), (0, 2, 0.8), SIZE, fov=1.1),
    "straight down": scenes.look_at((0, 0, 14), (0, 0, 0), SIZE, fov=0.8),
    "orthographic": scenes.look_at((-7, -11, 8), (0, 0, 0.5), SIZE, ortho=14.0),
}


def disagreeing(picture, want, sure):
    """Number of sure pixels that differ by more than 0.002."""
    return int(np.sum(np.abs(picture[..., :3] - want).max(axis=-1)[sure] > 2e-3))


@pytest.mark.parametrize(
    ("elevation", "size"), [(90.0, 512), (50.0, 512), (50.0, 128), (20.0, 512), (5.0, 512)]
)
@pytest.mark.parametrize("camera", DRY.values(), ids=DRY)
def test_dry_shadows_are_those_that_rays_find(renderer, camera, elevation, size):
    """Each pixel farther than BAND texels from a shadow's edge, to 0.002: no acne, and nothing leaks."""
    scene = yard(sun_at(elevation))
    plan = planned(scene, camera, use_shadows=True, light_depth_size=size)
    want, sure, lit = dry_answer(scene, plan, camera)
    assert disagreeing(draw_plan(renderer, plan, SIZE), want, sure) == 0
    assert sure.mean() > 0.2
    assert elevation == 90.0 or size == 128 or np.any(~lit & sure), "no shadow is in the picture"


@pytest.mark.parametrize("angle", [0, 30, 60, 75, 80])
@pytest.mark.parametrize("smoothed", [False, True])
def test_slopes_do_not_shade_themselves(renderer, angle, smoothed):
    """A lone slope, so many degrees from the sun, is lit all over, also with its normals turned up."""
    slab = scenes.box_mesh("slab", (3.0, 3.0, 0.5))
    if smoothed:
        up = tilted(55.0 - angle, 0.0)[2, :3].astype(np.float32)  # in the slab's own space
        slab = scenes.changed(slab, normals=np.tile(up, (len(slab.normals), 1)))
    grey = scenes.Material("grey", np.array([0.5, 0.5, 0.5]))
    sun = sun_at(35.0, 0.0)
    # Its upper face leans away from the sun in the XZ plane.
    matrix = tilted(55.0 - angle, 0.0)
    scene = scenes.snapshot(
        (slab,), (grey,), (("slab", "grey", [matrix]),), sun=sun, sky=scenes.constant_sky(SKY)
    )
    normal = matrix[:3, 2]
    assert np.degrees(np.arccos(normal @ sun.direction)) == pytest.approx(angle)
    camera = scenes.look_at(8.0 * normal, (0, 0, 0), SIZE, ortho=3.0)
    picture = draw(renderer, scene, camera, SIZE, use_shadows=True, light_depth_size=64)
    cosine = sun.direction[2] if smoothed else np.cos(np.radians(angle))
    want = 0.5 * (cosine * IRRADIANCE / np.pi + SKY)
    assert np.abs(picture[..., :3] - want).max() < 1e-3


def test_edge_of_a_shadow_is_soft(renderer):
    """Across the edge of a roof's shadow, light rises steadily over two texels, along two parabolas.

    It begins on the border between two texels of which one has the roof at its middle.
    """
    grey = scenes.Material("grey", np.ones(3))
    sun = sun_at(60.0, 0.0)
    scene = scenes.snapshot(
        (scenes.grid_mesh("ground", 2, 20.0), scenes.box_mesh("roof", (4.0, 40.0, 0.5))),
        (grey,),
        (("ground", "grey", [np.eye(4)]), ("roof", "grey", [scenes.translation(6, 0, 4)])),
        sun=sun,
        sky=scenes.constant_sky((0.0, 0.0, 0.0)),
    )
    size = (300, 200)
    camera = scenes.look_at((-0.5, 0, 3), (-0.5, 0, 0), size, ortho=3.0, near=0.1, far=10.0)
    plan = planned(scene, camera, use_shadows=True, light_depth_size=64)
    picture = draw_plan(renderer, plan, size)[..., :3]
    profile = (picture * np.pi / (IRRADIANCE * sun.direction[2]))[100, :, 0]
    (window,) = plan.shadows
    ground = pixel_rays(camera.view, camera.projection, size)[0].reshape(200, 300, 3)[100] * [1, 1, 0]
    moved = shadows.normal_offset(cameras.UP, sun.direction, window.texel.max()) * cameras.UP
    corner = np.array([[2.0, 0.0, 4.5]])
    x, edge = (
        shadows.in_window(window.projection, 64, points @ window.view[:3, :3].T)[:, 0]
        for points in (ground + moved, corner)
    )
    beyond = np.clip(np.round(edge) - x, -1.0, 1.0)
    want = np.where(beyond < 0.0, 0.5 * (1.0 + beyond) ** 2, 1.0 - 0.5 * (1.0 - beyond) ** 2)
    np.testing.assert_allclose(profile, want, atol=2e-3)
    assert profile.min() < 1e-3 and profile.max() > 1.0 - 1e-3
    assert np.all(np.diff(profile) * np.sign(np.diff(want).sum()) >= -1e-5), "not monotone"
    assert np.sum((profile > 0.02) & (profile < 0.98)) > 5, "the pixels do not resolve the edge"


# Below a calm surface.

K = 0.3
N12 = 1.0 / 1.333


def lagoon(sun, **settings):
    """A level bottom under calm water, a roof in the air, a sunken crate, a post through the surface."""
    bottom = scenes.grid_mesh("bottom", 2, 40.0, -3.0)
    roof = scenes.box_mesh("roof", (1.5, 1.2, 0.2))
    crate = scenes.box_mesh("crate", (1.0, 0.8, 0.6))
    post = scenes.box_mesh("post", (0.3, 0.3, 3.0))
    slab = scenes.box_mesh("slab", (1.2, 1.2, 0.2))
    sand = scenes.Material("sand", np.array([0.5, 0.4, 0.3]))
    wood = scenes.Material("wood", np.array([0.6, 0.3, 0.2]))
    parts = (
        ("bottom", "sand", [np.eye(4)]),
        ("roof", "wood", [scenes.translation(-3, 0, 2.5)]),
        ("crate", "wood", [scenes.translation(2.5, 2, -1.5)]),
        ("post", "wood", [scenes.translation(0.5, -2.5, -1.0)]),
        ("slab", "sand", [tilted(35.0, 70.0, 3.0, -2.5, -2.4)]),
    )
    options = {"k": K, "waves": (), "water_color": (0.02, 0.1, 0.08), **settings}
    return scenes.snapshot(
        (bottom, roof, crate, post, slab),
        (sand, wood),
        parts,
        (scenes.water(**options),),
        sun=sun,
        sky=scenes.constant_sky(SKY),
    )


ABOVE_THE_LAGOON = scenes.look_at((-1, -8, 7), (0.5, 0, -2), SIZE, fov=0.8)


def sunlight_below(sun):
    """(direction (3,) of sunlight under a calm surface, irradiance across it over that in the air).

    Snell's law by the angle, and the flux through a piece of the surface.
    """
    sine = np.hypot(*sun.direction[:2])
    below = N12 * sine
    level = sun.direction[:2] / sine if sine > 0 else np.zeros(2)
    direction = -np.array([*(below * level), np.sqrt(1.0 - below**2)])
    return direction, sun.direction[2] / -direction[2]


def shade_below(casters, points, normals, sun, texel, texel_in_air):
    """(lit, sure): as `sunlit`, for points below the surface, with sunken things and those in the air."""
    direction, _ = sunlight_below(sun)
    up = np.broadcast_to(cameras.UP, points.shape)

    def surface_over(at):
        return at + direction * (-at[:, 2:] / direction[2])

    def is_clear_in_water(at):
        surface = surface_over(at)
        way = np.sum((at - surface) * direction, axis=1)
        return casters.cast(surface, np.broadcast_to(direction, at.shape)).distance >= way - 2e-3

    def is_clear_in_air(at):
        return casters.is_free(at, np.broadcast_to(sun.direction, at.shape))

    surface = surface_over(points)
    in_water, in_air = is_clear_in_water(points), is_clear_in_air(surface)
    sure = np.ones(len(points), bool)
    for height in (0.0, shadows.NORMAL_OFFSET):
        for offset in offsets(direction, BAND * texel):
            beside = points + in_plane(normals, direction, offset)
            sure &= is_clear_in_water(beside + height * texel * normals) == in_water
        for offset in offsets(-sun.direction, BAND * texel_in_air):
            beside = surface + in_plane(up, -sun.direction, offset)
            sure &= is_clear_in_air(beside + height * texel_in_air * up) == in_air
    return in_water & in_air, sure


def schlick_at_sun(sun, q=5.0):
    f = ((1.0 - N12) / (1.0 + N12)) ** 2
    return f + (1.0 - f) * (1.0 - sun.direction[2]) ** q


def bottom_radiance(albedo, points, normals, lit, sun):
    """(n, 3): albedo / pi times the sun's irradiance through (1 - F) exp(-k d), and the sky's."""
    direction, bending = sunlight_below(sun)
    path = points[:, 2] / direction[2]
    cosine = np.maximum(-(normals @ direction), 0.0)
    through = bending * cosine * (1.0 - schlick_at_sun(sun)) * np.exp(-K * path) * lit
    return albedo * (through[:, None] * IRRADIANCE / np.pi + SKY)


@pytest.mark.parametrize("elevation", [90.0, 60.0, 30.0, 8.0])
def test_light_below_calm_water_is_that_of_the_rays(renderer, elevation):
    """Radiance of the bottom, lit and shaded from the air and from under water, in the refraction texture."""
    sun = sun_at(elevation)
    scene = lagoon(sun)
    plan, colors, _, _ = draw_textures(
        renderer, scene, ABOVE_THE_LAGOON, texture_size=64, use_shadows=True, light_depth_size=512
    )
    body = plan.bodies[0]
    casters = RayCaster(scene)
    found, points, normals, material = seen_points(
        casters, body.refraction.view, body.refraction.projection, (64, 64)
    )
    texel, texel_in_air = body.light.camera.texel.max(), max(camera.texel.max() for camera in plan.shadows)
    lit, sure = shade_below(casters, points, normals, sun, texel, texel_in_air)
    want = bottom_radiance(casters.albedo[material], points, normals, lit, sun).reshape(64, 64, 3)
    sure &= found & (points[:, 2] < -0.05) & ~edges(material, normals, (64, 64)).ravel()
    sure = sure.reshape(64, 64) & (colors[..., 3] == 1.0)  # the rest is never looked up, and not drawn
    assert disagreeing(colors, want, sure) == 0
    shaded = ~lit.reshape(64, 64) & sure
    assert sure.mean() > 0.2 and shaded.mean() > 0.005


def from_behind(elevation):
    """A sun behind a camera that looks along +Y."""
    return sun_at(elevation, -90.0)


def open_lagoon(sun, shaded=False):
    """A level bottom of one albedo under calm water; shaded: by something far off towards the sun."""
    bottom = scenes.grid_mesh("bottom", 2, 60.0, -3.0)
    wall = scenes.box_mesh("wall", (60.0, 20.0, 60.0))
    sand = scenes.Material("sand", np.array([0.5, 0.4, 0.3]))
    parts = [("bottom", "sand", [np.eye(4)])]
    if shaded:
        parts.append(("wall", "sand", [scenes.translation(0, -90, 61)]))
    return scenes.snapshot(
        (bottom, wall),
        (sand,),
        parts,
        (scenes.water(k=K, waves=(), water_color=(0.02, 0.1, 0.08)),),
        sun=sun,
        sky=scenes.constant_sky(SKY),
    )


@pytest.mark.parametrize("elevation", [90.0, 40.0, 10.0])
@pytest.mark.parametrize("use_shadows", [False, True])
def test_what_the_sun_adds_to_calm_water(renderer, elevation, use_shadows):
    """(1 - F) exp(-k d) on the way down, and on the way up: each pixel to 1.5 %, as depths are of texels."""
    sun = from_behind(elevation)
    scene = open_lagoon(sun)
    camera = scenes.look_at((0, -6, 5), (0, 1, -1), SIZE, fov=0.8)
    picture = draw(renderer, scene, camera, SIZE, use_shadows=use_shadows)
    without = draw(renderer, replace(scene, sun=None, version=-11), camera, SIZE)
    _, incident = pixel_rays(camera.view, camera.projection, SIZE)
    cosine = -incident[:, 2]
    below = np.sqrt(1.0 - N12**2 * (1.0 - cosine**2))
    f = ((1.0 - N12) / (1.0 + N12)) ** 2
    seen = (1.0 - f) * (1.0 - (1.0 - cosine) ** 5.0) * np.exp(-K * 3.0 / below)
    direction, _ = sunlight_below(sun)
    falls = sun.direction[2] * (1.0 - schlick_at_sun(sun)) * np.exp(-K * 3.0 / -direction[2])
    want = (seen * falls)[:, None] * np.array([0.5, 0.4, 0.3]) / np.pi * IRRADIANCE
    added = (picture - without)[..., :3].reshape(-1, 3)
    assert want.max() > 4e-3
    np.testing.assert_allclose(added, want, rtol=0.015, atol=2e-4)


def test_what_stands_towards_the_sun_shades_the_bottom_however_far(renderer):
    """Also out of the picture; then the sun adds nothing."""
    camera = scenes.look_at((0, -6, 5), (0, 1, -1), SIZE, fov=0.8)
    scene = open_lagoon(from_behind(40.0), shaded=True)
    picture = draw(renderer, scene, camera, SIZE, use_shadows=True)
    without = draw(renderer, replace(scene, sun=None, version=-12), camera, SIZE)
    np.testing.assert_allclose(picture, without, atol=1e-6)


# Suns that give no light, or hardly any.


@pytest.mark.parametrize("z", [-1.0, -0.3, -1e-3, 0.0, 1e-9, 1e-3, 2e-3])
@pytest.mark.parametrize("wet", [False, True])
def test_sun_below_the_horizon_or_grazing_it(renderer, z, wet):
    """Nothing but numbers. A sun that is down lights neither the ground nor the bottom."""
    level = np.sqrt(1.0 - z * z)
    sun = scenes.Sun(np.array([0.6 * level, -0.8 * level, z]), IRRADIANCE)
    scene, camera = (lagoon(sun), ABOVE_THE_LAGOON) if wet else (yard(sun), ABOVE_THE_YARD)
    picture = draw(renderer, scene, camera, SIZE, use_shadows=True)
    assert np.isfinite(picture).all() and picture.min() >= 0.0
    assert picture[..., :3].max() <= 0.6 * (IRRADIANCE.max() / np.pi + SKY.max()) + 1e-3
    if z <= 0.0:
        dark = draw(renderer, replace(scene, sun=None, version=-13), camera, SIZE, use_shadows=True)
        lit = np.abs(picture - dark).max(axis=-1) > 1e-4
        if z == -1.0:
            assert lit.mean() < 0.003, "more than the line where the ground is pierced"
        ground = scenes.look_at((0, 0, 5), (0, 0, 0), SIZE, fov=0.3)
        scene_of_ground = replace(scene, draws=scene.draws[:1], version=-14)
        dark = draw(renderer, replace(scene_of_ground, sun=None, version=-15), ground, SIZE)
        np.testing.assert_allclose(
            draw(renderer, scene_of_ground, ground, SIZE, use_shadows=True), dark, atol=1e-6
        )


@pytest.mark.parametrize("elevation", [-15.0, -40.0])
@pytest.mark.parametrize("wet", [False, True])
def test_sun_from_below_is_kept_off_by_the_ground(renderer, elevation, wet):
    """Nothing above the ground is lit through it, but for a few texels along its foot."""
    sun = sun_at(elevation)
    scene, camera = (lagoon(sun), ABOVE_THE_LAGOON) if wet else (yard(sun), ABOVE_THE_YARD)
    under_the_roof = scenes.look_at((-6, -6, 0.4), (-2, 0, 2.4), SIZE, fov=1.2)
    for view in (camera, under_the_roof):
        picture = draw(renderer, scene, view, SIZE, use_shadows=True)
        dark = draw(renderer, replace(scene, sun=None, version=-16), view, SIZE, use_shadows=True)
        lit = np.abs(picture - dark).max(axis=-1) > 1e-4
        assert lit.mean() < 0.006, lit.mean()


def test_no_sun_needs_no_shadows(renderer):
    scene = lagoon(None)
    plan = planned(scene, ABOVE_THE_LAGOON, use_shadows=True)
    assert plan.shadows == () and plan.bodies[0].light is None
    picture = draw_plan(renderer, plan, SIZE)
    np.testing.assert_array_equal(picture, draw(renderer, scene, ABOVE_THE_LAGOON, SIZE))


def test_empty_scene_with_a_sun(renderer):
    for waters in ((), (scenes.water(),)):
        scene = scenes.snapshot((), (), (), waters, sun=sun_at(30.0), sky=scenes.constant_sky(SKY))
        picture = draw(renderer, scene, ABOVE_THE_LAGOON, SIZE, use_shadows=True)
        assert np.isfinite(picture).all()


# What is drawn when, and where.


def drawn_passes(renderer, scene, camera, **options):
    """Names of the passes that a frame ran, and what it made on the GPU."""
    from lake_water_addon.render.frame import PassTimer

    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    renderer.resources.reset_counts()
    timer = PassTimer()
    renderer.draw_picture(planned(scene, camera, use_shadows=True, **options), target, timer)
    return set(timer.seconds), dict(renderer.resources.made)


def moved_camera(camera, offset):
    return replace(camera, view=camera.view @ scenes.translation(*np.negative(offset)))


def test_depths_from_the_sun_are_drawn_when_the_sun_the_scene_or_the_window_changes(renderer):
    sun_depths = {"shadow depth", "light depth"}
    scene, camera = lagoon(sun_at(40.0)), ABOVE_THE_LAGOON
    passes, _ = drawn_passes(renderer, scene, camera)
    assert sun_depths <= passes
    windows = planned(scene, camera, use_shadows=True).shadows
    for unchanged in (
        (scene, camera),
        (replace(scene, time=7.5), camera),
        (scene, moved_camera(camera, (1e-4, 1e-4, 0.0))),
    ):
        passes, made = drawn_passes(renderer, *unchanged)
        assert not sun_depths & passes and not made, (passes, made)
    assert [w.key for w in planned(*unchanged, use_shadows=True).shadows] == [w.key for w in windows]
    for jitter in ((0.01, 0.0), (0.0, -0.01)):
        assert not sun_depths & drawn_passes(renderer, scene, camera, jitter=jitter)[0]
    assert not sun_depths & drawn_passes(renderer, scene, camera, window=(0.2, 0.3, 0.6, 0.9))[0]
    assert sun_depths <= drawn_passes(renderer, replace(scene, sun=sun_at(41.0), version=-20), camera)[0]
    assert sun_depths <= drawn_passes(renderer, replace(scene, version=-21), camera)[0]
    assert sun_depths <= drawn_passes(renderer, scene, moved_camera(camera, (20.0, 0.0, 0.0)))[0]


def test_without_shadows_no_depths_are_drawn_from_the_sun(renderer):
    from lake_water_addon.render.frame import PassTimer

    timer = PassTimer()
    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    renderer.draw_picture(planned(lagoon(sun_at(40.0)), ABOVE_THE_LAGOON), target, timer)
    assert "shadow depth" not in timer.seconds


@pytest.mark.parametrize("distance", [1e5, 3e6])
def test_far_from_the_origin_shadows_are_the_same(renderer, distance):
    scene = lagoon(sun_at(40.0))
    far = scenes.moved(scene, ABOVE_THE_LAGOON, (distance, -2.0 * distance, 300.0))
    options = {"use_shadows": True, "light_depth_size": 256}
    there = draw(renderer, *far, SIZE, **options)
    error = np.abs(there - draw(renderer, scene, ABOVE_THE_LAGOON, SIZE, **options)).max(axis=-1)
    assert np.mean(error > 1e-3) < 2e-3 and error.mean() < 1e-4, (np.mean(error > 1e-3), error.mean())


def test_things_below_the_level_of_the_water_shade_the_dry_ground(renderer):
    """A valley beside a lake that lies higher: its posts have shadows, too."""
    scene = yard(sun_at(40.0))
    lake = scenes.water((200.0, 200.0, 30.0), half_size=5.0)
    beside_a_lake = replace(scene, waters=(lake,), version=-30)
    options = {"use_shadows": True, "light_depth_size": 512}
    picture = draw(renderer, beside_a_lake, ABOVE_THE_YARD, SIZE, **options)
    alone = draw(renderer, scene, ABOVE_THE_YARD, SIZE, **options)
    assert np.mean(np.abs(picture - alone).max(axis=-1) > 0.05) < 0.02


def test_things_seen_in_the_water_alone_are_shaded(renderer):
    """A camera that looks down at the water sees a wall in it that it does not see itself."""
    sun = sun_at(35.0, 180.0)
    grey = scenes.Material("grey", np.array([0.5, 0.5, 0.5]))
    wall = scenes.box_mesh("wall", (0.2, 10.0, 6.0))
    screen = scenes.box_mesh("screen", (0.2, 10.0, 30.0))
    scene = scenes.snapshot(
        (wall, screen),
        (grey,),
        (
            ("wall", "grey", [scenes.translation(6, 0, 5)]),
            ("screen", "grey", [scenes.translation(-30, 0, 25)]),
        ),
        (scenes.water(k=K, waves=(), half_size=20.0),),
        sun=sun,
        sky=scenes.constant_sky(SKY),
    )
    camera = scenes.look_at((0, 0, 6), (2.5, 0, 0), SIZE, fov=0.5)
    plan, _, _, reflection = draw_textures(renderer, scene, camera, use_shadows=True, texture_size=64)
    casters = RayCaster(scene)
    passed = plan.bodies[0].reflection
    found, points, _, _ = seen_points(casters, passed.view, passed.projection, (64, 64))
    seen = found.reshape(64, 64) & (reflection[..., 3] == 1.0)
    on_the_wall = seen & (points[:, 0] < 5.9).reshape(64, 64) & (points[:, 0] > 5.7).reshape(64, 64)
    assert on_the_wall.mean() > 0.05
    shade = np.broadcast_to(0.5 * SKY, (on_the_wall.sum(), 3))
    np.testing.assert_allclose(reflection[on_the_wall][:, :3], shade, atol=2e-3)
