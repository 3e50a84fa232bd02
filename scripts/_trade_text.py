# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of docs/trade.md around its figures."""

AIMS = {"flip": {"BALANCED": 0.10, "BEST": 0.05}, "steps": 0.02}
"""Mean FLIP on the water; the middle error of three steps over the length of the refracted ray."""

INTRODUCTION = """# What each setting costs, and what error it leaves

    .venv/bin/python scripts/benchmark.py trade --engines --report docs

draws eight scenes with every technique and setting, compares each picture with a reference, and writes this
page, [trade.csv](trade.csv) with every measured point, and the plots. It takes some hours on four cores
and software OpenGL; what it has measured it keeps in `build/trade`, and the same command goes on where it
stopped. `--brief` measures the ends of the ranges of the most important settings alone; the number of points
below says where that was done.
No figure below is edited by hand."""

HOW = """## What is measured

**Image truth.** A picture of the same scene by rays alone, `scripts/reference`: the analytic waves,
Fresnel's equations, the real geometry, the extension's own shading, and on the bottom a count of photons.
For Traced, which models the physics of water, the physics; for the others the thesis's model (one k for all
colours, light that leaves the water unchanged). The sun's glow is off, as no part of either.

**Geometric truth.** Where the refracted and the reflected ray of each pixel's middle really end, W*,
against the point W that the shader itself looked up, written by a variant of it. *d* is the length of the
true ray. In texels of the technique's own texture; in pixels as W and W* are seen straight, plus half a
texel's width, because a colour of a texture is known no better.

**Error.** Mean FLIP of the displayed pictures over the water's pixels, 0 to 1, as seen from 0.7 m of a 4K
screen; HDR-FLIP, RMSE in scene-linear and SSIM (of the water and of the whole picture) are in the table.
Errors are rounded up, speeds down.

**Time.** From extraction to the last pixel, all samples of a picture, while the waves move from frame to
frame; each beside a picture of the same scene without water, drawn in turn with it. *Time* is the median of
these ratios: how many dry scenes a picture costs. A picture of the dry scene has one sample.

**Settings.** One at a time around a base, and combinations. Settings that a technique does not read
are not varied."""

ENGINES = """## Other engines

The same scenes by EEVEE, with its ray tracing, and Cycles, on the water's own nodes, in the same run
(`_trade_engines.py` tells the settings). A time is that of the next frame of an animation, with data kept
between frames; *shared* is the part of the processor that other programs had meanwhile. Cycles' converged
picture is the one with the most samples."""

AGREEMENT = """Cycles against the image truths, on the water: FLIP, and mean brightness relative to them.
*Direct light* is Cycles with no light between diffuse surfaces, as the references have none. Cycles shows
no caustics here (its light comes through the surface on straight rays), and lets the sky's light into the
water as physics has it."""

LIMITS = """## What limits each technique

The least mean FLIP on the water that any measured setting leaves, by scene. [limits.md](limits.md) shows why,
for each technique."""
