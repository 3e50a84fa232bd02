# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets: when they are made, kept and freed."""

import gc
import weakref

import pytest

KEY = ("a",)


@pytest.fixture
def targets(gpu):
    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.targets import Targets

    return Targets(Resources())


def get(targets, side):
    return targets.get(KEY, (side, side), ("R16F",))


def test_another_size_is_made_anew_and_the_old_one_freed(targets):
    resources = targets._resources
    first = weakref.ref(get(targets, 8))
    assert get(targets, 8) is first()
    get(targets, 16)
    gc.collect()
    assert first() is None
    made = resources.made["textures"]
    get(targets, 8)
    assert resources.made["textures"] > made


def test_spares_are_taken_again_and_the_oldest_are_freed(targets):
    resources = targets._resources
    targets.spares = 2
    by_side = {side: weakref.ref(get(targets, side)) for side in (8, 16, 32)}
    made = resources.made["textures"]
    for side in (8, 16, 32, 16, 8):
        target = get(targets, side)
        assert target is by_side[side]()
        assert target.size == (side, side)
    assert resources.made["textures"] == made
    del target
    get(targets, 64)
    gc.collect()
    assert [side for side, target in by_side.items() if target() is None] == [32]
    targets.free_spares()
    gc.collect()
    assert all(target() is None for target in by_side.values())
    assert get(targets, 64).size == (64, 64)


def test_a_discarded_name_keeps_no_spares(targets):
    targets.spares = 2
    known = [weakref.ref(get(targets, side)) for side in (8, 16)]
    targets.discard(KEY)
    gc.collect()
    assert [target() for target in known] == [None, None]
    assert targets.keys() == set()


def test_a_size_that_no_device_holds_is_refused_and_the_old_target_stays(targets):
    from lake_water_addon.render.targets import TargetError

    first = get(targets, 8)
    with pytest.raises(TargetError, match="cannot be drawn"):
        get(targets, 10**6)
    assert get(targets, 8) is first
