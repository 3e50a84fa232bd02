# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that begin under water, or that the surface cuts through, against closed forms and each other."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, under_water
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.core.under_water import Side, ViewSide
from tests.gpu import scenes
from tests.gpu.pictures import SIZE, draw, draw_plan, planned

CRITICAL_ANGLE = np.degrees(np.arcsin(1.0 / 1.333))


def pixel_centers(size=SIZE):
    """(h, w, 2) device coordinates."""
    x, y = (2.0 * (np.arange(n) + 0.5) / n - 1.0 for n in size)
    return np.stack(np.meshgrid(x, y), axis=-1)


def directions(camera, size=SIZE):
    """(h, w, 3) unit directions of sight of a perspective camera."""
    plane = under_water.near_plane(camera.view, camera.projection)
    offset = plane.offset(pixel_centers(size))
    return offset / np.linalg.norm(offset, axis=-1, keepdims=True)


def shifted_lens(camera, x, y):
    projection = camera.projection.copy()
    projection[0, 2] += x
    projection[1, 2] += y
    return replace(camera, projection=projection)


# The surface from below.


@pytest.mark.parametrize("depth", [0.3, 2.0, 9.0])
@pytest.mark.parametrize("tilt", [0.0, 25.0, 50.0])
def test_snells_window_has_its_angular_radius(renderer, depth, tilt):
    """Under a calm surface and a white sky the world is seen within 48.6 degrees of the zenith."""
    scene = scenes.snapshot(
        (),
        (),
        (),
        (scenes.water(half_size=60.0, k=0.0, water_color=(0.0, 0.0, 0.0)),),
        sky=scenes.constant_sky((1.0, 1.0, 1.0)),
    )
    angle = np.radians(tilt)
    eye = np.array([1.0, 2.0, -depth])
    size = (320, 240)
    camera = scenes.look_at(eye, eye + np.array([0.0, np.sin(angle), np.cos(angle)]), size, fov=2.0)
    picture = draw(renderer, scene, camera, size, use_exact_under_water=True)
    from_zenith = np.degrees(np.arccos(directions(camera, size)[..., 2]))
    seen = picture[..., 0] > 0.02
    assert seen.any() and not seen.all()
    radius = 0.5 * (from_zenith[seen].max() + from_zenith[~seen].min())
    assert abs(radius - CRITICAL_ANGLE) < 0.5, radius
    # Its edge is a circle: no pixel is on the wrong side of it by more than half a degree.
    assert from_zenith[seen].max() < CRITICAL_ANGLE + 0.5
    assert from_zenith[~seen].min() > CRITICAL_ANGLE - 0.5


def test_light_through_snells_window_is_fresnels(renderer):
    """Inside the window 1 - F of the sky, attenuated on the way to the eye, mixed with the water's colour."""
    water_color, k, depth = np.array([0.1, 0.2, 0.3]), 0.4, 1.5
    body = scenes.water(half_size=60.0, k=k, water_color=tuple(water_color))
    scene = scenes.snapshot((), (), (), (body,))
    camera = scenes.look_at((0, 0, -depth), (0.2, 0.3, 0.0), fov=1.9)
    picture = draw(renderer, scene, camera, use_exact_under_water=True)[..., :3]
    cosine = directions(camera)[..., 2:]
    beyond = np.sqrt(np.maximum(1.0 - 1.333**2 * (1.0 - cosine**2), 0.0))
    # Fresnel's equations in their textbook form.
    s = (1.333 * cosine - beyond) / (1.333 * cosine + beyond)
    p = (cosine - 1.333 * beyond) / (cosine + 1.333 * beyond)
    fresnel = np.where(beyond > 0.0, 0.5 * (s**2 + p**2), 1.0)
    a = np.exp(-k * depth / cosine)
    expected = water_color + (1.0 - fresnel) * a * (scenes.SKY_RADIANCE - water_color)
    error = np.abs(picture - expected)
    steep = np.abs(cosine[..., 0] - np.cos(np.radians(CRITICAL_ANGLE))) < 0.005  # half floats in the texture
    assert error[~steep].max() < 2e-3, error[~steep].max()


