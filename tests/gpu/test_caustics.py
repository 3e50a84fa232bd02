# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons and caustics on the GPU: closed forms, energy, the three ways to sum, and the float64 twin.

Bottoms are given as light depth textures made here, so that nothing else has a part in what is measured.
"""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, caustics, optics, waves
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.waves import SineWave
from tests.gpu import scenes
from tests.gpu.glsl import data_texture, read_texture
from tests.light_window import N12, SUNS, ground_depths, lattice, on_plane, plane_depths, unit, window

METHODS = ("CPU", "GPU_POINTS", "GPU_COMPUTE")
HALF = 2.0**-10
"""Relative step of half floats, which the caustics are kept in: llvmpipe cuts off what is beyond."""

RESOLUTIONS = ((96, 64), (100, 256), (256, 100), (256, 256), (16, 700), (250, 30))
STEEP = (SineWave(0.3, 1.2, 0.3), SineWave(0.2, 0.7, 2.0))  # ak = 1.6 and 1.8

pytestmark = pytest.mark.usefixtures("gpu")


@pytest.fixture(scope="module")
def painter(renderer):
    from lake_water_addon.render.passes.caustics import CausticsPainter
    from lake_water_addon.render.passes.water import WaterPainter

    water = WaterPainter(renderer.resources, renderer.library, renderer.scene)
    return CausticsPainter(renderer.resources, renderer.library, renderer.targets, water)


class SunlitWater:
    """A planned body of water whose light has the window and the bottom that a test wants."""

    def __init__(
        self,
        renderer,
        painter,
        *,
        sun=SUNS["oblique"],
        size=8.0,
        depth=2.0,
        slope=(0.0, 0.0),
        ground=None,
        of=scenes.LAKE_WAVES,
        surface=None,
        resolution=129,
        photons=128,
        texels=128,
        steps=1,
        light_texels=128,
        **optics_of,
    ) -> None:
        """ground: height of the bottom as a function of x, y; else a plane. surface: a mesh of the user's."""
        from lake_water_addon.render import uniforms
        from lake_water_addon.render.uniforms import UniformBlock

        body = scenes.water(resolution=resolution, waves=of, **optics_of)
        meshes = [scenes.grid_mesh("bed", 2, 40.0, -4.0)]
        if surface is not None:
            meshes.append(surface)
            body = replace(body, grid=None, mesh=surface.key)
        scene = scenes.snapshot(
            meshes,
            [scenes.Material("sand", np.full(3, 0.5))],
            [("bed", "sand", [np.eye(4)])],
            [body],
            sun=scenes.Sun(unit(sun), np.ones(3)),
        )
        settings = FrameSettings(photon_size=photons, caustics_size=texels, caustics_steps=steps)
        self.plan = plan_frame(scene, scenes.look_at((0, -8, 8), (0, 0, 0)), settings)
        planned = self.plan.bodies[0]
        self.camera = window(sun, size, light_texels)
        self.body = replace(planned, light=replace(planned.light, camera=self.camera))
        self.depths = (
            plane_depths(self.camera, depth, slope) if ground is None else ground_depths(self.camera, ground)
        )
        self.light_depth = data_texture(self.depths)
        renderer.upload(self.plan)
        members = (
            uniforms.lights(self.plan),
            uniforms.water(self.plan, self.body),
            uniforms.water_light(self.plan, self.body),
        )
        self.blocks = [UniformBlock(renderer.resources).update(*values) for values in members]
        self._painter = painter

    def photons(self, shadow_depth=None):
        """The photon map, drawn: a Target, and its two textures as arrays."""
        target = self._painter.photon_target(self.plan.settings.photon_size)
        self._painter.draw_photons(
            target, self.body, self.plan.origin, self.blocks, self.light_depth, shadow_depth
        )
        return target, *(read_texture(texture) for texture in target.colors)

    def sums(self, photons, method):
        """(texels, texels) float64 sums of light."""
        texels = self.plan.settings.caustics_size
        raw = read_texture(self._painter.light_sums(photons, texels, method)).astype(np.float64)[..., 0]
        if method != "GPU_COMPUTE":
            return raw
        lower, upper = raw.reshape(2, texels, texels)
        return (lower + 2.0**32 * upper) / 2.0**31

    def values(self, photons, method):
        """(texels, texels) the caustics."""
        target = self._painter.target(0, self.plan.settings.caustics_size)
        self._painter.sum_photons(photons, target, method)
        return read_texture(target.colors[0])[..., 0]

    def twin(self) -> caustics.PhotonScene:
        settings, frame = self.body.body.settings, self.plan.settings
        return caustics.PhotonScene(
            sun_direction=self.plan.snapshot.sun.direction,
            camera=self.camera,
            depth=self.depths,
            origin=self.body.origin,
            packed_waves=self.body.packed_waves,
            k=settings.k,
            q=settings.q,
            n12=1.0 / settings.ior,
            photons=frame.photon_size,
            steps=frame.caustics_steps,
        )


