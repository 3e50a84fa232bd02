# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons and their sums: against rays followed one by one, finite differences, and sums in plain loops."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import caustics, optics, waves
from lake_water_addon.core.waves import SineWave
from tests.light_window import N12, SUNS, lattice, on_plane, plane_depths, unit, window

LAKE = (
    SineWave(0.026, 3.65, 0.80, 3.6),
    SineWave(0.020, 2.83, 1.24, 0.1),
    SineWave(0.012, 1.69, -0.99, 1.8),
    SineWave(0.007, 0.99, 1.69, 4.8),
    SineWave(0.003, 0.44, -1.44, 0.9),
)
every_sun = pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
RESOLUTIONS = ((96, 64), (64, 96), (100, 256), (256, 100), (128, 128), (30, 200), (200, 10))


def scene(sun=SUNS["oblique"], depth=3.0, slope=(0.0, 0.0), of=LAKE, photons=64, steps=1):
    camera = window(sun)
    return caustics.PhotonScene(
        sun_direction=unit(sun),
        camera=camera,
        depth=plane_depths(camera, depth, slope),
        origin=np.zeros(3),
        packed_waves=waves.pack(of, 0.7, 5.0),
        k=0.5,
        q=5.0,
        n12=N12,
        photons=photons,
        steps=steps,
    )


def launched(of, uv=None, error=0.0):
    """Points of the surface on the sun's rays of photons, and where those are launched: (WaterPoint, uv).

    error: m, how far the mesh that the search begins with may be from the waves.
    """
    uv = lattice(of.photons) if uv is None else uv
    run = caustics.sun_run(of.sun_direction)
    wave = np.random.default_rng(1).uniform(-error, error, len(uv))
    point = on_plane(of.camera, uv, 0.0) + wave[:, None] * run
    level = np.zeros((len(uv), 2))
    return caustics.on_waves(point, wave, level, of.origin, of.packed_waves, run), uv


def photons_of(found, uv, of):
    """Photons on a surface whose mesh is level."""
    return caustics.photon(found, np.zeros((len(uv), 2, 2)), uv, of)


@pytest.mark.parametrize(
    ("sun", "height", "slope"), [("above", 1e-9, 1e-9), ("oblique", 1e-3, 0.01), ("low", 0.01, 0.1)]
)
def test_the_surface_is_found_from_a_coarse_grid(sun, height, slope):
    """On the ray, and on the waves to `height` m, though the grid's edges are further apart than a wave."""
    of = scene(SUNS[sun])
    found, uv = launched(of, error=0.04)
    from_start = found.position - on_plane(of.camera, uv, 0.0)
    run = caustics.sun_run(of.sun_direction)
    np.testing.assert_allclose(from_start, from_start[:, 2:] * run, atol=1e-12)
    apart = np.abs(found.position[:, 2] - waves.height(of.packed_waves, found.position[:, :2]))
    turned = np.abs(found.slope - waves.slope(of.packed_waves, found.position[:, :2]))
    assert apart.max() < height and turned.max() < slope, (apart.max(), turned.max())
    assert np.median(apart) < 0.1 * height and np.median(turned) < 0.1 * slope


def test_derivatives_of_the_waves():
    """Against central differences of 1 mm."""
    packed = waves.pack(LAKE, 0.3, 5.0)
    xy = np.random.default_rng(2).uniform(-20, 20, (200, 2))
    at = caustics.waves_at(packed, xy)
    np.testing.assert_allclose(at.height, waves.height(packed, xy), atol=1e-12)
    np.testing.assert_allclose(at.slope, waves.slope(packed, xy), atol=1e-12)
    for axis in (0, 1):
        step = 1e-3 * np.eye(2)[axis]
        change = (waves.slope(packed, xy + step) - waves.slope(packed, xy - step)) / 2e-3
        turn = caustics.bend(at.curvature, np.broadcast_to(step, xy.shape)) / 1e-3
        np.testing.assert_allclose(turn, change, atol=1e-4)


@every_sun
def test_launching_places_are_a_texel_apart_on_the_plane(sun):
    of = scene(sun)
    uv = np.full((1, 2), 0.3)
    for axis in (0, 1):
        step = caustics.launch_step(of.camera, axis, of.photons)
        moved = on_plane(of.camera, uv + np.eye(2)[axis] / of.photons, 0.0)
        np.testing.assert_allclose(moved - on_plane(of.camera, uv, 0.0), step[None], atol=1e-12)