def test_thesis_shows_the_world_without_a_hole(renderer):
    """R1 never ends in total reflection: the whole surface shows the sky, by Schlick's term with |N.E|."""
    body = scenes.water(half_size=200.0, k=0.0, water_color=(0.0, 0.0, 0.0))
    scene = scenes.snapshot((), (), (), (body,), sky=scenes.constant_sky((1.0, 1.0, 1.0)))
    camera = scenes.look_at((0, 0, -1.5), (0, 3, 0.5), fov=1.2)
    picture = draw(renderer, scene, camera, use_exact_under_water=False)[..., 0]
    cosine = directions(camera)[..., 2]
    f = ((1.333 - 1.0) / (1.333 + 1.0)) ** 2
    surface = cosine > 0.05
    expected = 1.0 - (f + (1.0 - f) * (1.0 - cosine) ** 5.0)
    assert surface.mean() > 0.5
    np.testing.assert_allclose(picture[surface], expected[surface], atol=2e-3)


@pytest.mark.parametrize("exact", [False, True], ids=["thesis", "exact"])
def test_calm_surface_mirrors_what_is_under_water(renderer, exact):
    """Beyond the critical angle (or with q = 0): the picture of the scene turned upside down, fogged."""
    bed = scenes.grid_mesh(
        "bed", 65, 30.0, lambda x, y: -3.0 + 0.8 * np.sin(x) * np.cos(0.7 * y), scenes.checkered
    )
    upside_down = scenes.changed(
        bed,
        positions=bed.positions * np.float32([1, 1, -1]),
        normals=bed.normals * np.float32([1, 1, -1]),
    )
    sand = scenes.Material("sand", np.ones(3), use_color_attribute=True)
    color, k = np.array([0.1, 0.3, 0.2]), 0.15
    body = scenes.water(half_size=29.0, q=0.0, k=k, water_color=tuple(color))
    scene = scenes.snapshot((bed,), (sand,), (("bed", "sand", [np.eye(4)]),), (body,))
    camera = scenes.look_at((0, 0, -1.0), (0, 8, 0.5), fov=0.9)
    seen = draw(renderer, scene, camera, texture_size=512, fov_ext=2.0, use_exact_under_water=exact)[..., :3]
    turned = scenes.snapshot(
        (scenes.position_coded(upside_down),),
        (sand,),
        (("bed", "sand", [np.eye(4)]),),
        sky=scenes.constant_sky((1.0, 1.0, 1.0)),
    )
    # Positions up to 30 m do not fit the code: only those within 8 m are compared.
    place = scenes.decoded_positions(draw(renderer, turned, camera))
    colored = scenes.snapshot((upside_down,), (sand,), (("bed", "sand", [np.eye(4)]),))
    mirror = draw(renderer, colored, camera)[..., :3]
    distance = np.linalg.norm(place - (0, 0, -1.0), axis=-1)[..., None]
    a = np.exp(-k * distance)
    expected = color + a * (mirror - color)
    cosine = directions(camera)[..., 2]
    compared = (cosine > 0.08) & (cosine < 0.6) & (np.abs(place).max(axis=-1) < 7.5)
    assert compared.mean() > 0.05
    error = np.abs(seen - expected).max(axis=-1)[compared]
    assert np.mean(error > 0.05) < 0.05 and np.median(error) < 5e-3, (np.mean(error > 0.05), np.median(error))


# Fog.

FOG_VIEWS = {
    "perspective": scenes.look_at((4, -6, -1.0), (1, 0, -3)),
    "shifted lens": shifted_lens(scenes.look_at((4, -6, -1.0), (1, 0, -3)), 0.3, -0.2),
    "long clip range": scenes.look_at((4, -6, -1.0), (1, 0, -3), near=1e-3, far=1e5),
    "straight down": scenes.look_at((4, -6, -0.6), (4, -6, -3)),
    "orthographic": scenes.look_at((4, -6, -1.5), (2, -2, -5), ortho=2.0),
}


