# SPDX-License-Identifier: GPL-3.0-or-later
"""The glow in the picture: where the mirror's geometry puts it, and hidden by what is nearer."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, glow, optics, view_transform
from lake_water_addon.core.plan import pixel_jitter
from lake_water_addon.core.snapshot import Sun
from tests.gpu import scenes
from tests.gpu.glsl import read_texture
from tests.gpu.pictures import draw_plan, planned

SIZE = (640, 480)
VIEW = scenes.look_at((0, -16, 5), (0, -3, 0), size=SIZE)


def sun_at(elevation, azimuth=90.0):
    e, a = np.radians([elevation, azimuth])
    return Sun(np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]), np.array([3.0, 2.9, 2.6]))


def lake(sun, waves=(), things=(), half_size=30.0, resolution=129):
    """Water, and boxes at places over it: (half extents, matrix) each."""
    boxes = [scenes.box_mesh(f"box {i}", extents) for i, (extents, _) in enumerate(things)]
    draws = [(box.key, "red", [matrix]) for box, (_, matrix) in zip(boxes, things, strict=True)]
    red = scenes.Material("red", np.array([0.8, 0.0, 0.0]))
    body = scenes.water(half_size=half_size, resolution=resolution, waves=waves, k=1000.0)
    return scenes.snapshot(boxes, (red,), draws, (body,), sun=sun)


THESIS = {"glow_strength": 1.0, "glow_exponent": 200.0, "glow_threshold": 0.0}
"""The whole of the thesis's highlight."""


def glowing(scene, camera=VIEW, **options):
    return planned(scene, camera, **{"use_glow": True, **THESIS, **options})


def added(renderer, scene, camera=VIEW, size=SIZE, **options):
    """(h, w, 3) what the glow adds to the picture."""
    on = draw_plan(renderer, glowing(scene, camera, **options), size)
    off = draw_plan(renderer, planned(scene, camera, **options), size)
    np.testing.assert_array_equal(on[..., 3], off[..., 3])
    return (on - off)[..., :3]


def texture_of(renderer, name, plan):
    """(h, w) the texels that were drawn last, of "highlights" or "star"."""
    from lake_water_addon.render.passes.glow import highlight_target, star_target

    texture = {"highlights": highlight_target, "star": star_target}[name](renderer.targets).colors[0]
    width, height = plan.glow.size
    return read_texture(texture)[:height, :width, 0].astype(np.float64)


def texel_rays(plan, size):
    """Origins and unit directions (h, w, 3), in render space, of the texels' middles."""
    width, height = plan.glow.size
    x, y = np.meshgrid(2 * (np.arange(width) + 0.5) / width - 1, 2 * (np.arange(height) + 0.5) / height - 1)
    inverse = np.linalg.inv(plan.glow.drawn_projection(size) @ plan.camera.view)
    ends = []
    for z in (-1.0, 0.5):
        point = np.stack([x, y, np.full_like(x, z), np.ones_like(x)], -1) @ inverse.T
        ends.append(point[..., :3] / point[..., 3:])
    direction = ends[1] - ends[0]
    return ends[0], direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def flat_highlights(plan, size):
    """(h, w) highlights of flat water by the closed form, and which texels see it, well inside its border."""
    origin, direction = texel_rays(plan, size)
    along = -origin[..., 2] / np.where(direction[..., 2] < 0.0, direction[..., 2], 1.0)
    at = origin + along[..., None] * direction
    half = plan.bodies[0].body.grid[1]
    distance = half - np.abs(at[..., :2]).max(axis=-1)
    sees = (direction[..., 2] < 0.0) & (distance > 0.0)
    reflected = optics.reflect_direction(direction, cameras.UP)
    sun = plan.snapshot.sun.direction
    values = glow.highlight(reflected, sun, plan.settings.glow_exponent, plan.glow.cut)
    return np.where(sees, values, 0.0), np.abs(distance) > 0.5


