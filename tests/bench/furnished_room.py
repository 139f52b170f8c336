"""Makes a furnished room with its truth, to measure fidelity beyond the rooms of the test data.

usage: furnished_room.py ROOM OUT [SPP]

ROOM: one of rooms_boxes.py, rooms_choice.py, rooms_report.py, which say what they are. OUT becomes a bundle like those
of the test data, which `FIDELITY_ROOMS=OUT make fidelity` takes: frames of 320 x 240 by Mitsuba 3 (MITSUBA_VARIANT:
llvm_ad_rgb, or cuda_ad_rgb, a minute on a large GPU; SPP samples a pixel), HDR (transforms.json), 8-bit at cycling
exposures (transforms_sdr.json) and 8-bit at one (transforms_one.json); of the held-out ones the truth, and the truth of
the light (light_truth.py). Needs Debian's sweethome3d-furniture, whose models it uses; nothing of them is kept here.
"""
import json
import os
import sys

import mitsuba as mi
import numpy as np

mi.set_variant(os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb"))

import light_truth  # noqa: E402
import rooms_boxes  # noqa: E402
import rooms_choice  # noqa: E402
import rooms_report  # noqa: E402
from furniture import join  # noqa: E402
from photographs import checked, write_exposures, write_hdr  # noqa: E402
from rendering import (HEIGHT, WIDTH, Numbers, base_color, choose_poses, colors_of, intersect, rays_of, render,  # noqa: E402
                       scene_of)

DEPTH = 16
SUBPIXELS = 8  # each way, over which base colours are averaged
TRUTH = [*(f"{what}.{c}" for what in ("base_color", "emission") for c in "RGB"), "roughness", "specular", "object_id", "depth"]
FRAMES = {**dict.fromkeys(rooms_boxes.ROOMS, (72, 8)), **dict.fromkeys((*rooms_choice.ROOMS, *rooms_report.ROOMS), (54, 6))}
MAKE = {**rooms_boxes.ROOMS, **rooms_choice.ROOMS, **rooms_report.ROOMS}


def write_mesh(room, path):
    joined = join("room", room.parts, None)
    faces = np.zeros(len(joined.faces), [("count", "u1"), ("v", "<i4", 3), ("object", "<i4")])
    faces["count"], faces["v"] = 3, joined.faces
    faces["object"] = np.repeat(np.arange(len(room.parts)), [len(p.faces) for p in room.parts])
    vertices = np.hstack([joined.positions, joined.normals]).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}",
              *(f"property float {c}" for c in ("x", "y", "z", "nx", "ny", "nz")), f"element face {len(faces)}",
              "property list uchar int vertex_indices", "property int object_id", "end_header", ""]
    with open(path, "wb") as out:
        out.write("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())


def truth_of(room, scene, pose):
    """The channels of TRUTH of one pose, [HEIGHT][WIDTH][]. Surfaces have two sides, as in photographs: models have
    coincident faces of either, of which a ray finds any. Only emitters have one."""
    numbers, steps = Numbers(scene), (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS
    color = 0.0
    for offset in ((x, y) for y in steps for x in steps):
        hit = intersect(scene, *rays_of(pose, 1, offset))
        color = color + colors_of(room, numbers(hit), np.array(hit.uv).T, base_color) / SUBPIXELS**2
    hit = intersect(scene, *rays_of(pose))
    number, uv = numbers(hit), np.array(hit.uv).T
    front = np.array(hit.wi.z) > 0
    light = colors_of(room, np.where(front, number, -1), uv, lambda of: of.emission)
    gloss = colors_of(room, number, uv, lambda of: (of.roughness, of.specular, 0.0))[:, :2]
    distance = np.where(number < 0, 0.0, np.array(hit.t))
    return np.hstack([color, light, gloss, number[:, None], distance[:, None]]).reshape(HEIGHT, WIDTH, len(TRUTH))


def write_truth(room, scene, test, first, out):
    """test: poses, whose numbers begin at `first`. Base colour averaged over the pixel; all else at its centre."""
    for k, pose in enumerate(test):
        mi.Bitmap(truth_of(room, scene, pose).astype(np.float32), pixel_format=mi.Bitmap.PixelFormat.MultiChannel,
                  channel_names=TRUTH).write(f"{out}/truth/{first + k:03d}.exr")
    with open(out + "/truth/objects.json", "w") as file:
        json.dump([{"id": k, "name": p.name, "roughness": p.material.roughness, "specular": p.material.specular,
                    "emission": np.reshape(p.material.emission, (-1, 3)).mean(0).tolist(),
                    "base_color": list(map(float, p.material.color)),
                    "base_color_texture": None if p.material.texture is None else p.name, "triangles": len(p.faces)}
                   for k, p in enumerate(room.parts)], file, indent=1)


def write_bundle(room, out, spp, train, test):
    os.makedirs(out + "/truth", exist_ok=True)
    scene = scene_of(room)
    poses = choose_poses(room, scene, train + test)
    write_mesh(room, out + "/mesh.ply")
    path = {"type": "path", "max_depth": DEPTH, "rr_depth": 8}
    images = [checked(render(scene, pose, spp, path, k), k) for k, pose in enumerate(poses)]
    write_hdr(images, poses, train, out)
    write_exposures(images, poses, train, out, room.single_exposure)
    light_truth.write(room, scene, poses[:train], out, max(16, spp // 4))
    write_truth(room, scene, poses[train:], train, out)


def main():
    kind, out, spp = sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 256
    room = MAKE[kind](np.random.default_rng(1))
    print(f"{kind}: {len(room.parts)} objects, {sum(len(p.faces) for p in room.parts)} triangles", flush=True)
    write_bundle(room, out, spp, *FRAMES[kind])


if __name__ == "__main__":
    main()