def coded_basin(waters=()):
    """The pond's bed, posts and crate, each texel's colour its position, under a white sky."""
    pond = scenes.pond()
    coded = scenes.Material("coded", np.ones(3), use_color_attribute=True)
    meshes, draws = [], []
    for i, (draw_call, matrix) in enumerate((d, m) for d in pond.draws for m in d.matrices):
        mesh = pond.meshes[draw_call.mesh]
        moved = mesh.positions @ matrix[:3, :3].T.astype(np.float32) + matrix[:3, 3].astype(np.float32)
        meshes.append(scenes.position_coded(replace(mesh, key=i, positions=moved.astype(np.float32))))
        draws.append((i, "coded", [np.eye(4)]))
    return scenes.snapshot(meshes, (coded,), draws, waters, sky=scenes.constant_sky((1.0, 1.0, 1.0)))


@pytest.mark.parametrize("camera", FOG_VIEWS.values(), ids=FOG_VIEWS)
def test_fog_is_the_formula_pixel_by_pixel(renderer, camera):
    """water_color + exp(-k d)(C - water_color), d to the point that the pixel's own colour tells."""
    color, k = np.array([0.02, 0.3, 0.15]), 0.35
    dry = draw(renderer, coded_basin(), camera)
    place = scenes.decoded_positions(dry)
    if cameras.is_orthographic(camera.projection):
        distance = -(place @ camera.view[2, :3] + camera.view[2, 3])
    else:
        distance = np.linalg.norm(place - cameras.eye_position(camera.view), axis=-1)
    expected = color + np.exp(-k * distance)[..., None] * (dry[..., :3] - color)
    waters = (scenes.water(waves=scenes.LAKE_WAVES, k=k, water_color=tuple(color)),)
    wet = coded_basin(waters)
    assert planned(wet, camera).bodies[0].side.side is Side.UNDER
    fogged = draw(renderer, wet, camera)
    near = np.abs(place).max(axis=-1) < 8.0  # the code's range
    in_view = near & (place[..., 2] < -0.5)
    assert in_view.mean() > 0.3
    error = np.abs(fogged[..., :3] - expected)[in_view]
    assert error.max() < 1e-3 and error.mean() < 5e-5, (error.max(), error.mean())
    assert np.all(fogged[..., 3] == 1.0)


@pytest.mark.parametrize("transparent", [False, True])
def test_where_nothing_is_drawn_the_picture_has_the_waters_colour(renderer, transparent):
    from lake_water_addon.render.frame import PassTimer
    from tests.gpu.glsl import read_texture

    scene = scenes.snapshot((), (), (), (scenes.water(k=0.0, water_color=(0.1, 0.2, 0.3)),))
    plan = planned(scene, scenes.look_at((0, 0, -1), (0, 1, -2)))
    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    renderer.draw_picture(plan, target, PassTimer(), transparent=transparent)
    picture = read_texture(target.colors[0])
    np.testing.assert_allclose(picture, np.broadcast_to([0.1, 0.2, 0.3, 1.0], picture.shape), atol=1e-6)


def test_other_water_is_seen_through_the_fog(renderer):
    """A red pond on the bottom sinks into the near one's colour with more attenuation."""
    color = np.array([0.0, 0.2, 0.1])
    own = scenes.water(k=0.1, water_color=tuple(color))
    red = {"k": 1000.0, "water_color": (0.8, 0.0, 0.0), "q": 100.0, "ior": 1.0}
    lower = replace(scenes.water((0, 6, -4), half_size=3.0, **red), key="lower")
    camera = scenes.look_at((0, 0, -1), (0, 6, -4))
    middle = (slice(55, 65), slice(75, 85))
    for k in (0.0, 0.1, 0.5):
        near = replace(own, settings=replace(own.settings, k=k))
        picture = draw(renderer, scenes.snapshot((), (), (), (near, lower)), camera)[middle][..., :3]
        distance = np.linalg.norm([0, 6, -3])
        expected = color + np.exp(-k * distance) * (np.array([0.8, 0.0, 0.0]) - color)
        np.testing.assert_allclose(picture.mean(axis=(0, 1)), expected, atol=0.01)