@pytest.mark.parametrize("sun", [SUNS["above"], SUNS["oblique"], SUNS["low"]])
def test_spread_is_the_derivative_of_the_ray(sun):
    """At a given length, against rays 1/100 of a photon's distance to either side: 1 % of that distance.

    Those begin on the waves, found with ten times the steps that the search takes.
    """
    of = scene(sun, of=LAKE[:3])
    run = caustics.sun_run(of.sun_direction)
    uv = lattice(of.photons)
    way = np.random.default_rng(5).uniform(0.0, 6.0, len(uv))

    def on_surface(at):
        start, height = on_plane(of.camera, at, 0.0), np.zeros(len(at))
        for _ in range(60):
            height = waves.height(of.packed_waves, (start + height[:, None] * run)[:, :2])
        return start + height[:, None] * run

    def end_of_ray(at):
        position = on_surface(at)
        normal = waves.normal(of.packed_waves, position[:, :2])
        incident = np.broadcast_to(-of.sun_direction, normal.shape)
        return position + way[:, None] * optics.refract_direction(incident, normal, N12)[0]

    position = on_surface(uv)
    waves_there = caustics.waves_at(of.packed_waves, position[:, :2])
    point = caustics.WaterPoint(position, waves_there.slope, waves_there.curvature)
    for axis in (0, 1):
        step = caustics.launch_step(of.camera, axis, of.photons)
        spread = caustics.ray_spread(point, np.zeros((len(uv), 2)), way, step, of)
        aside = 0.01 * np.eye(2)[axis] / of.photons
        want = (end_of_ray(uv + aside) - end_of_ray(uv - aside)) / 0.02
        np.testing.assert_allclose(spread + step, want, atol=0.01 * np.linalg.norm(step))
        assert np.ptp(spread) > 0.3 * np.linalg.norm(step)


def test_spread_of_a_mesh_is_that_of_its_slope():
    """A mesh shaped like a wave, with no waves of its own, gives what the wave gives."""
    of = scene(of=LAKE[:1])
    found, uv = launched(of)
    waved = photons_of(found, uv, of)
    turn = np.empty((len(uv), 2, 2))
    for axis in (0, 1):
        step = caustics.launch_step(of.camera, axis, of.photons)
        run = caustics.sun_run(of.sun_direction)
        rise = found.slope @ step[:2] / (1.0 - found.slope @ run[:2])
        turn[:, axis] = caustics.bend(found.curvature, step[:2] + rise[:, None] * run[:2])
    level = replace(of, packed_waves=np.zeros((0, 4)))
    meshed = caustics.photon(found._replace(curvature=np.zeros((len(uv), 3))), turn, uv, level)
    for part in ("landing", "spread", "light"):
        np.testing.assert_allclose(getattr(meshed, part), getattr(waved, part), rtol=1e-9)


def test_no_edge_of_the_bottom_disturbs_the_spread():
    """A step in the bottom, 2 m high, between two photons."""
    of = scene(SUNS["above"], of=LAKE[:2])
    step = np.where(lattice(64)[:, 0] < 0.5, 0.0, 2.0).reshape(64, 64)
    found, uv = launched(of)
    photon = photons_of(found, uv, replace(of, depth=of.depth + step))
    assert photon.spread.max() < 3.0 / of.photons


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.2, -0.1)])
@every_sun
def test_calm_water_lets_light_straight_through(sun, slope):
    """Every photon lands where it is launched, spread by one photon's distance, with (1 - F) exp(-k d)."""
    of = scene(sun, 3.0, slope, ())
    found, uv = launched(of)
    photon = photons_of(found, uv, of)
    np.testing.assert_allclose(photon.landing, uv, atol=1e-9)
    np.testing.assert_allclose(photon.spread, 1.0 / of.photons, rtol=1e-9)
    way = np.linalg.norm(on_plane(of.camera, uv, 3.0, slope) - on_plane(of.camera, uv, 0.0), axis=1)
    fresnel = optics.schlick(of.sun_direction[2], optics.reflectance_at_normal(N12), 5.0)
    np.testing.assert_allclose(photon.light, (1.0 - fresnel) * np.exp(-0.5 * way), rtol=1e-9)
    assert caustics.is_water(found.position, of).all() and photon.landed.all()


