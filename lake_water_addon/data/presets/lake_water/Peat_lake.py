# SPDX-License-Identifier: GPL-3.0-or-later
# The absorption is that of pure water (Pope and Fry, 1997) and of dissolved humic matter,
# 5 exp(-0.014 (nm - 440)) per metre (Bricaud, Morel and Prieur, 1981, with an amount as in bog lakes),
# at 650, 550 and 450 nm; k is its mean, for the techniques without colors.
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
water.k = 2.03
water.q = 5.0
water.c = 0.8
water.ior = 1.333
water.water_color = (0.012, 0.0045, 0.0008)
water.depth = 4.0
water.traced.absorption = (0.604, 1.128, 4.356)
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.01343
item_sub_1.wavelength = 1.937
item_sub_1.direction = -0.209
item_sub_1.phase = 3.269
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00883
item_sub_1.wavelength = 1.274
item_sub_1.direction = 0.942
item_sub_1.phase = 2.263
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00613
item_sub_1.wavelength = 0.883
item_sub_1.direction = -0.593
item_sub_1.phase = 4.899
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00398
item_sub_1.wavelength = 0.573
item_sub_1.direction = 0.175
item_sub_1.phase = 5.195
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00263
item_sub_1.wavelength = 0.379
item_sub_1.direction = 0.559
item_sub_1.phase = 1.644