def test_fog_over_a_picture_of_someone_else(renderer):
    """As in Blender's viewport: depth of its own for the fog, with the other waters' surfaces in it."""
    from lake_water_addon.render.frame import PassTimer
    from tests.gpu.glsl import read_texture

    pond = pond_at()
    low = replace(scenes.water((3, -1, -2), half_size=2.0, waves=()), key="low")
    scene = replace(pond, version=-44, waters=(*pond.waters, low))
    plan = planned(scene, scenes.look_at((6, -9, -0.8), (2, -2, -2.0)))
    assert plan.immersed == 0 and plan.bodies[1].drawn
    expected = draw_plan(renderer, plan)
    timer = PassTimer()
    target = renderer.targets.get(("test, other", SIZE), SIZE, ("RGBA32F",))
    renderer.draw_picture(replace(plan, bodies=()), target, timer)
    renderer.draw_textures(plan, timer)
    renderer.draw_scene_depth(plan, timer, SIZE)
    with target.framebuffer.bind():
        renderer.draw_water(plan, timer, target.framebuffer, renderer.scene_depth(SIZE))
    picture = read_texture(target.colors[0])
    # The ground is lit as in the air here, as by Blender: compare where the other water is.
    other = np.abs(draw_plan(renderer, replace(plan, bodies=plan.bodies[:1])) - expected).max(axis=-1) > 0.02
    assert other.any(), "the other water is not in the picture"
    assert np.median(np.abs(expected - picture)[other].max(axis=-1)) < 1e-4


@pytest.mark.parametrize("use_caustics", [False, True])
def test_bottom_seen_under_water_is_lit_through_the_water(renderer, use_caustics):
    """Calm water: irradiance s.z (1 - F) exp(-k d) of the sun and all of the sky's, and fog to the eye."""
    albedo, depth, k, color = np.array([0.7, 0.5, 0.3]), 3.0, 0.25, np.array([0.02, 0.1, 0.08])
    bed = scenes.grid_mesh("bed", 2, 40.0, -depth)
    direction = np.array([0.5, -0.3, 0.8])
    sun = scenes.Sun(direction / np.linalg.norm(direction), np.array([3.0, 2.9, 2.6]))
    scene = scenes.snapshot(
        (bed,),
        (scenes.Material("sand", albedo),),
        (("bed", "sand", [np.eye(4)]),),
        (scenes.water(half_size=20.0, k=k, water_color=tuple(color)),),
        sun=sun,
    )
    camera = scenes.look_at((1, 2, -1), (1, 4, -3))
    picture = draw(renderer, scene, camera, use_caustics=use_caustics, use_shadows=use_caustics)
    sine = np.sqrt(1.0 - sun.direction[2] ** 2) / 1.333
    path = depth / np.sqrt(1.0 - sine**2)
    f = ((1.333 - 1.0) / (1.333 + 1.0)) ** 2
    passed = (1.0 - f) * (1.0 - (1.0 - sun.direction[2]) ** 5)
    light = sun.irradiance * sun.direction[2] * passed * np.exp(-k * path) / np.pi + scenes.SKY_RADIANCE
    distance = (depth - 1.0) / np.maximum(-directions(camera)[..., 2:], 1e-6)
    expected = color + np.exp(-k * distance) * (albedo * light - color)
    down = directions(camera)[..., 2] < -0.3
    assert down.mean() > 0.5
    np.testing.assert_allclose(picture[down][:, :3], expected[down], rtol=0.01)


# The surface cuts through the picture.


def forced(plan, side):
    """The plan of a picture that the surface cuts, as if all of it began on one side."""
    (body,) = plan.bodies
    if side is Side.AIR:
        seen = ViewSide(side, "forced", True, False)
        return replace(plan, bodies=(replace(body, side=seen, under=None),))
    seen = ViewSide(side, "forced", False, True)
    dry = {name: replace(getattr(body, name), drawn=False) for name in ("refraction", "reflection")}
    under = replace(body.under, heights=None)
    return replace(plan, bodies=(replace(body, side=seen, under=under, **dry),))


def heights_over_surface(plan, size=SIZE):
    """(h, w) m, of each pixel's point of the near plane over the grid's drawn surface."""
    (body,) = plan.bodies
    begin = plan.near_plane.point(pixel_centers(size)).reshape(-1, 3) - body.origin
    drawn = under_water.grid_height(body.body, body.packed_waves, begin[:, :2])
    return (begin[:, 2] - drawn).reshape(size[1], size[0])


