"""Pictures of a room by Mitsuba 3, and rays into it."""
import drjit as dr
import mitsuba as mi
import numpy as np

WIDTH, HEIGHT, FOCAL = 320, 240, 208.5160596545929
ALL = object()


def spectrum(color):
    """Of a colour, or of a texture."""
    if np.ndim(color) == 1:
        return {"type": "rgb", "value": [float(c) for c in color]}
    return {"type": "bitmap", "bitmap": mi.Bitmap(color.astype(np.float32)), "raw": True}


def base_color(of):
    """Its colour, or its texture."""
    return of.color if of.texture is None else of.texture


def scene_of(room, lit=ALL, sky=ALL):
    """The room as it is, or with only the parts `lit` and the map `sky` as its light."""
    scene = {"type": "scene"}
    sky = room.sky if sky is ALL else sky
    if sky is not None:
        scene["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(sky.astype(np.float32))}
    for number, part in enumerate(room.parts):
        of, props = part.material, mi.Properties()
        props["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": {
            "type": "principled", "base_color": spectrum(base_color(of)), "roughness": of.roughness, "specular": of.specular}})
        if np.max(of.emission) > 0 and (lit is ALL or number in lit):
            props["emitter"] = mi.load_dict({"type": "area", "radiance": spectrum(of.emission)})
        mesh = mi.Mesh(f"part{number}", len(part.positions), len(part.faces), has_vertex_normals=True,
                       has_vertex_texcoords=True, props=props)
        params = mi.traverse(mesh)
        params["vertex_positions"] = part.positions.astype(np.float32).ravel()
        params["vertex_normals"] = part.normals.astype(np.float32).ravel()
        params["vertex_texcoords"] = part.uv.astype(np.float32).ravel()
        params["faces"] = part.faces.astype(np.uint32).ravel()
        params.update()
        scene[f"part{number}"] = mesh
    return mi.load_dict(scene)


def render(scene, pose, spp, integrator, seed):
    to_world = pose.copy()
    to_world[:3, [0, 2]] *= -1  # theirs: x left, y up, z forward
    sensor = mi.load_dict({
        "type": "perspective", "fov": 2 * np.degrees(np.arctan(0.5 * WIDTH / FOCAL)), "fov_axis": "x",
        "to_world": mi.ScalarTransform4f(to_world), "near_clip": 1e-3, "far_clip": 1e4,
        "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "independent", "sample_count": spp}})
    return np.array(mi.render(scene, sensor=sensor, integrator=mi.load_dict(integrator), spp=spp, seed=seed))


def rays_of(pose, step=1, offset=(0.5, 0.5)):
    """Origin and directions [count][3] of a picture's rays through the same place of every step-th pixel."""
    x, y = np.meshgrid(np.arange(0, WIDTH, step) + offset[0], np.arange(0, HEIGHT, step) + offset[1])
    local = np.stack([(x - WIDTH / 2) / FOCAL, (HEIGHT / 2 - y) / FOCAL, -np.ones_like(x)], -1).reshape(-1, 3)
    world = local @ pose[:3, :3].T
    return pose[:3, 3], world / np.linalg.norm(world, axis=1, keepdims=True)


def intersect(scene, origin, direction):
    """What rays hit first; origins and directions are [count][3]."""
    ray = mi.Ray3f(mi.Point3f(np.ascontiguousarray(np.broadcast_to(origin, direction.shape).T, np.float32)),
                   mi.Vector3f(np.ascontiguousarray(direction.T, np.float32)))
    return scene.ray_intersect(ray)


class Numbers:
    """Numbers of parts by what was hit."""

    def __init__(self, scene):
        self.of_index = lambda shape: np.array(dr.reinterpret_array(mi.UInt32, shape))
        found = {int(self.of_index(mi.ShapePtr(s))[0]): int(s.id()[len("part"):]) for s in scene.shapes()}
        self.table = np.full(max(found) + 1, -1)
        for index, number in found.items():
            self.table[index] = number

    def __call__(self, hit):
        """[count], -1 where nothing was hit."""
        return self.table[self.of_index(hit.shape)]

    def shown(self, hit, direction):
        """The same, -1 for what is seen from behind, where parts do not emit."""
        front = (np.array(hit.n).reshape(3, -1).T * direction).sum(1) < 0
        return np.where(front, self(hit), -1)


def looked_up(of, uv):
    """The colours [count][3] of a colour, or of a texture at [count][2]."""
    if np.ndim(of) == 1:
        return np.broadcast_to(np.array(of, float), (len(uv), 3))
    at = dr.zeros(mi.SurfaceInteraction3f, len(uv))
    at.uv = mi.Point2f(np.ascontiguousarray(uv.T, np.float32))
    return np.array(mi.load_dict(spectrum(of)).eval(at)).reshape(3, -1).T


def colors_of(room, number, uv, color_of):
    """What color_of(material) is at each hit [count][3]; black where number is -1."""
    colors = np.zeros((len(number), 3))
    for part in np.unique(number[number >= 0]):
        there = number == part
        colors[there] = looked_up(color_of(room.parts[part].material), uv[there])
    return colors


def choose_poses(room, scene, count):
    """Cameras anywhere at the height of hands and eyes, that look anywhere but at what is near, and show no part that
    is hidden."""
    poses, numbers = [], Numbers(scene)
    hidden = sorted(room.hidden)
    while len(poses) < count:
        at = room.rng.uniform((0.4, 0.9, 0.4), (room.size[0] - 0.4, 1.9, room.size[2] - 0.4))
        back = at - room.rng.uniform((0, 0, 0), room.size)
        distance = np.linalg.norm(back)
        if distance < 1.5 or abs(back[1]) > 0.75 * distance or not room.has_place(at):
            continue
        back /= distance
        if float(intersect(scene, at, -back[None, :]).t[0]) < 0.7:
            continue
        pose = np.eye(4)
        right = np.cross((0, 1, 0), back)
        pose[:3, 0] = right / np.linalg.norm(right)
        pose[:3, 1] = np.cross(back, pose[:3, 0])
        pose[:3, 2], pose[:3, 3] = back, at
        if hidden:
            origin, direction = rays_of(pose)
            if np.isin(numbers.shown(intersect(scene, origin, direction), direction), hidden).any():
                continue
        poses.append(pose)
    return poses