@pytest.mark.parametrize(
    ("camera", "sun"),
    [
        (VIEW, sun_at(20.0)),
        (VIEW, sun_at(32.0, 80.0)),
        (scenes.look_at((3, -16, 1), (0, 0, 0.5), size=SIZE), sun_at(3.0)),
        (scenes.look_at((0, 0, 9), (0, 0, 0), size=SIZE), sun_at(90.0)),
        (scenes.look_at((0, -40, 20), (0, 0, 0), size=SIZE, ortho=25.0), sun_at(28.0)),
    ],
    ids=["ahead", "aside", "low", "straight above", "orthographic"],
)
@pytest.mark.parametrize("exponent", [200.0, 3000.0])
def test_highlight_of_flat_water(renderer, camera, sun, exponent):
    """Every texel, but at the water's edge, to what a half float holds; the star is the twin's of it."""
    plan = glowing(lake(sun), camera, glow_exponent=exponent)
    assert plan.glow.drawn
    draw_plan(renderer, plan, SIZE)
    got = texture_of(renderer, "highlights", plan)
    want, decided = flat_highlights(plan, SIZE)
    assert want.max() > 0.3
    # At the cut, half floats and the rounding of R.s decide.
    decided &= np.abs(want - plan.glow.cut) > 0.02 * plan.glow.cut
    np.testing.assert_allclose(got[decided], want[decided], rtol=2e-3, atol=1e-6)
    star = texture_of(renderer, "star", plan)
    np.testing.assert_allclose(star, glow.star_filter(got), rtol=2e-3, atol=1e-6)


def test_the_glow_is_where_the_mirror_puts_it(renderer):
    """The middle of what is added, in pixels, against the ray that flat water mirrors into the sun."""
    sun = sun_at(25.0, 80.0)
    light = added(renderer, lake(sun, half_size=200.0), glow_exponent=2000.0)[..., 0]
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    middle = np.array([np.sum(light * x), np.sum(light * y)]) / light.sum()
    mirror = sun.direction * (1, 1, -1)
    eye = cameras.eye_position(VIEW.view)
    point = eye + mirror * (eye[2] / -mirror[2])
    where = cameras.to_texture(VIEW.projection, VIEW.view[:3, :3] @ point + VIEW.view[:3, 3]) * SIZE
    np.testing.assert_allclose(middle, where, atol=0.6)  # the lobe is wider towards the far side
    peak = np.unravel_index(np.argmax(light), light.shape)[::-1]
    np.testing.assert_allclose(np.array(peak) + 0.5, where, atol=3.0)


def test_what_is_added_is_the_highlight_times_colour_and_strength(renderer):
    """An orthographic view of flat water that mirrors the sun everywhere: (1, 1, 0.8) times the strength."""
    camera = scenes.look_at((0, -20, 20), (0, 0, 0), size=SIZE, ortho=30.0)
    light = added(renderer, lake(sun_at(45.0), half_size=60.0), camera, glow_strength=3.0)
    np.testing.assert_allclose(light, np.broadcast_to([3.0, 3.0, 2.4], light.shape), rtol=2e-3)


def meets_box(origin, direction, half_extents, matrix):
    """(...,) distance along the rays to an upright box, infinite where they miss it."""
    with np.errstate(divide="ignore"):
        sides = [(matrix[:3, 3] + s * np.array(half_extents) - origin) / direction for s in (-1, 1)]
    enters = np.minimum(*sides).max(axis=-1)
    return np.where(enters < np.maximum(*sides).min(axis=-1), enters, np.inf)


def test_things_that_are_nearer_hide_the_highlight_and_those_behind_do_not(renderer):
    """Ray by ray: a box in front of the sun's image, one behind it, and one that stands in it."""
    things = [
        ((1.0, 0.2, 0.6), scenes.translation(-0.9, -9.0, 2.0)),
        ((9.0, 0.5, 9.0), scenes.translation(0, 20.0, 0.0)),
        ((0.3, 0.3, 2.0), scenes.translation(1.2, -4.0)),
    ]
    plan = glowing(lake(sun_at(20.0), things=things))
    draw_plan(renderer, plan, SIZE)
    got = texture_of(renderer, "highlights", plan)
    # A texel asks the pixel that its middle lies in.
    width, height = plan.glow.size
    scale, offset = plan.glow.to_texels(SIZE)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixel = np.floor((np.stack([x, y], -1) - offset) / scale * SIZE)
    inside = np.all((pixel >= 0) & (pixel < SIZE), axis=-1)
    device = 2.0 * (pixel + 0.5) / SIZE - 1.0
    rays = np.stack([device[..., i] / VIEW.projection[i, i] for i in (0, 1)] + [-np.ones_like(x)], -1)
    rays, eye = rays @ VIEW.view[:3, :3], cameras.eye_position(VIEW.view)
    to_water = np.where(rays[..., 2] < 0.0, -eye[2] / np.minimum(rays[..., 2], -1e-9), np.inf)
    to_things = np.min([meets_box(eye, rays, *box) for box in things], axis=0)
    hidden = to_things < to_water
    want, decided = flat_highlights(plan, SIZE)
    decided &= inside & (np.abs(want - plan.glow.cut) > 0.02 * plan.glow.cut)
    assert np.sum(decided & hidden & (want > 0.3)) > 1000
    wrong = decided & (np.abs(got - np.where(hidden, 0.0, want)) > 2e-3 * want + 1e-6)
    # Where they go into the water, a pixel of them and the water next to it are equally far.
    with np.errstate(invalid="ignore"):
        water_line = np.abs(to_things - to_water) < 0.02 * to_water
    assert np.sum(wrong & ~water_line) <= 5 and wrong.sum() < 200, (np.sum(wrong & ~water_line), wrong.sum())