def pond_at(time=1.0, resolution=129, **settings):
    pond = scenes.pond(**settings)
    body = replace(pond.waters[0], grid=(resolution, 30.0, 30.0, 0.0, 0.0))
    return replace(pond, time=time, waters=(body,))


def surface_at(scene, xy):
    """m: height of the drawn surface."""
    (body,) = planned(scene, scenes.look_at((*xy, 5), (0, 0, 0))).bodies
    return float(under_water.grid_height(body.body, body.packed_waves, np.array([xy], float))[0])


EYE = (6.0, -9.0)
CUTS = {
    "level": ((0, 0, 0.0), {}),
    "looking up": ((5.5, -8, 0.6), {"fov": 1.2}),
    "looking down": ((5.5, -8, -0.5), {"fov": 1.2}),
    "straight down": ((6, -9, -1), {}),
    "wide near plane": ((0, 0, 0.0), {"near": 0.6}),
    "near plane of 1 mm": ((0, 0, 0.0), {"near": 1e-3}),
    "orthographic": ((0, 0, 0.0), {"ortho": 3.0}),
}


def cutting_camera(scene, name, offset=0.0):
    """A camera whose near plane the surface cuts, in its middle but for `offset` parts of its height."""
    target, options = CUTS[name]
    z = surface_at(scene, EYE)
    for _ in range(8):  # the near plane's middle moves with the camera
        camera = scenes.look_at(
            (*EYE, z),
            np.add(target, (0, 0, z)) if target[2] == 0.0 else (*target[:2], z + target[2]),
            **options,
        )
        middle = under_water.near_plane(camera.view, camera.projection)
        point = middle.point(np.array([0.0, offset]))
        z += surface_at(scene, point[:2]) - point[2]
    return camera


@pytest.mark.parametrize("exact", [False, True], ids=["thesis", "exact"])
@pytest.mark.parametrize("name", CUTS)
def test_each_pixel_is_that_of_the_side_on_which_it_begins(renderer, name, exact):
    """Away from the meniscus, equal to rounding to the pictures of the same camera with one side forced."""
    scene = pond_at()
    plan = planned(scene, cutting_camera(scene, name), use_exact_under_water=exact)
    assert plan.bodies[0].side.side is Side.SPLIT
    over = heights_over_surface(plan)
    step = max(np.abs(np.diff(over, axis=i)).max() for i in (0, 1))
    split = draw_plan(renderer, plan)
    air, under = (draw_plan(renderer, forced(plan, side)) for side in (Side.AIR, Side.UNDER))
    for pure, mask in ((air, over > 4 * step), (under, over < -4 * step)):
        if name not in ("straight down", "near plane of 1 mm"):
            assert mask.mean() > 0.1
        differs = np.any(np.abs(split - pure) > 2e-6, axis=-1) & mask
        # In the air, what a coarse grid leaves uncovered of the bed at the shore is lit as under water.
        assert differs.sum() <= 0.001 * mask.sum(), f"{differs.sum()} pixels differ"
    # Near the line, the pixel of one of the sides, with more or less of the meniscus over it.
    line = np.append(0.5 * np.array(scene.waters[0].settings.water_color), 1.0)
    band = np.abs(over) <= 4 * step
    over_one = [
        np.all((split >= np.minimum(pure, line) - 1e-4) & (split <= np.maximum(pure, line) + 1e-4), axis=-1)
        for pure in (air, under)
    ]
    assert np.all(over_one[0] | over_one[1] | ~band)


@pytest.mark.parametrize("name", CUTS)
def test_no_pixel_is_left_out_where_the_surface_cuts(renderer, name):
    """With the sky left out, every pixel that begins under water, and the meniscus, has alpha 1."""
    from lake_water_addon.render.frame import PassTimer
    from tests.gpu.glsl import read_texture

    scene = pond_at()
    plan = planned(scene, cutting_camera(scene, name))
    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    renderer.draw_picture(plan, target, PassTimer(), transparent=True)
    picture = read_texture(target.colors[0])
    over = heights_over_surface(plan)
    step = max(np.abs(np.diff(over, axis=i)).max() for i in (0, 1))
    assert np.all(picture[..., 3][over < -step] == 1.0)
    assert np.all(np.abs(picture[..., 3][np.abs(over) < 0.3 * step] - 1.0) < 1e-6)


