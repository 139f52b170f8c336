"""Photographs of a furnished room: HDR, 8-bit at cycling exposures, 8-bit at one exposure."""
import json
import os

import mitsuba as mi
import numpy as np

from rendering import FOCAL, HEIGHT, WIDTH

CYCLE = (1.0, 1 / 16.66, 1 / 166.66)
CYCLE_MEDIAN = 0.7  # what the median of all photographs becomes at the first of the cycling exposures
HALF_LARGEST = 65504.0
NOISE = 0.01        # of a pixel at 1; of less light as its root


def write_transforms(path, poses, train, folder, kind, **more):
    frames = [{"file_path": f"{folder}/{k:03d}.{kind}", "transform_matrix": pose.tolist(),
               "split": "train" if k < train else "test"} for k, pose in enumerate(poses)]
    for key, values in more.pop("of_frames", {}).items():
        for frame, value in zip(frames, values):
            frame[key] = value
    with open(path, "w") as out:
        json.dump({"camera_model": "PINHOLE", "w": WIDTH, "h": HEIGHT, "fl_x": FOCAL, "fl_y": FOCAL, "cx": WIDTH / 2,
                   "cy": HEIGHT / 2, **more, "frames": frames}, out)


def checked(image, name):
    """Refuses a photograph that no room can look like: nothing in them is brighter than 40,000."""
    bad = ~np.isfinite(image).all(-1) | (np.max(image, -1) >= HALF_LARGEST)
    if bad.any():
        y, x = np.argwhere(bad)[0]
        raise ValueError(f"photograph {name}: {bad.sum()} pixels are no numbers or brighter than half precision holds, "
                         f"one at ({x}, {y}): does a part have a fault?")
    return image


def write_hdr(images, poses, train, out):
    os.makedirs(f"{out}/images", exist_ok=True)
    for k, image in enumerate(images):
        mi.Bitmap(image.astype(np.float16)).write(f"{out}/images/{k:03d}.exr")
    write_transforms(out + "/transforms.json", poses, train, "images", "exr")


def write_8bit(images, poses, train, out, name, exposures):
    """As transforms_NAME.json and NAME/*.png."""
    os.makedirs(f"{out}/{name}", exist_ok=True)
    rng = np.random.default_rng(2)
    for k, (image, exposure) in enumerate(zip(images, exposures)):
        shown = np.asarray(image, float) * exposure
        shown = np.clip(shown + NOISE * np.sqrt(shown) * rng.normal(size=shown.shape), 0, 1)
        mi.Bitmap(shown.astype(np.float32)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8,
                                                    srgb_gamma=True).write(f"{out}/{name}/{k:03d}.png")
    write_transforms(f"{out}/transforms_{name}.json", poses, train, name, "png", response="srgb",
                     of_frames={"exposure": exposures})


def write_exposures(images, poses, train, out, single_median):
    """single_median: what the median of all photographs becomes in the variant of one exposure."""
    median = float(np.median(np.array(images[:train], float)))
    cycling = [CYCLE_MEDIAN / median * CYCLE[k % len(CYCLE)] for k in range(len(images))]
    write_8bit(images, poses, train, out, "sdr", cycling)
    write_8bit(images, poses, train, out, "one", [single_median / median] * len(images))