@pytest.fixture
def nothing_near(renderer):
    """The depth texture of a picture of nothing."""
    target = renderer.targets.get(("test far",), SIZE, ("R16F",))
    with target.framebuffer.bind():
        target.framebuffer.clear(depth=1.0)
    return target.depth


def test_waves_do_not_hide_their_own_highlight(renderer, nothing_near):
    """Compared with a depth texture that holds nothing: but for the edges of the crests, all is there."""
    for camera in (VIEW, scenes.look_at((0, -16, 1), (0, 0, 0), size=SIZE)):
        plan = glowing(lake(sun_at(15.0), scenes.LAKE_WAVES), camera, glow_exponent=20.0)
        draw_plan(renderer, plan, SIZE)
        got = texture_of(renderer, "highlights", plan)
        renderer.draw_star(plan, nothing_near)
        want = texture_of(renderer, "highlights", plan)
        assert np.mean(want > 0.0) > 0.4
        lost = np.mean((got == 0.0)[want > 0.0])
        assert lost < 0.03, lost


def test_water_that_the_sun_does_not_reach_has_no_highlight(renderer):
    """A roof out of the picture, between the water and the sun: its shadow is the hole in the sun's image."""
    roof = ((30.0, 3.0, 0.2), scenes.translation(0.0, 12.0, 7.0))
    bed = ((40.0, 40.0, 0.1), scenes.translation(0.0, 0.0, -3.0))
    scene = lake(sun_at(25.0), things=[roof, bed])
    light = {}
    for shadows in (False, True):
        plan = glowing(scene, use_shadows=shadows)
        draw_plan(renderer, plan, SIZE)
        light[shadows] = texture_of(renderer, "highlights", plan)
    origin, direction = texel_rays(plan, SIZE)
    at = origin - (origin[..., 2] / np.minimum(direction[..., 2], -1e-9))[..., None] * direction
    to_sun = scene.sun.direction
    # Where the ray to the sun passes the roof's lower and upper side.
    passes = [at[..., 1] + z / to_sun[2] * to_sun[1] - 12.0 for z in (6.8, 7.2)]
    shaded = (passes[1] > -2.8) & (passes[0] < 2.8)
    lit = (passes[1] < -4.0) | (passes[0] > 4.0)
    bright = light[False] > 0.01
    assert np.sum(bright & shaded) > 300 and np.sum(bright & lit) > 300
    assert np.all(light[True][shaded] == 0.0)
    np.testing.assert_allclose(light[True][lit], light[False][lit], rtol=2e-3)


def test_water_of_a_mesh_glows_as_that_of_the_grid(renderer):
    grid = lake(sun_at(20.0), scenes.LAKE_WAVES, resolution=257)
    sheet = scenes.grid_mesh("sheet", 257, 30.0)
    body = replace(grid.waters[0], grid=None, mesh="sheet")
    mesh = replace(grid, version=-11, meshes={**grid.meshes, "sheet": sheet}, waters=(body,))
    one, other = added(renderer, grid), added(renderer, mesh)
    assert one.max() > 0.5
    np.testing.assert_allclose(one, other, atol=0.02)


# What is not drawn


def nothing_of_it(scene, camera, **options):
    """The picture with the glow switched on, by a renderer of its own that must make nothing for it."""
    from lake_water_addon.render.frame import FrameRenderer, PassTimer

    made, pictures = [], []
    for use_glow in (False, True):
        fresh, timer = FrameRenderer(), PassTimer()
        plan = planned(scene, camera, use_glow=use_glow, **THESIS, **options)
        assert not plan.glow.drawn
        target = fresh.targets.get(("test",), SIZE, ("RGBA32F",))
        fresh.draw_picture(plan, target, timer)
        assert "glow" not in timer.seconds
        assert not any(key[0] == "glow" for key in fresh.targets.keys())
        made.append(dict(fresh.resources.made))
        pictures.append(read_texture(target.colors[0]))
    assert made[0] == made[1]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    "scene",
    [lake(sun_at(20.0, -90.0), scenes.LAKE_WAVES), lake(sun_at(-3.0)), lake(None, scenes.LAKE_WAVES)],
    ids=["sun behind", "sun set", "no sun"],
)
def test_a_glow_that_cannot_be_costs_nothing(gpu, scene):
    nothing_of_it(scene, VIEW)