@pytest.mark.parametrize("name", ["level", "looking down", "wide near plane"])
def test_cut_by_a_mesh_is_that_by_the_grid(renderer, name):
    """The same surface as a mesh of the user's: the map of heights knows no grid."""
    grid = pond_at(resolution=129)
    sheet = scenes.grid_mesh("sheet", 129, 30.0)
    body = replace(grid.waters[0], grid=None, mesh="sheet")
    mesh = replace(grid, version=-41, meshes={**grid.meshes, "sheet": sheet}, waters=(body,))
    camera = cutting_camera(grid, name)
    assert planned(mesh, camera).bodies[0].side.side is Side.SPLIT
    error = np.abs(draw(renderer, mesh, camera) - draw(renderer, grid, camera)).max(axis=-1)
    assert error.mean() < 2e-3 and np.mean(error > 0.02) < 0.01, (error.mean(), np.mean(error > 0.02))


def test_edge_of_the_water_cuts_the_picture_too(renderer):
    """Beside a pond's rectangle, below its level: dry to the left of the edge, fogged to the right."""
    bed = scenes.grid_mesh("bed", 2, 40.0, -4.0)
    white = scenes.Material("white", np.ones(3))
    body = scenes.water(half_size=10.0, k=1000.0, water_color=(0.0, 0.5, 0.0))
    scene = scenes.snapshot((bed,), (white,), (("bed", "white", [np.eye(4)]),), (body,))
    camera = scenes.look_at((-10.0, 0.0, -1.0), (-10.0, 10.0, -2.0))
    plan = planned(scene, camera)
    assert plan.bodies[0].side.side is Side.SPLIT
    picture = draw_plan(renderer, plan)
    dry = draw(renderer, replace(scene, version=-42, waters=()), camera)
    np.testing.assert_array_equal(picture[:, :76], dry[:, :76])
    np.testing.assert_allclose(picture[:, 84:, :3], np.broadcast_to([0.0, 0.5, 0.0], (120, 76, 3)), atol=1e-6)


def test_part_of_a_cut_picture_is_that_of_the_whole(renderer):
    scene = pond_at()
    camera = cutting_camera(scene, "level")
    whole = draw(renderer, scene, camera)
    part = draw(renderer, scene, camera, size=(80, 60), window=(0.25, 0.25, 0.75, 0.75))
    error = np.abs(part - whole[30:90, 40:120]).max(axis=-1)
    assert error.mean() < 1e-3 and np.mean(error > 0.02) < 0.01, (error.mean(), np.mean(error > 0.02))


def test_cut_picture_elsewhere_in_the_world_is_the_same(renderer):
    scene = pond_at()
    camera = cutting_camera(scene, "level")
    here = draw(renderer, scene, camera)
    there = draw(renderer, *scenes.moved(scene, camera, (1e5, 2e5, -3e3)))
    error = np.abs(here - there).max(axis=-1)
    assert error.mean() < 1e-3 and np.mean(error > 0.02) < 0.005, (error.mean(), np.mean(error > 0.02))


# The dive.

DIVE_STEP = 0.004  # m a frame


def dive(scene, frames, tilt):
    """Cameras that sink through the waves, up or down; the near plane's middle crosses halfway."""
    z = surface_at(scene, EYE)
    for i in range(frames):
        height = z + (0.5 * (frames - 1) - i) * DIVE_STEP - 0.1 * np.sin(np.arctan(tilt))
        yield scenes.look_at((*EYE, height), (3, -4, height + 5.83 * tilt))


def kept_sides(one, other):
    """(in the air, under water): the pixels that begin there in both frames, away from the meniscus."""
    margin = 4 * max(np.abs(np.diff(over, axis=axis)).max() for over in (one, other) for axis in (0, 1))
    return (one > margin) & (other > margin), (one < -margin) & (other < -margin)


