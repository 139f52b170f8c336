"""Times Mitsuba 3 (llvm_ad_rgb) on a room that bench_mitsuba wrote. Usage: mitsuba_room.py DIR SPP DEPTH

DIR holds scene.ply (vertices with normals and s, t; faces with their segment), base_color.exr and
room.json (camera, materials by segment). Prints "ready", then answers each line "primal" or
"gradient" on its input with the seconds that one picture took: `path`, or `prb` forward and backward
for the derivative of the mean by the base colour's texture."""
import json
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")


def read_ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts, fields, element = {}, {}, None
    for line in data[:end].decode().split("\n"):
        word = line.split()
        if word[:1] == ["element"]:
            element = word[1]
            counts[element], fields[element] = int(word[2]), []
        elif word[:1] == ["property"]:
            fields[element].append(word[1:])
    kinds = {"float": "<f4", "int": "<i4", "uint": "<u4", "uchar": "u1"}
    vertex = np.dtype([(f[1], kinds[f[0]]) for f in fields["vertex"]])
    face = []
    for f in fields["face"]:
        face += [("n", "u1"), ("v", "<i4", 3)] if f[0] == "list" else [(f[1], kinds[f[0]])]
    vertices = np.frombuffer(data, vertex, counts["vertex"], end)
    faces = np.frombuffer(data, np.dtype(face), counts["face"], end + vertices.nbytes)
    return vertices, faces


def make_mesh(number, vertices, faces, props):
    used, index = np.unique(faces["v"], return_inverse=True)
    v = vertices[used]
    smooth = "nx" in vertices.dtype.names
    mesh = mi.Mesh(f"part{number}", len(v), len(faces), has_vertex_normals=smooth,
                   has_vertex_texcoords=True, props=props)
    p = mi.traverse(mesh)
    p["vertex_positions"] = np.stack([v["x"], v["y"], v["z"]], 1).ravel()
    if smooth:
        p["vertex_normals"] = np.stack([v["nx"], v["ny"], v["nz"]], 1).ravel()
    p["vertex_texcoords"] = np.stack([v["s"], 1 - v["t"]], 1).ravel()  # theirs starts at the top
    p["faces"] = index.astype(np.uint32).ravel()
    p.update()
    return mesh


def make_sensor(camera, spp):
    """Camera: width, height, fx, world_from_camera (x right, y down, z forward)."""
    to_world = np.array(camera["world_from_camera"])
    to_world[:3, :2] *= -1  # theirs: x left, y up, z forward
    return {
        "type": "perspective", "fov": 2 * np.degrees(np.arctan(0.5 * camera["width"] / camera["fx"])),
        "fov_axis": "x", "to_world": mi.ScalarTransform4f(to_world), "near_clip": 1e-3, "far_clip": 1e4,
        "film": {"type": "hdrfilm", "width": camera["width"], "height": camera["height"],
                 "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "independent", "sample_count": spp}}


def make_scene(ply, segments, texture):
    """The mesh of `ply` with one base colour texture; segments[number]: roughness, specular, emission."""
    vertices, faces = read_ply(ply)
    scene = {"type": "scene"}
    groups = {}
    for s, m in enumerate(segments):
        groups.setdefault((m["roughness"], m["specular"], tuple(m["emission"])), []).append(s)
    for number, ((roughness, specular, emission), members) in enumerate(groups.items()):
        part = faces[np.isin(faces["segment"], members)]
        if len(part) == 0:
            continue
        props = mi.Properties()
        props["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": {
            "type": "principled", "base_color": texture, "roughness": roughness, "specular": specular}})
        if max(emission) > 0:
            props["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": emission}})
        scene[f"part{number}"] = make_mesh(number, vertices, part, props)
    return scene


def load(folder, spp, depth):
    room = json.load(open(folder + "/room.json"))
    texture = mi.load_dict({"type": "bitmap", "filename": folder + "/base_color.exr", "raw": True,
                            "format": "variant", "wrap_mode": "clamp"})
    scene = make_scene(folder + "/scene.ply", room["segments"], texture)
    scene["integrator"] = {"type": "path", "max_depth": depth, "rr_depth": 5}
    scene["sensor"] = make_sensor(room["camera"], spp)
    return mi.load_dict(scene)


def main():
    folder, spp, depth = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    scene = load(folder, spp, depth)
    params = mi.traverse(scene)
    key = next(k for k in params.keys() if k.endswith("base_color.data"))
    prb = mi.load_dict({"type": "prb", "max_depth": depth, "rr_depth": 5})

    def primal(seed):
        image = mi.render(scene, spp=spp, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        return image

    def gradient(seed):
        dr.enable_grad(params[key])
        params.update()
        image = mi.render(scene, params, integrator=prb, spp=spp, seed=seed)
        dr.backward(dr.mean(image, axis=None))
        grad = dr.grad(params[key])
        dr.eval(grad)
        dr.sync_thread()
        dr.disable_grad(params[key])
        return grad

    mean = float(np.mean(np.array(primal(0))))
    primal(1)
    gradient(0)
    gradient(1)
    print("ready", mean, mi.__version__, flush=True)
    seed = 2
    for line in sys.stdin:
        start = time.perf_counter()
        gradient(seed) if line.strip() == "gradient" else primal(seed)
        print(time.perf_counter() - start, flush=True)
        seed += 2


if __name__ == "__main__":
    main()