@pytest.fixture
def sunlit(renderer, painter):
    return lambda **options: SunlitWater(renderer, painter, **options)


def uneven(x, y):
    """A bottom with boulders that rises out of the water in one corner, and has an island."""
    island = 2.6 * np.exp(-((x - 1.0) ** 2 + (y - 0.5) ** 2) / 0.5)
    return -2.2 + 0.4 * (x + y) + 0.2 * np.sin(3.0 * x) * np.cos(2.0 * y) + island


def calm_light(sun, depth, k=0.5, q=5.0):
    """(1 - F) exp(-k d)."""
    cosine = unit(sun)[2]
    fresnel = optics.schlick(cosine, optics.reflectance_at_normal(N12), q)
    return (1.0 - fresnel) * np.exp(-k * depth / -window(sun).direction[2])


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
def test_calm_water_over_a_level_bottom_gives_the_closed_form(sunlit, sun, photons, texels):
    """In every texel, whatever the resolutions: sums to 3e-5, and the texture as half floats round them.

    Single precision knows a place in the window to 1e-5 of a texel, exp(-k d) to 5e-6 here, and 1 - F to
    4e-7: of the 0.005 that a grazing sun leaves of it, that is another 8e-5.
    """
    water = sunlit(sun=sun, of=(), photons=photons, texels=texels)
    target, found, spread = water.photons()
    want = calm_light(sun, 2.0)
    bound = 3e-5 + 4e-7 / calm_light(sun, 0.0)
    np.testing.assert_allclose(found[..., :2].reshape(-1, 2), lattice(photons), atol=2e-7)
    np.testing.assert_allclose(spread, 1.0 / photons, rtol=1e-5)
    assert (found[..., 3] == 1.0).all()
    for method in METHODS:
        value = caustics.resolved(water.sums(target, method), spread[..., 0] > 0.0)
        np.testing.assert_allclose(value, want, rtol=bound, err_msg=method)
        np.testing.assert_allclose(water.values(target, method), want, rtol=HALF + bound, err_msg=method)


@pytest.mark.parametrize("of", [(), scenes.LAKE_WAVES, STEEP], ids=["calm", "lake", "steep"])
@pytest.mark.parametrize("sun", ["above", "oblique", "low"])
def test_all_light_is_on_the_bottom_or_dropped(sunlit, sun, of):
    """Photons in = light on the bottom + photons dropped + what of their tents lies beyond the window.

    Asked for: 0.1 %. What is left is single precision's, 3e-5.
    """
    water = sunlit(sun=SUNS[sun], of=of, ground=uneven, photons=160, texels=128)
    target, found, spread = water.photons()
    found, spread = found.astype(float), spread.astype(float)
    flux = (128 / 160) ** 2
    wet, landed = spread[..., 0] > 0.0, found[..., 3] > 0.5
    assert 0.3 < wet.mean() < 0.95 and np.all(wet[landed])
    incoming = flux * found[wet, 2].sum()
    dropped = flux * found[wet & ~landed, 2].sum()
    inside = 1.0
    half = caustics.tent_spread(spread[landed], 128, 0.8)
    for axis in (0, 1):
        center = found[landed, axis] * 128
        parts = (caustics.tent_before((edge - center) / half[:, axis]) for edge in (128.0, 0.0))
        inside = inside * (next(parts) - next(parts))
    dropped += flux * np.sum(found[landed, 2] * (1.0 - inside))
    assert incoming > 100.0 and 0.0 < dropped < 0.3 * incoming
    for method in METHODS:
        on_the_bottom = water.sums(target, method).sum()
        assert on_the_bottom + dropped == pytest.approx(incoming, rel=3e-5), method


