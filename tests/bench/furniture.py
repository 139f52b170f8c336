"""Parts of a furnished room: simple shapes, procedural textures, and models of Sweet Home 3D.

A part has one material. The models come from Debian's package sweethome3d-furniture (CC0 and CC BY: zip
archives of Wavefront OBJ files); each of their materials becomes a part, and what of them is transparent is
left out. Lengths are in metres, y is up, colours are linear."""
import glob
import zipfile
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

CATALOGUES = "/usr/share/sweethome3d/furniture/*.sh3f"
DARKEST, BRIGHTEST = 0.02, 0.92  # base colours stay between
# Repeats of a texture. Two models have places 3.4e9 repeats away, where Mitsuba reads outside of the picture.
FARTHEST_UV = 1000.0


@dataclass
class Material:
    color: tuple = (0.5, 0.5, 0.5)
    texture: np.ndarray = None  # [height][width][3] in place of the colour
    roughness: float = 1.0
    specular: float = 0.0
    emission: tuple = (0.0, 0.0, 0.0)  # or a texture


MATT = Material()
SATIN = Material(roughness=0.3162, specular=0.5)
POLISHED = Material(roughness=0.15, specular=0.5)
METAL = Material(roughness=0.2, specular=1.0)


def material(kind=MATT, **changes):
    return Material(**{**vars(kind), **changes})


@dataclass
class Part:
    name: str
    positions: np.ndarray  # [vertices][3]
    normals: np.ndarray    # [vertices][3]
    uv: np.ndarray         # [vertices][2]
    faces: np.ndarray      # [triangles][3]
    material: Material


def make_part(name, positions, normals, uv, faces, of):
    part = Part(name, np.array(positions, float), np.array(normals, float), np.array(uv, float),
                np.array(faces, int), of)
    lengths = np.linalg.norm(part.normals, axis=1)
    if not np.isfinite(part.positions).all() or not (np.abs(lengths - 1) < 1e-3).all() or \
            not (np.abs(part.uv) <= FARTHEST_UV).all():
        raise ValueError(f"{name}: positions, normals or texture coordinates that cannot be rendered")
    return part


# --- shapes --------------------------------------------------------------------------------------


def quad(name, corner, a, b, of, repeat=(1.0, 1.0)):
    """A parallelogram that faces a x b, its texture repeated along a and b."""
    corner, a, b = (np.array(x, float) for x in (corner, a, b))
    normal = np.cross(a, b)
    s, t = repeat
    return make_part(name, [corner, corner + a, corner + a + b, corner + b], [normal / np.linalg.norm(normal)] * 4,
                     [(0, 0), (s, 0), (s, t), (0, t)], [(0, 1, 2), (0, 2, 3)], of)


def join(name, parts, of):
    faces, first = [], 0
    for part in parts:
        faces.append(part.faces + first)
        first += len(part.positions)
    stack = [np.concatenate([getattr(p, k) for p in parts]) for k in ("positions", "normals", "uv")]
    return Part(name, *stack, np.concatenate(faces), of)


def box(name, low, high, of):
    low, high = np.array(low, float), np.array(high, float)
    x, y, z = np.diag(high - low)
    sides = [(low, z, y), (low + x, y, z), (low, x, z), (low + y, z, x), (low, y, x), (low + z, x, y)]
    return join(name, [quad(name, *side, of) for side in sides], of)


def sphere(name, center, radius, of, rows=24):
    theta, phi = np.meshgrid(np.pi * np.arange(rows + 1) / rows, np.pi * np.arange(2 * rows + 1) / rows, indexing="ij")
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    faces, step = [], 2 * rows + 1
    for at in (j * step + i for j in range(rows) for i in range(2 * rows)):
        if at >= step:  # at the poles one of the two triangles is empty
            faces.append((at, at + step + 1, at + 1))
        if at < (rows - 1) * step:
            faces.append((at, at + step, at + step + 1))
    uv = np.stack([phi / (2 * np.pi), theta / np.pi], -1).reshape(-1, 2)
    return make_part(name, unit * radius + np.array(center), unit, uv, faces, of)


