"""Recovers base colour with Mitsuba 3 (llvm_ad_rgb), as a short script of its users would: screen-space
Adam on whole frames. Emission, roughness and specular are given to it.

usage: mitsuba_inverse.py ROOM OUTPUTS SNAPSHOTS SECONDS

ROOM is a bundle with its truth. OUTPUTS, of a reconstruction of it by us, gives the atlas (scene.ply)
and the numbers of segments (report.json), nothing else. Every now and then the texture goes to
SNAPSHOTS/NNNN.exr, NNNN being the seconds of work so far; they count from the first step, what is
loaded and compiled before it is not counted."""
import json
import os
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

import mitsuba_room

TEXELS = 2048
DEPTH = 9
SPP = 8
RATE = 0.03
SNAPSHOT_GROWTH = 1.25  # from one snapshot to the next


def true_segments(room, outputs):
    """Roughness, specular, emission of each segment, by the truth."""
    objects = {o["id"]: o for o in json.load(open(room + "/truth/objects.json"))}
    segments = json.load(open(outputs + "/report.json"))["segments"]
    return [objects[s["id"]] for s in sorted(segments, key=lambda s: s["segment"])]


def training_frames(room):
    """(sensor, photograph) of each."""
    capture = json.load(open(room + "/transforms.json"))
    frames = []
    for f in capture["frames"]:
        if f["split"] != "train":
            continue
        to_world = np.array(f["transform_matrix"])
        to_world[:3, 1:3] *= -1  # theirs looks along -z with y up; a camera here along z with y down
        camera = {"width": capture["w"], "height": capture["h"], "fx": capture["fl_x"],
                  "world_from_camera": to_world}
        photograph = mi.TensorXf(mi.Bitmap(f"{room}/{f['file_path']}").convert(
            mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        frames.append((mi.load_dict(mitsuba_room.make_sensor(camera, SPP)), photograph))
    return frames


def main():
    room, outputs, snapshots, limit = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4])
    os.makedirs(snapshots, exist_ok=True)
    texture = mi.load_dict({"type": "bitmap", "bitmap": mi.Bitmap(np.full((TEXELS, TEXELS, 3), 0.5, np.float32)),
                            "raw": True, "format": "variant", "wrap_mode": "clamp"})
    scene = mi.load_dict(mitsuba_room.make_scene(outputs + "/scene.ply", true_segments(room, outputs), texture))
    frames = training_frames(room)
    median = float(np.median(np.concatenate([np.array(p).ravel() for _, p in frames])))
    params = mi.traverse(scene)
    key = next(k for k in params.keys() if k.endswith("base_color.data"))
    prb = mi.load_dict({"type": "prb", "max_depth": DEPTH, "rr_depth": 5})
    # Texels that no pixel of a frame shows keep still: without the mask their momentum moves them.
    adam = mi.ad.Adam(lr=RATE, mask_updates=True)
    adam[key] = params[key]
    params.update(adam)

    order = np.random.default_rng(1)
    due, start, step = 5.0, time.perf_counter(), 0
    paused = 0.0
    while True:
        if step % len(frames) == 0:
            turn = order.permutation(len(frames))
        sensor, photograph = frames[turn[step % len(frames)]]
        image = mi.render(scene, params, sensor=sensor, integrator=prb, spp=SPP, seed=2 * step, seed_grad=2 * step + 1)
        loss = dr.mean(dr.square(image - photograph) / (dr.square(photograph) + 0.01 * median * median), axis=None)
        dr.backward(loss)
        adam.step()
        adam[key] = dr.clip(adam[key], 0.0, 1.0)
        params.update(adam)
        dr.eval(params[key])
        dr.sync_thread()
        step += 1
        seconds = time.perf_counter() - start - paused
        if seconds >= due or seconds >= limit:
            mi.Bitmap(np.array(params[key])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float16, False).write(
                f"{snapshots}/{round(seconds):04d}.exr")
            print(f"{seconds:.0f} s: step {step}, loss {float(np.array(loss).item()):.4f}", flush=True)
            due = seconds * SNAPSHOT_GROWTH
            paused = time.perf_counter() - start - seconds
        if seconds >= limit:
            break


main()