@pytest.mark.parametrize(("photons", "texels"), [(128, 128), (64, 200), (200, 64), (16, 700)])
def test_three_ways_give_one_result(sunlit, photons, texels):
    """Sums to 2e-5, relative and absolute (rounding of places and of sums); textures to a half's step."""
    water = sunlit(ground=uneven, photons=photons, texels=texels)
    target, *_ = water.photons()
    sums = {method: water.sums(target, method) for method in METHODS}
    values = {method: water.values(target, method) for method in METHODS}
    assert np.std(sums["CPU"]) > 0.1 and np.any(values["CPU"] == 0.0)
    for method in METHODS[1:]:
        np.testing.assert_allclose(sums[method], sums["CPU"], rtol=2e-5, atol=2e-5, err_msg=method)
        np.testing.assert_allclose(values[method], values["CPU"], rtol=1.1 * HALF, atol=5e-5, err_msg=method)


def test_counting_gives_the_same_bits_in_every_run(sunlit):
    water = sunlit(ground=uneven, photons=200)
    first = None
    for _ in range(5):
        target, *maps = water.photons()
        got = (*maps, water.sums(target, "GPU_COMPUTE"), water.values(target, "GPU_COMPUTE"))
        first = first or got
        for one, other in zip(first, got, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("photons", "texels"), [(100, 150), (200, 64), (64, 64)])
@pytest.mark.parametrize("method", METHODS)
def test_texture_is_what_the_twin_makes_of_the_same_photons(sunlit, method, photons, texels):
    """But for texels of which rounding decides whether water covers them, and for those beside them."""
    water = sunlit(ground=uneven, photons=photons, texels=texels)
    target, found, spread = water.photons()
    wet = spread[..., 0] > 0.0
    want = caustics.resolved(caustics.sum_photons(found, spread, texels), wet)
    assert (want == 0.0).mean() > 0.05
    spacing = texels / photons
    part = caustics.coverage(wet.astype(float), texels) / caustics.whole_coverage(texels, spacing)
    close = np.abs(part - caustics.MIN_COVERAGE) < 1e-4
    decided = ~close
    for dx, dy in caustics.neighbors(spacing):
        decided &= ~np.roll(close, (dy, dx), (0, 1))
    assert decided.mean() > 0.98
    got = water.values(target, method)
    np.testing.assert_allclose(got[decided], want[decided], rtol=1.1 * HALF, atol=5e-5)


SURFACES = {"grid": {"resolution": 513}, "coarse grid": {"resolution": 49}, "mesh": {}}


@pytest.mark.parametrize("sun", ["above", "oblique"])
@pytest.mark.parametrize("kind", SURFACES)
def test_photons_are_those_of_the_twin(sunlit, sun, kind):
    """Launched on the twin's own waves: to 1/100 of a photon's distance, and light to 1 %.

    The grid of 49 has cells of 1.2 m, longer than the shortest wave: there 99 of 100 to 1/5 and 2 %.
    """
    surface = scenes.grid_mesh("sheet", 257, 12.0) if kind == "mesh" else None
    water = sunlit(sun=SUNS[sun], surface=surface, slope=(0.1, 0.05), **SURFACES[kind])
    _, found, spread = water.photons()
    twin, uv = water.twin(), lattice(128)
    level, run = np.zeros((len(uv), 2)), caustics.sun_run(twin.sun_direction)
    point, wave = on_plane(water.camera, uv, 0.0), np.zeros(len(uv))
    for _ in range(5):
        at = caustics.on_waves(point, wave, level, twin.origin, twin.packed_waves, run)
        point, wave = at.position, at.position[:, 2]
    want = caustics.photon(at, np.zeros((len(uv), 2, 2)), uv, twin)
    assert np.linalg.norm(want.landing - uv, axis=1).max() * 128 > 1.0
    found, spread = found.reshape(-1, 4), spread.reshape(-1, 2)
    part, apart, light = (0.99, 0.2, 0.02) if kind == "coarse grid" else (0.999, 0.01, 0.01)
    for got, of_twin in ((found[:, :2], want.landing), (spread, want.spread)):
        assert np.quantile(np.abs(got - of_twin).max(axis=1) * 128, part) < apart
    assert np.quantile(np.abs(found[:, 2] / want.light - 1.0), part) < light
    assert np.mean((found[:, 3] > 0.5) == want.landed) > 0.99


