# SPDX-License-Identifier: GPL-3.0-or-later
# Table 1 of Mihalik's thesis, its three steps, its surface of 49 x 49 vertices, its caustics and its glow,
# and from under water its approximation without total reflection.
import bpy

water = bpy.context.object.lake_water
scene = bpy.context.scene.lake_water

scene.technique = "LAKE"
scene.fov_ext = 1.5
scene.texture_size = 512
scene.least_grid_resolution = 2
scene.intersection_steps = 3
scene.refraction_steps = 0
scene.reflection_steps = 0
scene.use_exact_fresnel = False
scene.use_caustics = True
scene.caustics_size = 256
scene.photon_size = 256
scene.caustics_steps = 1
scene.use_shadows = True
scene.light_depth_size = 1024
scene.use_glow = True
scene.glow_strength = 1.0
scene.glow_exponent = 200.0
scene.glow_threshold = 0.0
scene.use_exact_under_water = False
water.k = 0.5
water.q = 5.0
water.c = 1.0
water.ior = 1.333
water.water_color = (0.0, 0.2, 0.1)
water.depth = 5.0
water.grid_resolution = 49
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
