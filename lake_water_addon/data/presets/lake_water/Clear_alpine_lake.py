# SPDX-License-Identifier: GPL-3.0-or-later
# The absorption is that of Jerlov's oceanic type IB (Marine Optics, 1976, table XXVII) at 650, 550 and
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
water.k = 0.161
water.q = 5.0
water.c = 1.0
water.ior = 1.333
water.water_color = (0.006, 0.06, 0.075)
water.depth = 10.0
water.traced.absorption = (0.375, 0.072, 0.036)
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.02162
item_sub_1.wavelength = 2.742
item_sub_1.direction = -0.131
item_sub_1.phase = 3.813
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.01485
item_sub_1.wavelength = 1.884
item_sub_1.direction = -0.451
item_sub_1.phase = 3.652
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00918
item_sub_1.wavelength = 1.164
item_sub_1.direction = 0.509
item_sub_1.phase = 0.995
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00634
item_sub_1.wavelength = 0.804
item_sub_1.direction = 0.829
item_sub_1.phase = 2.706
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00477
item_sub_1.wavelength = 0.605
item_sub_1.direction = 0.189
item_sub_1.phase = 2.473
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00324
item_sub_1.wavelength = 0.411
item_sub_1.direction = 1.149
item_sub_1.phase = 4.543