def test_caustics_do_not_show_the_grid(sunlit):
    """A grid of 49 over 60 m, coarser than the waves, against one of 1025: they differ by 1 % of the mean."""
    drawn = []
    for resolution in (49, 1025):
        water = sunlit(resolution=resolution, photons=256, texels=256)
        drawn.append(water.values(water.photons()[0], "GPU_COMPUTE"))
    assert np.std(drawn[1]) > 0.3 * np.mean(drawn[1])
    assert np.mean(np.abs(drawn[0] - drawn[1])) < 0.01 * np.mean(drawn[1])


def test_few_photons_are_as_good_as_many(sunlit):
    """Against 16 times as many, in a texture of 256: no dots (median), and lines as bright (its top 1 %)."""
    many = sunlit(photons=1024, texels=256)  # 16 times 256
    reference = many.values(many.photons()[0], "GPU_COMPUTE").astype(float)
    for photons, median, brightest in ((128, 0.02, 0.15), (256, 0.004, 0.05), (512, 0.0015, 0.015)):
        water = sunlit(photons=photons, texels=256)
        value = water.values(water.photons()[0], "GPU_COMPUTE").astype(float)
        assert np.median(np.abs(value - reference)) < median * reference.mean()
        lines = [np.quantile(image, 0.99) for image in (value, reference)]
        assert abs(lines[0] / lines[1] - 1.0) < brightest
        assert value.mean() == pytest.approx(reference.mean(), rel=1e-3)


def test_a_sine_wave_focuses_at_its_focal_depth(sunlit):
    """Under a sun straight above, at the depth n / ((n - 1) a k^2) below a crest, and sharpest there.

    A crest of z = a cos(k x) has, near x = 0, the slope -a k^2 x. There the surface is tilted by as much
    (small angles), a vertical ray meets it at the angle a k^2 x and goes on at 1 / n of it from the
    normal: it is turned by (1 - 1/n) a k^2 x towards the crest's axis, and crosses it at the depth
    x / ((1 - 1/n) a k^2 x) = n / ((n - 1) a k^2), whatever x.

    At t times that depth, neighbouring photons on the axis are |1 - t| as far apart as they were. Above the
    focus that makes the line 1 / (1 - t) as bright as calm water. The slope of a sine grows less than x does:
    rays further out meet the axis deeper, and below the focus the line opens into two.
    """
    amplitude, wavelength, n = 0.01, 1.0, 1.333
    focus = n / ((n - 1.0) * amplitude * (2.0 * np.pi / wavelength) ** 2)
    assert 10.0 < focus < 10.3
    brightest = {}
    for part in (0.25, 0.5, 0.8, 1.0, 1.3, 1.7):
        water = sunlit(
            sun=SUNS["above"],
            size=4.0,
            depth=part * focus,
            of=(SineWave(amplitude, wavelength, 0.0, 0.0),),
            k=0.0,
            photons=512,
            texels=512,
        )
        target, _, spread = water.photons()
        phase = water.body.packed_waves[0, 3]
        crest = (0.25 - phase / (2.0 * np.pi) + 0.5) % 1.0 - 0.5  # in wavelengths, the one nearest to x = 0
        column = int((0.5 + crest * wavelength / 4.0) * 512)
        on_axis = spread[256, column - 2 : column + 3, 0].min() * 512
        assert on_axis == pytest.approx(abs(1.0 - part), abs=0.02), part
        row = water.values(target, "GPU_COMPUTE")[128:-128].mean(axis=0) / calm_light(SUNS["above"], 0.0)
        brightest[part] = row[128:-128].max()
        if part < 1.0:
            assert row[column - 1 : column + 2].max() == brightest[part]
            assert brightest[part] == pytest.approx(1.0 / (1.0 - part), rel=0.05), part
    assert max(brightest, key=brightest.get) == 1.0, brightest


