# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension's pictures are measured against: rays through the analytic surface to the real geometry.

`geometry` holds a snapshot's triangles for Embree, `water` meets rays with the sum of sines, `photons` counts
sunlight under water, `tracer` makes the picture that the optical model asks for, `truth` finds where each
pixel's ray really goes, and `measures` tells how far a picture or a place is off. None of it needs a GPU;
`images` alone asks Blender, for the pixels of textures.

Everything is in render space (see `lake_water_addon.core.plan`), float64 but for Embree's own search.
"""
