#!/bin/bash
# blender.sh BUILD: scene.usda in Blender's Cycles (PyPI's bpy, 350 MB, for the Python that it was built with) against our
# picture of the same room, made so that the models of reflection agree. Fails where the means of the pictures, or the
# medians of their pixels, differ by more than 5 %.
set -u
build=$1
work=$build/blender_room
mkdir -p "$work"
venv=$build/blender
[ -x "$venv/bin/python" ] || python3 -m venv "$venv" || exit 1
"$venv/bin/python" -c 'import bpy' 2>/dev/null || "$venv/bin/pip" install -q bpy==4.2.0 ||
    { echo "Blender cannot be had from PyPI for $(python3 --version)"; exit 77; }
"$build/tests/unit/test_usd" "$work" render || exit 1
"$venv/bin/python" tests/render/blender_view.py "$work/scene.usda" 0 160 120 256 "$work/blender.exr" >/dev/null || exit 1
"$venv/bin/python" - "$work" <<'PY'
import sys

import bpy
import numpy as np


def read(path):
    image = bpy.data.images.load(path)
    return np.array(image.pixels[:]).reshape(-1, image.channels)[:, :3].astype(float)


ours, theirs = read(sys.argv[1] + "/ours.exr"), read(sys.argv[1] + "/blender.exr")
mean = theirs.mean() / ours.mean()
median = np.median(theirs.mean(1) / np.maximum(ours.mean(1), 1e-6))
print(f"Blender's picture over ours: mean {mean:.4f}, median of pixels {median:.4f}")
sys.exit(not (abs(mean - 1) < 0.05 and abs(median - 1) < 0.05))
PY