def test_photons_that_miss_the_window_are_dropped(sunlit):
    """A surface that slopes sends all photons aside. None of them gathers at the border."""
    tilted = scenes.grid_mesh("sheet", 65, 30.0, lambda x, y: 0.15 * x)
    water = sunlit(sun=SUNS["above"], of=(), surface=tilted, depth=6.0, k=0.0)
    target, found, _ = water.photons()
    missed = found[..., 3] < 0.5
    assert 0.02 < missed.mean() < 0.2
    outside = np.any((found[..., :2] < 0.0) | (found[..., :2] >= 1.0), axis=-1)
    np.testing.assert_array_equal(missed, outside)
    for method in METHODS:
        value = water.values(target, method)
        inner = np.median(value[:, 64])
        assert value.max() < 1.1 * inner, method
        assert value[:, -1].max() < 0.05 * inner or value[:, 0].max() < 0.05 * inner


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sun", SUNS)
def test_extremes_give_finite_caustics(sunlit, sun, method):
    """Waves steeper than water can be, no bottom at all, a bottom above the water; clear water."""
    for options in (
        {"of": STEEP, "steps": 4},
        {"of": STEEP, "k": 0.0, "ground": lambda x, y: 0.2 * np.sin(x) - 0.1},
        {"depth": 1e5},
        {"depth": -1.0},
        {"of": STEEP, "ior": 1.0},
        {"of": (SineWave(5.0, 0.5),), "q": 0.0},
    ):
        water = sunlit(sun=SUNS[sun], photons=64, texels=64, **options)
        target, found, spread = water.photons()
        assert np.isfinite(found).all() and np.isfinite(spread).all()
        assert found[..., 2].min() >= 0.0 and found[..., 2].max() <= 1.0
        value = water.values(target, method)
        assert np.isfinite(value).all() and value.min() >= 0.0
        if abs(options.get("depth", 0.0)) > 0.5:
            assert not value.any()


def test_higher_waves_shade_those_behind_them(sunlit):
    """A photon's light is that of the first point in its ray of a low sun, here found by marching along it.

    98 of 100 to 0.02; at the edges of the shade the drawn mesh decides.
    """
    wave = SineWave(0.25, 2.0, 0.0, 0.0)  # 0.79 at its steepest; the rays descend by 0.35
    water = sunlit(sun=(-1.0, 0.0, 0.35), of=(wave,), k=0.0, resolution=1025, size=6.0)
    _, found, _ = water.photons()
    twin = water.twin()
    run, packed = caustics.sun_run(twin.sun_direction), twin.packed_waves
    start = on_plane(water.camera, lattice(128), 0.0)
    height = np.full(len(start), 0.3)
    for down in np.linspace(0.3, -0.3, 6001):
        reached = waves.height(packed, (start + height[:, None] * run)[:, :2]) >= height
        height = np.where(reached, height, down)
    normal = waves.normal(packed, (start + height[:, None] * run)[:, :2])
    fresnel = optics.schlick(normal @ twin.sun_direction, optics.reflectance_at_normal(N12), 5.0)
    apart = np.abs(found[..., 2].ravel() - (1.0 - fresnel))
    assert np.ptp(fresnel) > 0.3
    assert np.mean(apart < 0.02) > 0.98, np.quantile(apart, [0.5, 0.9, 0.98])


def test_what_stands_in_the_sun_takes_the_photons_light(sunlit):
    """Shadow textures that are nearer to the sun than all water on one side of the middle of the lake."""
    water = sunlit()
    depths = []
    for camera in water.plan.shadows:
        middle = camera.resolution * cameras.to_texture(camera.projection, np.zeros((1, 3)))[0, 0]
        nearer = np.arange(camera.resolution) < middle
        depths.append(np.tile(np.where(nearer, -1e5, 1e5), (camera.resolution, 1)))
    depth = np.concatenate(depths)
    _, lit, _ = water.photons()
    _, found, spread = water.photons(shadow_depth=data_texture(depth))
    part = found[..., 2] / lit[..., 2]
    np.testing.assert_array_equal(found[..., :2], lit[..., :2])
    assert ((part == 0.0) | (part > 0.999)).mean() > 0.9
    assert 0.1 < (part == 0.0).mean() < 0.9 and (spread > 0.0).all()