def test_a_camera_under_water_sees_no_glow(gpu):
    nothing_of_it(lake(sun_at(20.0)), scenes.look_at((0, -6, -1), (0, 0, -1), size=SIZE))


def test_the_next_frame_makes_nothing_and_leaves_the_state_as_it_was(renderer):
    import gpu as gpu_module

    state = gpu_module.state
    plan = glowing(lake(sun_at(20.0), scenes.LAKE_WAVES))
    draw_plan(renderer, plan, SIZE)
    renderer.resources.reset_counts()
    before = state.blend_get(), state.depth_test_get(), state.depth_mask_get(), state.viewport_get()
    draw_plan(renderer, plan, SIZE)
    assert not renderer.resources.made
    # Another size of the picture, as of a second viewport, makes nothing of the glow's own either.
    other = glowing(plan.snapshot, scenes.look_at((0, -16, 5), (0, -3, 0), size=(120, 200)))
    renderer.targets.get(("test", (120, 200)), (120, 200), ("RGBA32F",))
    renderer.resources.reset_counts()
    draw_plan(renderer, other, (120, 200))
    assert not renderer.resources.made
    assert before == (state.blend_get(), state.depth_test_get(), state.depth_mask_get(), state.viewport_get())


# Extremes


@pytest.mark.parametrize(
    "sun",
    [sun_at(90.0), sun_at(89.9), sun_at(1e-4), sun_at(0.5), sun_at(0.0), None],
    ids=["zenith", "near the zenith", "grazing", "low", "on the horizon", "none"],
)
@pytest.mark.parametrize("waves", [(), scenes.STEEP_WAVES], ids=["flat", "steep"])
def test_no_sun_and_no_wave_breaks_the_picture(renderer, sun, waves):
    scene = lake(sun, waves)
    for camera in (
        VIEW,
        scenes.look_at((0, -16, 0.01 + 1.1 * bool(waves)), (0, 0, 0.5), size=SIZE),
        scenes.look_at((0, 0, 9), (0, 0, 0), size=SIZE),
        scenes.look_at((0, 0, 9), (0, 0, 0), size=SIZE, ortho=20.0),
    ):
        for exponent in (1.0, 1e5):
            plan = glowing(scene, camera, glow_exponent=exponent, glow_strength=1000.0)
            picture = draw_plan(renderer, plan, SIZE)
            assert np.isfinite(picture).all() and picture.min() >= 0.0
            if plan.glow.drawn:
                star = texture_of(renderer, "star", plan)
                assert np.isfinite(star).all() and star.min() >= 0.0 and star.max() <= 1.001


# Borders and antialiasing


@pytest.mark.parametrize("waves", [(), scenes.LAKE_WAVES], ids=["flat", "waves"])
def test_a_border_render_is_that_part_of_the_whole(renderer, waves):
    """Through the middle of the sun's image, aligned with neither the lattice nor the texture.

    The depth beyond the border is not known: where something dry stands there, the arms of a star may differ
    within three texels. Here nothing does, and all is the same, but for a crest that hides a texel or two
    next to the border, 1/13 each.
    """
    scene = lake(sun_at(20.0), waves)
    whole = added(renderer, scene)
    left, bottom, right, top = 183, 195, 407, 347
    window = (left / SIZE[0], bottom / SIZE[1], right / SIZE[0], top / SIZE[1])
    part = added(renderer, scene, size=(right - left, top - bottom), window=window)
    assert part.max() > 0.3 and part[0].max() > 0.05
    error = np.abs(part - whole[bottom:top, left:right])
    assert np.quantile(error, 0.995) < 2e-3 and error.max() < 2 / 13, (np.quantile(error, 0.995), error.max())


def test_what_stands_beyond_the_border_matters_only_next_to_it(renderer):
    """A wall from the border on hides highlights of the whole picture that the part cannot know of."""
    wall = ((4.0, 0.2, 5.0), scenes.translation(3.6, -9.0))
    scene = lake(sun_at(20.0), scenes.LAKE_WAVES, [wall])
    whole = added(renderer, scene)
    left, right = 180, 287  # the wall begins a few pixels further
    part = added(renderer, scene, size=(right - left, 480), window=(left / 640, 0.0, right / 640, 1.0))
    assert whole[:, left:right].max() > 0.3
    error = np.abs(part - whole[:, left:right]).max(axis=(0, 2))
    assert error[-3:].max() > 0.01, "the wall hides nothing that would reach into the part"
    assert error[:-6].max() < 0.02, error  # 5 texels of 0.83 pixels, and one of rounding