def blocks(picture, side=4):
    """Means of squares of pixels: fine patterns alias from frame to frame whatever the water does."""
    height, width = picture.shape[0] // side, picture.shape[1] // side
    return picture.reshape(height, side, width, side, -1).mean(axis=(1, 3)).squeeze()


@pytest.mark.parametrize("exact", [False, True], ids=["thesis", "exact"])
@pytest.mark.parametrize("tilt", [0.0, 0.5, -0.5], ids=["level", "looking up", "looking down"])
def test_dive_shows_no_flash_hole_or_jump(renderer, tilt, exact):
    """Through the crossing, with the waves running, what the line does not sweep changes as before and after.

    Hole: a pixel with alpha below 1. Jump: the mean change, from one frame to the next, of the pixels that
    keep their side is at most four times the median over the dive. Flash: 4 x 4 pixels that are brighter or
    darker than in both the frame before and the one after, by more than 0.2 and beyond the meniscus. (The
    waves' own glitter does so by 0.15.)
    """
    frames = 51
    pictures, overs, sides = [], [], []
    for i, camera in enumerate(dive(pond_at(), frames, tilt)):
        plan = planned(pond_at(time=1.0 + i / 240.0), camera, use_exact_under_water=exact)
        pictures.append(draw_plan(renderer, plan))
        overs.append(heights_over_surface(plan))
        sides.append(plan.bodies[0].side.side)
    assert sides[0] is Side.AIR and sides[-1] is Side.UNDER and Side.SPLIT in sides
    assert np.all(np.array(pictures)[..., 3] > 0.999), "a pixel was left at the clear colour"
    colors = np.array(pictures)[..., :3]
    changes, swept = [], []
    for i in range(1, frames):
        kept = kept_sides(overs[i - 1], overs[i])
        change = np.abs(colors[i] - colors[i - 1]).max(axis=-1)
        changes.append([change[mask].mean() if mask.sum() > 200 else np.nan for mask in kept])
        swept.append(1.0 - kept[0].mean() - kept[1].mean())
    assert max(swept) > 0.05, "the line never crossed the picture"
    for of_side, name in zip(np.array(changes).T, ("air", "water"), strict=True):
        usual, worst = np.nanmedian(of_side), np.nanargmax(of_side)
        assert of_side[worst] < 4.0 * usual + 2e-3, (
            f"in the {name}, frame {worst + 1} changes by {of_side[worst]:.4f}, usually {usual:.4f}"
        )
    small = np.array([blocks(picture) for picture in colors])
    for i in range(1, frames - 1):
        before, now, after = small[i - 1 : i + 2]
        beyond = np.maximum(now - np.maximum(before, after), np.minimum(before, after) - now).max(axis=-1)
        kept = np.logical_or.reduce(
            [
                a & b
                for a, b in zip(kept_sides(*overs[i - 1 : i + 1]), kept_sides(*overs[i : i + 2]), strict=True)
            ]
        )
        flashes = (beyond > 0.2) & (blocks(kept[..., None].astype(float)) == 1.0)
        assert not flashes.any(), f"frame {i}: {flashes.sum()} blocks flash, by {beyond[flashes].max():.2f}"


# Extremes, and what a frame makes.

EXTREMES = {
    "steep waves": {"settings": {"waves": scenes.STEEP_WAVES}},
    "k = 0": {"settings": {"k": 0.0}},
    "k = 1000": {"settings": {"k": 1000.0}},
    "q = 0": {"settings": {"q": 0.0}},
    "q = 100": {"settings": {"q": 100.0}},
    "ior = 1": {"settings": {"ior": 1.0}},
    "ior = 4": {"settings": {"ior": 4.0}},
    "tiny textures": {"texture_size": 16},
    "fov_ext = 1": {"fov_ext": 1.0},
    "straight up": {"camera": scenes.look_at((6, -9, -2), (6, -9, 3))},
    "straight down": {"camera": scenes.look_at((6, -9, -1), (6, -9, -3))},
    "orthographic up": {"camera": scenes.look_at((6, -9, -3), (0, 0, 3), ortho=5.0)},
    "orthographic level": {"camera": scenes.look_at((6, -9, 0), (0, 0, 0), ortho=20.0)},
    "orthographic from far behind": {
        "camera": scenes.look_at((6, -9, 2), (0, 0, 0), near=-900.0, ortho=20.0)
    },
    "near clip 1 um": {"camera": scenes.look_at((6, -9, 0.0), (0, 0, 0), near=1e-6)},
    "near clip 50 m": {"camera": scenes.look_at((50, -50, 20), (0, 0, 0), near=60.0)},
    "in a post": {"camera": scenes.look_at((0, 0, -1), (5, 5, 0))},
    "below the bottom": {"camera": scenes.look_at((1, 2, -6), (0, 0, 0))},
    "one cell": {"resolution": 2},
    "sun and caustics": {"use_caustics": True, "use_shadows": True, "use_glow": True},
}


