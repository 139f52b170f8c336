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
from rendering import choose_poses, render, scene_of, spectrum, texture_of  # noqa: E402

DEPTH = 16
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


def pictures_of(room, shines, test, views):
    """Of each of the poses `test` the views (spp, integrator, seed) of the room as it shines."""
    scene = scene_of(room, shines)
    return [[render(scene, pose, *view) for view in views] for pose in test]


def write_truth(room, test, first, out):
    """test: poses, whose numbers begin at `first`. Base colour averaged over the pixel; all else at one random place of
    it, the same for all."""
    emitted = {"type": "path", "max_depth": 1}
    colors = pictures_of(room, lambda number, part: texture_of(part.material), test, [(64, emitted, 1)])
    # A shape whose light is black would be no emitter: numbers from 1, all else a little more than 0.
    others = pictures_of(room, lambda number, part: spectrum((part.material.roughness, part.material.specular + 1e-9,
                                                              number + 1)), test, [(1, emitted, 2), (1, {"type": "depth"}, 2)])
    lights = pictures_of(room, lambda number, part: spectrum(np.array(part.material.emission) + 1e-9), test,
                         [(1, emitted, 2)])
    names = [f"{what}.{c}" for what in ("base_color", "emission") for c in "RGB"]
    for k, ((color,), (other, depth), (light,)) in enumerate(zip(colors, others, lights)):
        light[light < 1e-6] = 0.0
        channels = np.dstack([color, light, other[..., :2], np.round(other[..., 2:]) - 1, depth[..., :1]]).astype(np.float32)
        mi.Bitmap(channels, pixel_format=mi.Bitmap.PixelFormat.MultiChannel, channel_names=names + [
            "roughness", "specular", "object_id", "depth"]).write(f"{out}/truth/{first + k:03d}.exr")
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
    write_truth(room, poses[train:], train, out)


def main():
    kind, out, spp = sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 256
    room = MAKE[kind](np.random.default_rng(1))
    print(f"{kind}: {len(room.parts)} objects, {sum(len(p.faces) for p in room.parts)} triangles", flush=True)
    write_bundle(room, out, spp, *FRAMES[kind])


if __name__ == "__main__":
    main()
