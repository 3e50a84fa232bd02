# SPDX-License-Identifier: GPL-3.0-or-later
"""How a technique's own settings reach the shader: each in its place, and moving maps with all digits."""

import re
from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lake_water_addon.core.technique_pond import PondSettings
from lake_water_addon.core.technique_ripple import RippleSettings
from lake_water_addon.core.technique_settings import MAX_VALUES, TechniqueSettings, pack, scrolled
from lake_water_addon.core.technique_simple_lake import SimpleLakeSettings

SHADERS = Path(__file__).resolve().parents[2] / "lake_water_addon" / "gpu_shaders"
TECHNIQUES = {"pond": PondSettings, "ripple": RippleSettings, "simple_lake": SimpleLakeSettings}
NOT_FOR_THE_SHADER = {"geometric_waves", "flow_direction", "flow_speed", "velocity_0", "velocity_1"}
"""What the plan reads, or what reaches the shader as the distance moved."""

every_technique = pytest.mark.parametrize(("name", "kind"), TECHNIQUES.items(), ids=TECHNIQUES)


def defined_values(name):
    """Name in lower case -> (index, components) of the `#define`s of a technique's file."""
    text = (SHADERS / f"technique_{name}_lib.glsl").read_text()
    found = re.findall(
        rf"#define {name.upper()}_(\w+) technique\.values\[(\d+)\](?:\.(\w+))?$", text, re.MULTILINE
    )
    return {symbol.lower(): (int(index), len(swizzle or "xyzw")) for symbol, index, swizzle in found}


@every_technique
def test_the_shader_reads_each_setting_where_it_lies(name, kind):
    defined = defined_values(name)
    settings = kind()
    for i, field in enumerate(fields(kind)):
        if field.name in NOT_FOR_THE_SHADER:
            assert field.name not in defined
        else:
            assert defined.pop(field.name) == (i, np.size(getattr(settings, field.name))), field.name
    moved = settings.moving(0.0)
    assert defined == ({"moved": (len(fields(kind)), np.size(moved))} if moved else {})


@every_technique
def test_packed_in_order(name, kind):
    rows = pack(kind(), 3.0)
    assert rows.shape[1] == 4 and len(rows) <= MAX_VALUES
    values = [getattr(kind(), field.name) for field in fields(kind)] + list(kind().moving(3.0))
    for row, value in zip(rows, values, strict=True):
        numbers = np.atleast_1d(np.asarray(value, float))
        np.testing.assert_array_equal(row[: len(numbers)], numbers)
        np.testing.assert_array_equal(row[len(numbers) :], 0.0)


def test_switches_are_one_and_zero():
    assert pack(PondSettings(geometric_waves=True))[19, 0] == 1.0
    assert pack(PondSettings(geometric_waves=False))[19, 0] == 0.0


def test_more_values_than_the_shader_takes_are_refused():
    @dataclass(frozen=True)
    class Long(TechniqueSettings):
        def moving(self, time):
            return ((time,),) * (MAX_VALUES + 1)

    with pytest.raises(ValueError, match="Long has 25 values, the shader takes 24"):
        pack(Long())


@pytest.mark.parametrize("time", [0.0, 1.0, 1e6, -3e5])
def test_a_scrolled_map_keeps_its_digits(time):
    """1e-9 of a tile after 11 days."""
    velocity, tile = (0.15, -0.06), 2.7
    moved = scrolled(velocity, time, tile)
    for part, speed in zip(moved, velocity, strict=True):
        assert 0.0 <= part <= 1.0
        exact = Fraction(speed) * Fraction(time) / Fraction(tile) % 1
        assert abs((part - float(exact) + 0.5) % 1.0 - 0.5) < 1e-9
