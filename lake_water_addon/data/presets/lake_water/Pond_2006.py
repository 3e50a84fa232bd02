# SPDX-License-Identifier: GPL-3.0-or-later
# Luna's pond of 2006: two normal maps that scroll over a flat surface, under a material with a
# highlight, which takes the place of the glow.
import bpy

water = bpy.context.object.lake_water
scene = bpy.context.scene.lake_water

scene.technique = "POND"
scene.use_caustics = True
scene.use_shadows = True
scene.use_glow = False
scene.glow_strength = 8.0
scene.glow_exponent = 6000.0
scene.glow_threshold = 0.1
scene.use_exact_under_water = True
water.k = 0.5
water.q = 5.0
water.c = 1.0
water.ior = 1.333
water.water_color = (0.03, 0.07, 0.05)
water.depth = 5.0
water.pond.tile_size_0 = 4.0
water.pond.velocity_0 = (0.15, 0.06)
water.pond.tile_size_1 = 2.7
water.pond.velocity_1 = (-0.04, 0.1)
water.pond.ripple_scale = (0.06, 0.03)
water.pond.bias = 0.2
water.pond.bias_map_strength = 0.0
water.pond.bias_depth_strength = 0.0
water.pond.bias_depth_range = (0.0, 2.0)
water.pond.bias_distance_strength = 0.0
water.pond.bias_distance_range = (5.0, 60.0)
water.pond.power = 0.7
water.pond.ambient = (0.5, 0.5, 0.5)
water.pond.diffuse = (0.6, 0.6, 0.6)
water.pond.specular = (0.8, 0.8, 0.8)
water.pond.shininess = 64.0
water.pond.impurity = 0.15
water.pond.impurity_map_strength = 0.0
water.pond.impurity_tile_size = 6.0
water.pond.geometric_waves = False
water.waves.clear()
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.03561
item_sub_1.wavelength = 3.824
item_sub_1.direction = 0.189
item_sub_1.phase = 0.178
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.0256
item_sub_1.wavelength = 2.749
item_sub_1.direction = 0.829
item_sub_1.phase = 5.251
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.01673
item_sub_1.wavelength = 1.796
item_sub_1.direction = -0.451
item_sub_1.phase = 2.719
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.01038
item_sub_1.wavelength = 1.115
item_sub_1.direction = -0.131
item_sub_1.phase = 4.79
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00705
item_sub_1.wavelength = 0.757
item_sub_1.direction = 0.509
item_sub_1.phase = 0.013
item_sub_1 = water.waves.add()
item_sub_1.amplitude = 0.00463
item_sub_1.wavelength = 0.497
item_sub_1.direction = 1.149
item_sub_1.phase = 2.798