@pytest.mark.parametrize(("steps", "bound"), [(1, 0.02), (4, 2e-3)])
def test_photons_land_where_their_rays_meet_the_bottom(steps, bound):
    """Over a slope: the ray's own intersection with the plane; bound in m."""
    of = scene(slope=(0.3, 0.1), steps=steps)
    found, uv = launched(of)
    photon = photons_of(found, uv, of)
    normal = np.concatenate([-found.slope, np.ones((len(uv), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ray, _ = optics.refract_direction(np.broadcast_to(-of.sun_direction, normal.shape), normal, N12)
    plane = np.array([-0.3, -0.1, 1.0])
    hit = found.position + ((-3.0 - found.position @ plane) / (ray @ plane))[:, None] * ray
    landing = 0.5 + 0.5 * (hit @ of.camera.view[:2, :3].T) * np.diag(of.camera.projection)[:2]
    apart = np.linalg.norm(photon.landing - landing, axis=1) * 8.0
    assert apart.max() < bound and np.linalg.norm(landing - uv, axis=1).max() * 8.0 > 0.1


def test_dry_ground_is_told_from_water():
    of = scene(SUNS["above"], 0.2, (0.0, 0.2), ())
    found, uv = launched(of)
    wet = on_plane(of.camera, uv, 0.2, (0.0, 0.2))[:, 2] <= 0.0
    assert 0.3 < wet.mean() < 0.9
    np.testing.assert_array_equal(caustics.is_water(found.position, of), wet)
    nothing = replace(of, depth=np.full((64, 64), 1e5))
    assert not caustics.is_water(found.position, nothing).any()


def test_photons_that_miss_do_not_land():
    of = scene(SUNS["above"], of=())
    found, uv = launched(of)
    aside = photons_of(found, uv + np.array([0.3, 0.0]), of)
    np.testing.assert_array_equal(aside.landed, uv[:, 0] + 0.3 < 1.0)
    assert not photons_of(found, uv, replace(of, depth=np.full((64, 64), 1e5))).landed.any()


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 10.0])
@every_sun
def test_steep_waves_give_finite_photons(sun, amplitude):
    of = scene(sun, of=(SineWave(amplitude, 1.0, 0.3), SineWave(amplitude, 0.3, 2.0)), steps=3)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        found, uv = launched(of)
        photon = photons_of(found, uv, of)
    assert all(np.isfinite(part).all() for part in (*found, *photon))
    assert np.all((photon.light >= 0.0) & (photon.light <= 1.0))


def test_bottom_is_exact_for_planes_and_keeps_its_edges():
    camera = window(SUNS["low"])
    uv = np.random.default_rng(3).uniform(0, 1, (500, 2))
    plane = scene(SUNS["low"], slope=(0.2, 0.3)).depth
    want = -(on_plane(camera, uv, 3.0, (0.2, 0.3)) @ camera.view[2, :3])
    np.testing.assert_allclose(caustics.bottom_depth(plane, uv, 0.125), want, rtol=1e-12)
    edge = np.where(lattice(64)[:, 1] < 0.5, 2.0, 5.0).reshape(64, 64)
    assert set(caustics.bottom_depth(edge, uv, 0.125)) == {2.0, 5.0}


def loops(photon_map, spread_map, size):
    """`sum_photons` as its definition has it, photon by photon in float64."""
    photons = len(photon_map)
    spacing = size / photons
    sums = np.zeros((size, size))
    for y, x in itertools.product(range(photons), repeat=2):
        u, v, light, landed = photon_map[y, x].astype(float)
        if landed < 0.5:
            continue
        half = np.clip(spread_map[y, x].astype(float) * size, min(0.25, spacing), max(8.0, spacing))
        parts = []
        for center, width in zip((u * size, v * size), half, strict=True):
            z = np.clip((np.arange(size + 1) - center) / width, -1.0, 1.0)
            before = np.where(z < 0.0, 0.5 * (1.0 + z) ** 2, 1.0 - 0.5 * (1.0 - z) ** 2)
            parts.append(np.diff(before))
        sums += light * spacing**2 * parts[1][:, None] * parts[0]
    return sums


def random_maps(photons, seed=4):
    """Photons all over the window and at its very border, of all widths; some lost, some dark."""
    rng = np.random.default_rng(seed)
    found = rng.uniform(0, 1, (photons, photons, 4)).astype(np.float32)
    found[:2, :, :2] = rng.choice([0.0, 1e-6, 0.5, 1.0 - 1e-6], (2, photons, 2))
    found[..., 3] = rng.random((photons, photons)) < 0.8
    found[-1, :, 2] = 0.0
    return found, (rng.uniform(0, 1, (photons, photons, 2)) ** 4).astype(np.float32)


@pytest.mark.parametrize(("chunk", "batch"), [(100, 400), (caustics.CHUNK, caustics.BATCH)])
@pytest.mark.parametrize(("photons", "texels"), [(24, 16), (16, 40), (20, 20), (12, 90), (4, 400)])
def test_sum_is_that_of_plain_loops(photons, texels, chunk, batch, monkeypatch):
    monkeypatch.setattr(caustics, "CHUNK", chunk)
    monkeypatch.setattr(caustics, "BATCH", batch)
    maps = random_maps(photons)
    np.testing.assert_allclose(
        caustics.sum_photons(*maps, texels),
        loops(*maps, texels),
        atol=2e-5 * max(1.0, texels / photons),
        rtol=2e-5,
    )


@pytest.mark.parametrize("photons", [1, 7])
def test_sum_of_no_photons_is_dark(photons):
    nothing = np.zeros((photons, photons, 4), np.float32), np.full((photons, photons, 2), 0.1, np.float32)
    assert not caustics.sum_photons(*nothing, 10).any()


def calm_maps(photons, light=0.7):
    """Photons that land where they are launched."""
    found = np.ones((photons, photons, 4), np.float32)
    found[..., :2] = lattice(photons).reshape(photons, photons, 2)
    found[..., 2] = light
    return found, np.full((photons, photons, 2), 1.0 / photons, np.float32)


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
def test_calm_water_gives_its_light_in_every_texel(photons, texels):
    """Whatever the resolutions, to the border: single precision knows a place to 1e-5 of a texel."""
    everywhere = np.ones((photons, photons), bool)
    value = caustics.resolved(caustics.sum_photons(*calm_maps(photons), texels), everywhere)
    np.testing.assert_allclose(value, 0.7, rtol=2e-5)


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
def test_calm_water_gives_its_light_up_to_the_shore(photons, texels):
    """And one photon beyond it, for the filter; there is none further away."""
    found, spread = calm_maps(photons)
    shore = 0.43 + 0.2 * np.sin(7.0 * found[..., 0])
    wet = found[..., 1] >= shore
    found[~wet, 3] = 0.0
    value = caustics.resolved(caustics.sum_photons(found, spread, texels), wet)
    lit = value > 0.0
    np.testing.assert_allclose(value[lit], 0.7, rtol=1e-4)
    x, y = lattice(texels).T.reshape(2, texels, texels)
    shore = 0.43 + 0.2 * np.sin(7.0 * x)
    pixel = 1.0 / min(photons, texels)
    assert lit[y > shore + 0.5 * pixel].all() and not lit[y < shore - 2.5 * pixel].any()


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
def test_all_light_is_on_the_bottom_or_dropped(photons, texels):
    found, spread = random_maps(photons)
    landed = found[..., 3] > 0.5
    half = caustics.tent_spread(spread[landed].astype(float), texels, texels / photons)
    inside = found[landed, 2].astype(float)
    for axis in (0, 1):
        center = found[landed, axis].astype(float) * texels
        beyond, before = (caustics.tent_before((edge - center) / half[:, axis]) for edge in (texels, 0.0))
        inside *= beyond - before
    flux = (texels / photons) ** 2
    sums = caustics.sum_photons(found, spread, texels).astype(float)
    assert sums.sum() == pytest.approx(flux * inside.sum(), rel=1e-5)


@pytest.mark.parametrize("spacing", [1.0 / 8.0, 0.3, 1.0, 1.3, 2.0, 7.5])
def test_what_a_texel_depends_on_is_within_the_margin(spacing):
    """A single dry photon changes no texel that lies further away from it, in light or in darkness."""
    photons = 48
    size = round(photons * spacing)
    spacing = size / photons
    margin = caustics.shore_margin(spacing)
    sums = np.random.default_rng(6).uniform(0.5, 1.0, (size, size))
    own = ((np.arange(size) + 0.5) / spacing).astype(int)
    for wet in (np.ones((photons, photons), bool), np.zeros((photons, photons), bool)):
        changed = wet.copy()
        changed[20, 27] = ~changed[20, 27]
        y, x = np.nonzero(caustics.resolved(sums, wet) != caustics.resolved(sums, changed))
        assert len(x) > 0 or spacing < 1.0
        assert np.all(np.abs(own[x] - 27) <= margin) and np.all(np.abs(own[y] - 20) <= margin)
