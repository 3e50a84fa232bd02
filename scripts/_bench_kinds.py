# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of frame that the benchmark draws, and which of them it compares. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lake_water_addon.core.techniques import TECHNIQUES

SHORE, TOWARD_SUN, UNDER, SPLIT = "shore", "toward the sun", "under water", "at the surface"
"""The cameras; `_bench_frames.make_cameras` places them."""


@dataclass(frozen=True)
class Kind:
    """settings: those of `FrameSettings` that are not the defaults; water: False for a scene without any."""

    label: str
    settings: Mapping[str, object] = field(default_factory=dict)
    view: str = SHORE
    water: bool = True


@dataclass(frozen=True)
class Ratio:
    """A time of the kind `over` by that of `under`: of the frame, or of these passes together.

    label: what it says. aim: the most that it should be, or with at_least the least; None without one.
    thesis: the best that it reports, from its frames per second.
    """

    label: str
    over: str
    under: str
    passes: tuple[str, ...] = ()
    aim: float | None = None
    at_least: bool = False
    thesis: float | None = None

    def met(self, value: float) -> bool | None:
        """Whether a value reaches the aim; None without one."""
        if self.aim is None:
            return None
        return value >= self.aim if self.at_least else value <= self.aim


OFF = {"use_caustics": False, "use_shadows": False, "use_glow": False}
COMPUTE, POINTS, CPU = ({"caustics_method": name} for name in ("GPU_COMPUTE", "GPU_POINTS", "CPU"))
THESIS_SIZE = {"caustics_size": 256, "photon_size": 256}

DEFAULT = "compute"
"""Every setting at its default, where the machine has what the fastest way to sum caustics needs."""

DRY = "scene-shadows"
"""What a technique's frame is compared with."""

KINDS = {
    "scene": Kind("scene without water", OFF, water=False),
    "plain": Kind("whole frame, none of the effects", OFF),
    DRY: Kind("scene without water, shadows", {"use_caustics": False}, water=False),
    "shadows": Kind("whole frame, shadows", {"use_caustics": False}),
    DEFAULT: Kind("+ caustics, GPU compute", COMPUTE),
    "points": Kind("+ caustics, GPU points", POINTS),
    "cpu": Kind("+ caustics, CPU", CPU),
    "compute-256": Kind("+ caustics of 256², GPU compute", {**COMPUTE, **THESIS_SIZE}),
    "points-256": Kind("+ caustics of 256², GPU points", {**POINTS, **THESIS_SIZE}),
    "cpu-256": Kind("+ caustics of 256², CPU", {**CPU, **THESIS_SIZE}),
    "texture-256": Kind("all, textures of 256²", {"texture_size": 256}),
    "texture-1024": Kind("all, textures of 1024²", {"texture_size": 1024}),
    "toward-sun": Kind("all but glow, toward the sun", {"use_glow": False}, TOWARD_SUN),
    "glow": Kind("all, toward the sun", view=TOWARD_SUN),
    "under": Kind("all, under water", view=UNDER),
    "split": Kind("all, half under water", view=SPLIT),
}

TECHNIQUE_KINDS = {
    f"technique-{name.lower().replace('_', '-')}": Kind(technique.label, {"technique": name})
    for name, technique in TECHNIQUES.items()
}

FURTHER = ("moving-sun", "grid", "memory")
"""Further measurements, all of them of frames of the kind DEFAULT."""

LIGHT_PASSES = ("photons", "caustics")

RATIOS = (
    Ratio("whole frame / scene without water, none of the effects", "plain", "scene", aim=2.5),
    Ratio("whole frame / scene without water, shadows and caustics", DEFAULT, DRY),
    Ratio("whole frame with shadows / without", "shadows", "plain"),
    *(
        Ratio(
            f"frames per second with caustics / without, {label}",
            "shadows",
            kind,
            aim=0.90,
            at_least=True,
            thesis=0.83,
        )
        for label, kind in (
            ("GPU compute", DEFAULT),
            ("GPU points", "points"),
            ("CPU", "cpu"),
            ("GPU compute 256²", "compute-256"),
            ("GPU points 256²", "points-256"),
            ("CPU 256²", "cpu-256"),
        )
    ),
    Ratio("photons and their sum, CPU / GPU compute", "cpu", DEFAULT, LIGHT_PASSES, aim=3.0),
    Ratio("photons and their sum, CPU / GPU compute, 256²", "cpu-256", "compute-256", LIGHT_PASSES, aim=3.0),
    Ratio(
        "frames per second, textures of 1024² / 256²",
        "texture-256",
        "texture-1024",
        aim=0.65,
        at_least=True,
        thesis=0.55,
    ),
    Ratio("whole frame with glow / without", "glow", "toward-sun"),
)