# --- textures ------------------------------------------------------------------------------------


def noise(height, width, cells, rng):
    """Smooth noise in [0, 1] with so many (rows, columns) of cells."""
    grid = rng.random(cells).astype(np.float32)
    y, x = (np.linspace(0, n - 1, size) for n, size in zip(cells, (height, width)))
    rows = np.stack([np.interp(y, np.arange(cells[0]), column) for column in grid.T], 1)
    return np.stack([np.interp(x, np.arange(cells[1]), row) for row in rows])


def planks(rng, count=8, size=512, color=(0.36, 0.2, 0.1)):
    texture, plank = np.zeros((size, size, 3)), size // count
    for k in range(count):
        grain = 0.4 * noise(plank, size, (4, 4), rng) + 0.5 * noise(plank, size, (plank // 2, 6), rng)
        shade = (0.6 + 0.8 * grain) * (0.8 + 0.4 * rng.random())
        texture[k * plank:(k + 1) * plank] = shade[..., None] * color
        texture[k * plank:k * plank + 2] *= 0.35
    return np.clip(texture, DARKEST, BRIGHTEST)


def tiles(rng, colors, count=4, size=512, joint=(0.3, 0.3, 0.3), joint_width=4):
    texture, tile = np.zeros((size, size, 3)), size // count
    for j in range(count):
        for i in range(count):
            color = np.array(colors[(i + j) % len(colors)]) * (0.9 + 0.2 * rng.random())
            shade = 0.95 + 0.1 * noise(tile, tile, (6, 6), rng)
            texture[j * tile:(j + 1) * tile, i * tile:(i + 1) * tile] = shade[..., None] * color
    for k in range(joint_width):
        texture[k::tile] = texture[:, k::tile] = joint
    return np.clip(texture, DARKEST, BRIGHTEST)


def stripes(rng, a, b, count=8, size=256):
    odd = (np.arange(size) * 2 * count // size) % 2
    return np.where(odd[None, :, None], a, b) * (0.93 + 0.14 * noise(size, size, (40, 40), rng)[..., None])


def picture(rng, height=200, width=280):
    texture = np.stack([noise(height, width, (5, 5), rng) for _ in range(3)], -1) ** 1.5
    texture[:height // 3] = 0.4 * texture[:height // 3] + 0.6 * np.array((0.3, 0.45, 0.7))
    return np.clip(texture, DARKEST, BRIGHTEST)


# --- models --------------------------------------------------------------------------------------


class Catalogue:
    """The models by name, as in "scopia/teapot"."""

    def __init__(self):
        self.archive_of = {}
        for path in sorted(glob.glob(CATALOGUES)):
            archive = zipfile.ZipFile(path)
            self.archive_of.update({name: archive for name in archive.namelist()})

    def lines(self, name):
        return self.archive_of[name].read(name).decode(errors="replace").splitlines()

    def texture(self, name):
        data = self.archive_of[name].read(name)
        stream = mi.MemoryStream()
        stream.write(data)
        stream.seek(0)
        bitmap = mi.Bitmap(stream).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
        return np.clip(np.array(bitmap), DARKEST, BRIGHTEST)

    def materials(self, name):
        """Of an MTL file, None for what is transparent. A strong, narrow highlight makes a glossy one."""
        found, fields = {}, {}
        for word in (line.split() for line in self.lines(name) if line.strip()):
            if word[0] == "newmtl":
                fields = found[" ".join(word[1:])] = {}
            elif word[0] in ("Kd", "Ks", "Ns", "d"):
                fields[word[0]] = [float(x) for x in word[1:]]
            elif word[0] == "map_Kd":
                fields["map"] = name.rsplit("/", 1)[0] + "/" + word[-1]
        return {key: self.material(value) for key, value in found.items()}

    def material(self, fields):
        shine = fields.get("Ns", [0])[0]
        if fields.get("d", [1])[0] < 0.5:
            return None
        kind = MATT if max(fields.get("Ks", [0])) <= 0.25 or shine <= 20 else SATIN if shine < 200 else POLISHED
        color = np.array(fields.get("Kd", (0.6, 0.6, 0.6)))
        linear = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
        texture = self.texture(fields["map"]) if fields.get("map") in self.archive_of else None
        return material(kind, color=tuple(np.clip(linear, DARKEST, 0.9)), texture=texture)

    def model(self, name, at, height=None, width=None, turned=0.0, kind=None):
        """Parts of a model that stands at a place, scaled to a height or a width, turned by so many degrees;
        of one material if one is given."""
        corners, groups, materials = [], {}, {}
        arrays = {"v": [], "vt": [], "vn": []}
        base = f"{name}/{name.rsplit('/', 1)[1]}"
        group = None
        for word in (line.split() for line in self.lines(base + ".obj") if line.strip()):
            if word[0] in arrays:
                arrays[word[0]].append([float(x) for x in word[1:4]])
            elif word[0] == "mtllib":
                materials.update(self.materials(f"{name}/{' '.join(word[1:])}"))
            elif word[0] == "usemtl":
                group = " ".join(word[1:])
            elif word[0] == "f":
                corners = [self.corner(text, arrays) for text in word[1:]]
                groups.setdefault(group, []).extend(
                    (corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1))
        positions, rotation = self.place(np.array(arrays["v"]), groups, at, height, width, turned)
        parts = []
        for group, triangles in groups.items():
            of = kind or materials.get(group, MATT)
            part = of and self.part(f"{name}/{group}", triangles, positions, rotation, arrays, of)
            if part:
                parts.append(part)
        return parts

    @staticmethod
    def corner(text, arrays):
        """Places of position, texture coordinate and normal; -1 for what is not there."""
        numbers = [int(x) if x else 0 for x in (text.split("/") + ["", ""])[:3]]
        return tuple(n - 1 if n >= 0 else len(a) + n for n, a in zip(numbers, arrays.values()))

    @staticmethod
    def place(positions, groups, at, height, width, turned):
        used = positions[np.unique([corner[0] for g in groups.values() for t in g for corner in t])]
        low, high = used.min(0), used.max(0)
        scale = height / (high[1] - low[1]) if height else width / (high[0] - low[0])
        c, s = np.cos(np.radians(turned)), np.sin(np.radians(turned))
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        return (positions - foot) * scale @ rotation.T + np.array(at), rotation

    @staticmethod
    def part(name, triangles, positions, rotation, arrays, of):
        """A vertex for every different corner; facets of their own where there is no normal."""
        number, vertices, normals, uv, faces = {}, [], [], [], []
        for triangle in triangles:
            p = np.float32([positions[corner[0]] for corner in triangle]).astype(float)  # as they are rendered
            facet = np.cross(p[1] - p[0], p[2] - p[0])
            length = np.linalg.norm(facet)
            if not length > 1e-12:
                continue
            face = []
            for corner in triangle:
                key = corner if corner[2] >= 0 else (corner[0], corner[1], tuple(np.round(facet / length, 3)))
                if key not in number:
                    normal = rotation @ arrays["vn"][corner[2]] if corner[2] >= 0 else facet / length
                    size = np.linalg.norm(normal)
                    number[key] = len(vertices)
                    vertices.append(positions[corner[0]])
                    normals.append(normal / size if size > 1e-6 else facet / length)
                    place = arrays["vt"][corner[1]][:2] if corner[1] >= 0 else (0.0, 0.0)
                    uv.append(place if np.abs(place).max() <= FARTHEST_UV else (0.0, 0.0))
                face.append(number[key])
            faces.append(face)
        return make_part(name, vertices, normals, uv, faces, of) if faces else None
