"""Renders the sensor number VIEW of DIR/scene.xml with Mitsuba 3 into the EXR OUT.

Usage: mitsuba_view.py DIR VIEW SPP OUT"""
import sys

import mitsuba as mi

folder, view, spp, out = sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4]
mi.set_variant("scalar_rgb")  # needs no LLVM
scene = mi.load_file(folder + "/scene.xml", spp=spp)
image = mi.Bitmap(mi.render(scene, sensor=view))
image.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False).write(out)
