#!/usr/bin/env python3
"""tone_curve.py BUNDLE OUT SHARE [--untold]: a room's HDR capture as ordinary frames of a camera with contrast.

Each photograph has the automatic exposure of ../shared/tools/scan.py's phone (the brightest tenth at three quarters), times
a factor between .5 and 2, which transforms.json tells as EXIF would, unless --untold; 8-bit PNG, a little noise. Encoded
values u come out as u + SHARE (3 u^2 - 2 u^3 - u): an S such as picture modes have, .2 to .8; 0: plain sRGB; below 0: flat.
"""
import json
import os
import sys

import numpy as np
import OpenEXR
from PIL import Image


def pixels_of(path):
    channels = OpenEXR.File(path).channels()
    if "RGB" in channels:
        return channels["RGB"].pixels.astype(np.float32)
    return np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float32)


def encode(linear, share, random):
    noise = random.normal(size=linear.shape) * np.sqrt(4e-5 * np.maximum(linear, 0) + 4e-7)
    z = np.clip(linear + noise, 0, 1)
    u = np.where(z <= 0.0031308, 12.92 * z, 1.055 * z ** (1 / 2.4) - 0.055)
    return np.round(255 * (u + share * (3 * u**2 - 2 * u**3 - u))).astype(np.uint8)


def main():
    bundle, out, share, told = sys.argv[1], sys.argv[2], float(sys.argv[3]), "--untold" not in sys.argv
    transforms = json.load(open(os.path.join(bundle, "transforms.json")))
    random = np.random.default_rng(5)
    os.makedirs(os.path.join(out, "images"), exist_ok=True)
    for frame in transforms["frames"]:
        linear = pixels_of(os.path.join(bundle, frame["file_path"]))
        exposure = 0.75 / np.quantile(linear.max(-1), 0.9) * 2 ** random.uniform(-1, 1)
        name = "images/" + os.path.splitext(os.path.basename(frame["file_path"]))[0] + ".png"
        Image.fromarray(encode(linear * exposure, share, random)).save(os.path.join(out, name))
        frame["file_path"] = name
        frame.pop("exposure", None)
        if told:
            frame["exposure"] = float(exposure)
    mesh = os.path.join(out, "mesh.ply")
    if not os.path.exists(mesh):
        os.link(os.path.join(bundle, "mesh.ply"), mesh)
    json.dump(transforms, open(os.path.join(out, "transforms.json"), "w"), indent=1)


main()
