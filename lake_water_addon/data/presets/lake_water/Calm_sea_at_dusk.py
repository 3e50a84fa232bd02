# SPDX-License-Identifier: GPL-3.0-or-later
# The absorption is that of Jerlov's oceanic type II (Marine Optics, 1976, table XXVII) at 650, 550 and
# 450 nm; k is its mean, for the techniques without colors.
# Sun and sky are the scene's: a low sun makes the glitter.
import bpy

water = bpy.context.object.lake_water
scene = bpy.context.scene.lake_water

scene.technique = "TRACED"
scene.use_caustics = True
scene.use_shadows = True
scene.use_glow = True
scene.glow_strength = 6.0
scene.glow_exponent = 1500.0
scene.glow_threshold = 0.05
scene.use_exact_under_water = True
water.k = 0.186
water.q = 5.0
water.c = 1.5
water.ior = 1.34
water.water_color = (0.002, 0.009, 0.016)
water.depth = 100.0
water.traced.absorption = (0.4, 0.089, 0.068)
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.05867
item_sub_1.wavelength = 14.493
item_sub_1.direction = 0.436
item_sub_1.phase = 5.721
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.03837
item_sub_1.wavelength = 9.478
item_sub_1.direction = -0.087
item_sub_1.phase = 3.388
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.02404
item_sub_1.wavelength = 5.938
item_sub_1.direction = 0.96
item_sub_1.phase = 0.592
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.01525
item_sub_1.wavelength = 3.767
item_sub_1.direction = 0.262
item_sub_1.phase = 3.54
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00962
item_sub_1.wavelength = 2.376
item_sub_1.direction = 0.785
item_sub_1.phase = 4.395
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.0068
item_sub_1.wavelength = 1.68
item_sub_1.direction = -0.262
item_sub_1.phase = 4.58
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00433
item_sub_1.wavelength = 1.07
item_sub_1.direction = 0.087
item_sub_1.phase = 4.165
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00292
item_sub_1.wavelength = 0.722
item_sub_1.direction = 0.611
item_sub_1.phase = 3.833
