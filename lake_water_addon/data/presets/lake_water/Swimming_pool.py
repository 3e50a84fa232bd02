# SPDX-License-Identifier: GPL-3.0-or-later
# The absorption is that of pure water (Pope and Fry, 1997) at 650, 550 and
# 450 nm; k is its mean, for the techniques without colors.
import bpy

water = bpy.context.object.lake_water
scene = bpy.context.scene.lake_water

scene.technique = "TRACED"
scene.use_caustics = True
scene.use_shadows = True
scene.use_glow = True
scene.glow_strength = 8.0
scene.glow_exponent = 6000.0
scene.glow_threshold = 0.1
scene.use_exact_under_water = True
water.k = 0.135
water.q = 5.0
water.c = 0.5
water.ior = 1.333
water.water_color = (0.0, 0.03, 0.045)
water.depth = 1.8
water.traced.absorption = (0.34, 0.0565, 0.0092)
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00734
item_sub_1.wavelength = 1.522
item_sub_1.direction = 2.52
item_sub_1.phase = 5.457
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00605
item_sub_1.wavelength = 1.254
item_sub_1.direction = -1.08
item_sub_1.phase = 2.392
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00494
item_sub_1.wavelength = 1.025
item_sub_1.direction = 0.36
item_sub_1.phase = 0.641
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00409
item_sub_1.wavelength = 0.847
item_sub_1.direction = 1.8
item_sub_1.phase = 1.567
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00324
item_sub_1.wavelength = 0.672
item_sub_1.direction = -1.8
item_sub_1.phase = 4.594
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00269
item_sub_1.wavelength = 0.557
item_sub_1.direction = -2.52
item_sub_1.phase = 2.564
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00196
item_sub_1.wavelength = 0.407
item_sub_1.direction = 1.08
item_sub_1.phase = 1.144
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00168
item_sub_1.wavelength = 0.349
item_sub_1.direction = -0.36
item_sub_1.phase = 5.45