def test_the_star_is_as_large_at_any_resolution(renderer):
    """A picture of half the size: what is added is the mean of the other's pixels, but for the filter."""
    scene = lake(sun_at(20.0), scenes.LAKE_WAVES)
    large = added(renderer, scene, size=(1280, 960))
    small = added(renderer, scene, size=SIZE)
    mean = large.reshape(480, 2, 640, 2, 3).mean(axis=(1, 3))
    assert small.max() > 0.3
    assert np.abs(small - mean).mean() < 0.05 * mean.mean() + 1e-3
    assert abs(small.mean() - mean.mean()) < 0.02 * mean.mean()


@pytest.mark.parametrize("jitter", [(0.5, 0.5), (-0.5, 0.3)])
def test_antialiasing_moves_the_glow_with_the_picture(renderer, jitter):
    """Though the highlights are drawn with a shift of up to half a texel, 1.25 pixels here."""
    size = (960, 720)
    scene = lake(sun_at(25.0), half_size=200.0)
    middles = []
    for shift in ((0.0, 0.0), jitter):
        device = (2.0 * shift[0] / size[0], 2.0 * shift[1] / size[1])
        light = added(renderer, scene, size=size, jitter=device, glow_exponent=3000.0)[..., 0]
        y, x = np.mgrid[0 : size[1], 0 : size[0]]
        middles.append(np.array([np.sum(light * x), np.sum(light * y)]) / light.sum())
    np.testing.assert_allclose(middles[1] - middles[0], jitter, atol=0.06)


def test_antialiasing_takes_the_mean_over_a_texel(renderer, nothing_near):
    """Glints smaller than a texel, far away, as the view turns by parts of one: they twinkle less."""
    scene = lake(sun_at(20.0), scenes.LAKE_WAVES, half_size=240.0, resolution=513)
    energy = {1: [], 8: []}
    for step in range(5):
        camera = scenes.look_at((0, -200, 40), (0.11 * step, 0, 0), size=SIZE)
        for samples, found in energy.items():
            total = 0.0
            for sample in range(samples):
                jitter = pixel_jitter(sample, samples, *SIZE)
                plan = glowing(scene, camera, jitter=jitter, glow_exponent=20000.0)
                renderer.upload(plan)
                renderer.draw_star(plan, nothing_near)
                total += texture_of(renderer, "highlights", plan).sum() / samples
            found.append(total)
    spread = {samples: np.std(found) / np.mean(found) for samples, found in energy.items()}
    assert spread[1] > 0.02
    assert spread[8] < 0.6 * spread[1], spread


# Display colours


def test_added_in_display_colours(renderer):
    """With a view transform that only clips, the overlay gets what the linear picture gets, up to there."""
    size, lattice = view_transform.SIZE, view_transform.lattice_range()
    values = np.clip(view_transform.lattice_values(lattice), 0.0, 1.0) ** (1 / 2.2)
    table = np.ones((size, size, size, 4), np.float32)
    table[..., 2], table[..., 1], table[..., 0] = np.meshgrid(values, values, values, indexing="ij")
    plan = glowing(lake(sun_at(20.0), scenes.LAKE_WAVES), glow_exponent=2000.0, glow_strength=4.0)
    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    draw_plan(renderer, plan, SIZE)
    star = renderer.draw_star(plan, target.depth)
    pictures = []
    for transform in (None, (table_texture(table), lattice)):
        with target.framebuffer.bind():
            target.framebuffer.clear(color=(0.1, 0.2, 0.3, 0.5))
            renderer.add_glow(plan, star, transform)
        pictures.append(read_texture(target.colors[0]).astype(np.float64) - (0.1, 0.2, 0.3, 0.5))
    linear, display = pictures
    assert linear[..., :3].max() > 0.5
    np.testing.assert_allclose(display[..., :3], np.minimum(linear[..., :3], 0.82), atol=0.02)
    assert np.all(np.abs(display[..., 3]) < 1e-6) and np.all(np.abs(linear[..., 3]) < 1e-6)
    dark = np.abs(linear[..., 0]) < 1e-6
    assert dark.any() and np.all(np.abs(display[dark]) < 1e-6)


def table_texture(table):
    """A filtered 3D texture."""
    from gpu.types import Buffer, GPUTexture

    texture = GPUTexture(
        table.shape[2::-1], format="RGBA32F", data=Buffer("FLOAT", table.size, table.ravel())
    )
    texture.filter_mode(True)
    texture.extend_mode("EXTEND")
    return texture