@contextmanager
def made_maps(found, spread):
    """A photon map that was not drawn."""
    from lake_water_addon.render.targets import Target

    colors = (data_texture(found), data_texture(spread, pixel_format="RG32F"))
    yield Target(found.shape[1::-1], None, colors, None)


@pytest.mark.parametrize(("photons", "texels"), [(64, 64), (64, 150), (96, 40)])
def test_shores_between_tiles_are_found(sunlit, photons, texels):
    """Along the border of a tile of photons, and around single ones, in reach of its neighbours."""
    water = sunlit(photons=photons, texels=texels)
    found = np.random.default_rng(1).uniform(0.2, 1.0, (photons, photons, 4)).astype(np.float32)
    found[..., :2] = lattice(photons).reshape(photons, photons, 2)
    for first in (31, 32, 33):
        wet = np.zeros((photons, photons), bool)
        wet[:, first:], wet[16, 15], wet[20, 50] = True, True, False
        found[..., 3] = wet
        spread = np.where(wet[..., None], np.float32([1.0 / photons, 1.0 / photons]), np.float32([0.0, 0.0]))
        want = caustics.resolved(caustics.sum_photons(found, spread, texels), wet)
        with made_maps(found, spread) as target:
            got = water.values(target, "GPU_COMPUTE")
        np.testing.assert_allclose(got, want, rtol=1.1 * HALF, atol=5e-5)


@pytest.mark.parametrize(("photons", "texels"), [(200, 1000), (16, 2000), (200, 10)])
def test_all_photons_on_one_texel_overflow_no_counter(sunlit, photons, texels):
    """As if waves were a lens: all light of the window, up to 2 million times what 32 bits hold."""
    water = sunlit(photons=photons, texels=texels)
    middle = (texels // 2 + 0.5) / texels
    found = np.broadcast_to(np.float32([middle, middle, 1.0, 1.0]), (photons, photons, 4))
    spread = np.full((photons, photons, 2), 1e-9, np.float32)
    with made_maps(found, spread) as target:
        sums = water.sums(target, "GPU_COMPUTE")
    assert sums[texels // 2, texels // 2] == pytest.approx(texels**2, rel=1e-6)
    assert sums.sum() == pytest.approx(texels**2, rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_the_same_textures_serve_every_frame(sunlit, renderer, method):
    """Nothing is made in the second frame; with CPU one texture, for there is no way to write into one."""
    water = sunlit()
    water.values(water.photons()[0], method)
    renderer.resources.reset_counts()
    water.values(water.photons()[0], method)
    assert dict(renderer.resources.made) == ({"textures": 1} if method == "CPU" else {})


@pytest.mark.parametrize("method", METHODS)
def test_state_is_left_as_it_was(sunlit, gpu, method):
    water = sunlit()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("GREATER")
    gpu.state.depth_mask_set(False)
    try:
        water.values(water.photons()[0], method)
        assert gpu.state.blend_get() == "ALPHA"
        assert gpu.state.depth_test_get() == "GREATER" and gpu.state.depth_mask_get() is False
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")


def test_methods_that_a_machine_lacks_give_way_with_a_reason(gpu, monkeypatch):
    from lake_water_addon.render.passes.caustics import chosen_method

    assert chosen_method("AUTO").name == "GPU_COMPUTE" and "fastest" in chosen_method("AUTO").reason
    for method in METHODS:
        assert chosen_method(method).name == method
    monkeypatch.setattr(gpu.platform, "backend_type_get", lambda: "METAL")
    assert chosen_method("AUTO").name == "GPU_POINTS"
    assert chosen_method("GPU_COMPUTE").name == "GPU_POINTS"
    assert "Metal" in chosen_method("GPU_COMPUTE").reason
    assert chosen_method("CPU").name == "CPU"
    with pytest.raises(ValueError, match="GPU_POINTS"):
        chosen_method("MAGIC")