@pytest.mark.parametrize("exact", [False, True], ids=["thesis", "exact"])
@pytest.mark.parametrize("case", EXTREMES.values(), ids=EXTREMES)
def test_no_pixel_is_undefined_at_the_extremes(renderer, case, exact):
    """Finite, not negative, not brighter than the light (steep waves excepted: the sum has no such bound)."""
    case = dict(case)
    scene = pond_at(resolution=case.pop("resolution", 129), **case.pop("settings", {}))
    own = case.pop("camera", None)
    for camera in (
        (own,) if own else (scenes.look_at((6, -9, -0.8), (0, 0, 0)), cutting_camera(scene, "level"))
    ):
        picture = draw(renderer, scene, camera, use_exact_under_water=exact, **case)
        assert np.isfinite(picture).all(), f"{np.sum(~np.isfinite(picture))} undefined values"
        assert picture.min() >= 0.0
        assert picture[..., :3].max() <= 12.0 * np.max(scenes.SKY_RADIANCE + 3.0 / np.pi)
        assert np.all(picture[..., 3] > 0.999)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_every_technique_can_be_cut_and_dived_from(renderer, technique):
    """Their shaders of both sides compile together; under water they are one."""
    scene = pond_at()
    camera = cutting_camera(scene, "level")
    if planned(scene, camera, technique=technique).bodies[0].side.side is not Side.SPLIT:  # it has no waves
        camera = scenes.look_at((*EYE, 0.0), (0, 0, 0.0))
    plan = planned(scene, camera, technique=technique)
    assert plan.bodies[0].side.side is Side.SPLIT
    picture = draw_plan(renderer, plan)
    over = heights_over_surface(plan)
    step = max(np.abs(np.diff(over, axis=i)).max() for i in (0, 1))
    for side, mask in ((Side.AIR, over > 4 * step), (Side.UNDER, over < -4 * step)):
        pure = draw_plan(renderer, forced(plan, side))
        differs = np.any(np.abs(picture - pure) > 2e-6, axis=-1) & mask
        assert mask.mean() > 0.1 and differs.sum() <= 0.001 * mask.sum()


def test_diving_makes_nothing_after_the_first_frame_of_each_side(renderer):
    """Textures, buffers and shaders of both sides are kept, for a camera that bobs at the surface."""
    scene = pond_at()
    cameras_of_it = [
        scenes.look_at((6, -9, 1), (0, 0, 0)),
        cutting_camera(scene, "level"),
        scenes.look_at((6, -9, -1), (0, 0, -1)),
    ]
    for camera in cameras_of_it:
        draw(renderer, scene, camera)
    renderer.resources.reset_counts()
    for camera in cameras_of_it:
        draw(renderer, scene, camera)
    assert dict(renderer.resources.made) == {}


def test_state_is_put_back(renderer):
    """Blend, depth test and scissor as before a frame that uses all of them."""
    import gpu

    scene = pond_at()
    before = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    draw(renderer, scene, cutting_camera(scene, "level"))
    assert (gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()) == before


def test_textures_from_below_of_a_deleted_body_are_freed(renderer):
    scene = pond_at()
    draw(renderer, scene, cutting_camera(scene, "level"))
    names = {("refraction from below", 0), ("reflection from below", 0), ("surface heights", 0)}
    assert names <= renderer.targets.keys()
    draw(renderer, replace(scene, version=-43, waters=()), scenes.look_at((6, -9, 1), (0, 0, 0)))
    assert not names & renderer.targets.keys()
