# SPDX-License-Identifier: GPL-3.0-or-later
# The absorption is that of Jerlov's coastal type 7 (Marine Optics, 1976, table XXVII) at 650, 550 and
# 450 nm; k is its mean, for the techniques without colors.
import bpy

water = bpy.context.object.lake_water
scene = bpy.context.scene.lake_water

scene.technique = "TRACED"
scene.use_caustics = True
scene.use_shadows = True
scene.use_glow = True
scene.glow_strength = 6.0
scene.glow_exponent = 4000.0
scene.glow_threshold = 0.1
scene.use_exact_under_water = True
water.k = 0.66
water.q = 5.0
water.c = 0.6
water.ior = 1.333
water.water_color = (0.03, 0.07, 0.008)
water.depth = 2.0
water.traced.absorption = (0.63, 0.46, 0.89)
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00418
item_sub_1.wavelength = 1.55
item_sub_1.direction = 1.571
item_sub_1.phase = 3.461
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00306
item_sub_1.wavelength = 1.137
item_sub_1.direction = 0.873
item_sub_1.phase = 1.205
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00212
item_sub_1.wavelength = 0.788
item_sub_1.direction = 0.175
item_sub_1.phase = 4.506
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00154
item_sub_1.wavelength = 0.573
item_sub_1.direction = 2.269
item_sub_1.phase = 3.399
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00109
item_sub_1.wavelength = 0.406
item_sub_1.direction = -0.524
item_sub_1.phase = 3.453
