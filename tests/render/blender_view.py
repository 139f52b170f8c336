"""Renders the camera view_N of a USD file with Blender's Cycles into the EXR OUT, in linear radiance.

Usage: blender_view.py SCENE N WIDTH HEIGHT SAMPLES OUT"""
import sys

import bpy

path, view, (width, height, samples), out = sys.argv[1], sys.argv[2], map(int, sys.argv[3:6]), sys.argv[6]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=path, import_usd_preview=True, set_frame_range=False)
scene = bpy.context.scene
cameras = {c.name.split(".")[0]: c for c in bpy.data.objects if c.type == "CAMERA"}
scene.camera = cameras["view_" + view]
scene.render.engine = "CYCLES"
scene.cycles.samples = samples
scene.cycles.use_denoising = False
scene.cycles.use_adaptive_sampling = False
scene.cycles.sample_clamp_indirect = 0
scene.cycles.light_sampling_threshold = 0
scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 16
scene.cycles.filter_width = 0.01  # ours is a box of one pixel; the mean of a picture does not depend on it
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.filepath = out
bpy.ops.render.render(write_still=True)
