"""The plan of a furnished room: walls with openings, ceilings, a sky, and where cameras can stand.

Lengths are in metres, y is up. A plan's corners are (x, z) in the order in which the walls' insides face the room:
(0, 0), (w, 0), (w, d), (0, d) for a box. A sky is a map of radiance [height][width][3] over directions, whose first
and last row are the poles: row (height - 1) acos(y) / pi, column width atan2(x, -z) / 2 pi, as Mitsuba 3 reads it."""
import numpy as np

from furniture import SATIN, Catalogue, box, join, make_part, material, quad

CLEARANCE = 0.25  # of cameras from furniture
WALL_CLEARANCE = 0.4


class Room:
    """Parts, the boxes where no camera can stand, and the parts that no camera may show."""

    def __init__(self, size, rng):
        self.size, self.rng, self.catalogue = np.array(size), rng, Catalogue()
        self.parts, self.boxes, self.sky, self.sun = [], [], None, None
        self.corners, self.hidden = None, set()
        self.single_exposure = 0.25  # what the median of all photographs becomes in the variant of one exposure

    def add(self, *parts, blocks=False, hidden=False):
        if hidden:
            self.hidden.update(range(len(self.parts), len(self.parts) + len(parts)))
        self.parts.extend(parts)
        if blocks:
            points = np.concatenate([p.positions for p in parts])
            self.boxes.append((points.min(0) - CLEARANCE, points.max(0) + CLEARANCE))

    def model(self, name, at, blocks=True, **how):
        self.add(*self.catalogue.model(name, at, **how), blocks=blocks)

    def models(self, *rows):
        """Rows of (name, at, how)."""
        for name, at, how in rows:
            self.model(name, at, **how)

    def keep_out(self, low, high):
        """No camera stands in this box."""
        self.boxes.append((np.array(low, float), np.array(high, float)))

    def plan(self, corners, height, floor, wall, ceiling, openings=None, names=None):
        """Walls along the corners, floor, and a ceiling (None: the room adds its own). openings[k]: those of wall k, as
        (s0, s1, y0, y1) with s along the wall from its first corner. wall: a material, or one for each wall."""
        self.corners = np.array(corners, float)
        walls = wall if isinstance(wall, list) else [wall] * len(corners)
        self.add(polygon("floor", [(x, 0, z) for x, z in corners[::-1]], floor, 1.6))
        if ceiling is not None:
            self.add(polygon("ceiling", [(x, height, z) for x, z in corners], ceiling))
        for k, (at, to) in enumerate(zip(self.corners, np.roll(self.corners, -1, 0))):
            at, along = np.array((at[0], 0, at[1])), np.array((to[0] - at[0], 0, to[1] - at[1]))
            holes = (openings or {}).get(k, ())
            name = names[k] if names else f"wall-{k}"
            self.add(panel(name, at, along, (0, height, 0), walls[k], holes))
            for hole in holes:
                self.reveal(at, along, (0, 1, 0), hole)

    def reveal(self, at, along, up, hole, deep=0.2, thick=0.04, bars=1):
        """The frame around an opening of a panel, outside of it, with so many bars; the panel is axis-aligned."""
        along, up = (np.array(v, float) / np.linalg.norm(v) for v in (along, up))
        out = np.cross(up, along)
        white = material(SATIN, color=(0.8, 0.8, 0.78))
        s0, s1, t0, t1 = hole

        def block(name, a0, a1, b0, b1, c0, c1):
            edges = [np.array(at) + along * a + up * b + out * c for a, b, c in ((a0, b0, c0), (a1, b1, c1))]
            return box(name, np.minimum(*edges), np.maximum(*edges), white)

        for a0, a1, b0, b1 in ((s0 - thick, s1 + thick, t0 - thick, t0), (s0 - thick, s1 + thick, t1, t1 + thick),
                               (s0 - thick, s0, t0, t1), (s1, s1 + thick, t0, t1)):
            self.add(block("reveal", a0, a1, b0, b1, 0.001, deep))
        for k in range(bars):
            middle = s0 + (s1 - s0) * (k + 1) / (bars + 1)
            self.add(block("mullion", middle - 0.03, middle + 0.03, t0, t1, 0.08, 0.13))

    def add_sun(self, direction, radiance, radius_deg=3.0):
        """A disc around the direction, in the sky that is there."""
        up, around = directions(*self.sky.shape[:2])
        toward = np.array(direction) / np.linalg.norm(direction)
        cosine = np.sqrt(1 - up * up) * (np.sin(around) * toward[0] - np.cos(around) * toward[2]) + up * toward[1]
        disc = np.where(cosine > np.cos(np.radians(radius_deg)), radiance, (0.0, 0.0, 0.0))
        solid_angle = np.sqrt(1 - up * up) * (np.pi / (len(disc) - 1)) * (2 * np.pi / disc.shape[1])
        self.sky = self.sky + disc
        self.sun = {"direction": toward, "radius_deg": radius_deg, "disc": disc,
                    "irradiance": (disc * solid_angle).sum((0, 1)).tolist()}

    def walls(self, floor, wall, ceiling, windows=()):
        """A box, with windows in the wall of greatest x: (z0, z1, y0, y1)."""
        w, h, d = self.size
        self.add(quad("floor", (0, 0, 0), (0, 0, d), (w, 0, 0), floor, (d / 1.6, w / 1.6)),
                 quad("ceiling", (0, h, 0), (w, 0, 0), (0, 0, d), ceiling),
                 quad("wall-x0", (0, 0, d), (0, 0, -d), (0, h, 0), wall, (d, h)),
                 quad("wall-z0", (0, 0, 0), (w, 0, 0), (0, h, 0), wall, (w, h)),
                 quad("wall-z1", (w, 0, d), (-w, 0, 0), (0, h, 0), wall, (w, h)),
                 panel("wall-x1", (w, 0, 0), (0, 0, d), (0, h, 0), wall, windows))
        for z0, z1, y0, y1 in windows:
            self.window(w, z0, z1, y0, y1)

    def window(self, x, z0, z1, y0, y1, deep=0.2, thick=0.04):
        white = material(SATIN, color=(0.8, 0.8, 0.78))
        sides = ((y0 - thick, y0, z0 - thick, z1 + thick), (y1, y1 + thick, z0 - thick, z1 + thick),
                 (y0, y1, z0 - thick, z0), (y0, y1, z1, z1 + thick))
        self.add(*(box("reveal", (x, low, a), (x + deep, high, b), white) for low, high, a, b in sides))
        middle = (z0 + z1) / 2
        self.add(box("mullion", (x + 0.08, y0, middle - 0.03), (x + 0.13, y1, middle + 0.03),
                     material(color=(0.8, 0.8, 0.78))))

    def has_place(self, at):
        """Whether a camera can stand there."""
        if any(np.all((at > low) & (at < high)) for low, high in self.boxes):
            return False
        return self.corners is None or inside(self.corners, at[[0, 2]], WALL_CLEARANCE)


def inside(corners, point, margin):
    """Whether a point lies in a polygon and so far from its edges."""
    odd = False
    for a, b in zip(corners, np.roll(corners, -1, 0)):
        edge = b - a
        nearest = a + edge * np.clip(np.dot(point - a, edge) / np.dot(edge, edge), 0, 1)
        if np.linalg.norm(point - nearest) < margin:
            return False
        if (a[1] > point[1]) != (b[1] > point[1]) and point[0] < a[0] + edge[0] * (point[1] - a[1]) / edge[1]:
            odd = not odd
    return odd


def panel(name, corner, a, b, of, holes=()):
    """A rectangle that faces a x b, less holes (s0, s1, t0, t1) in metres along a and b."""
    corner, a, b = (np.array(v, float) for v in (corner, a, b))
    wide, high = np.linalg.norm(a), np.linalg.norm(b)
    a, b = a / wide, b / high
    s_cuts = sorted({0.0, wide, *(s for hole in holes for s in hole[:2])})
    t_cuts = sorted({0.0, high, *(t for hole in holes for t in hole[2:])})
    cells = [quad(name, corner + a * s0 + b * t0, a * (s1 - s0), b * (t1 - t0), of, (s1 - s0, t1 - t0))
             for s0, s1 in zip(s_cuts, s_cuts[1:]) for t0, t1 in zip(t_cuts, t_cuts[1:])
             if not any(h[0] <= s0 and s1 <= h[1] and h[2] <= t0 and t1 <= h[3] for h in holes)]
    return join(name, cells, of)


def polygon(name, points, of, texture_size=1.0):
    """A planar polygon without holes, counter-clockwise as seen from where it faces; its texture is so many metres."""
    points = np.array(points, float)
    normal = sum(np.cross(p - points[0], q - points[0]) for p, q in zip(points[1:], points[2:]))
    normal /= np.linalg.norm(normal)
    side = np.cross((0, 1, 0), normal) if abs(normal[1]) < 0.9 else np.array((1.0, 0, 0))
    side -= normal * np.dot(side, normal)
    side /= np.linalg.norm(side)
    uv = np.stack([points @ side, points @ np.cross(normal, side)], 1) / texture_size
    left, faces = list(range(len(points))), []
    while len(left) > 2:
        ear = next(k for k in range(len(left)) if is_ear(points, left, k, normal))
        faces.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return make_part(name, points, [normal] * len(points), uv, faces, of)


def is_ear(points, left, k, normal):
    """Whether corner k of the polygon can be cut off: convex, and no other corner in its triangle."""
    triangle = [points[left[k - 1]], points[left[k]], points[left[(k + 1) % len(left)]]]

    def area(a, b, c):
        return np.dot(np.cross(b - a, c - a), normal)

    if area(*triangle) <= 1e-9:
        return False
    a, b, c = triangle
    others = [points[i] for j, i in enumerate(left) if j not in ((k - 1) % len(left), k, (k + 1) % len(left))]
    return not any(area(a, b, p) >= 0 and area(b, c, p) >= 0 and area(c, a, p) >= 0 for p in others)


# --- skies ---------------------------------------------------------------------------------------


def directions(height=128, width=256):
    """Of the pixels of a sky: the sine of elevation [height][1][1], the azimuth [1][width][1]."""
    up = np.cos(np.pi * np.arange(height) / (height - 1))[:, None, None]
    return up, (2 * np.pi * (np.arange(width) + 0.5) / width)[None, :, None]


def overcast(zenith, ground, height=128, width=256):
    """The sky of an overcast day (Moon & Spencer 1942): at the horizon a third of the radiance of the zenith."""
    up, around = directions(height, width)
    return np.where(up > 0, np.array(zenith) * (1 + 2 * np.maximum(up, 0)) / 3, ground) * np.ones_like(around)


def clouds(sky, rng, deep, cells=(9, 18)):
    """Brighter and darker patches above the horizon, by a factor of exp(+-deep)."""
    up, around = directions(*sky.shape[:2])
    grid = rng.uniform(-deep, deep, cells)
    rows = np.interp(np.linspace(0, cells[0] - 1, sky.shape[0]), np.arange(cells[0]), np.arange(cells[0]))
    columns = np.linspace(0, cells[1], sky.shape[1], endpoint=False)
    j, i = rows.astype(int), columns.astype(int)
    v, u = (rows - j)[:, None], (columns - i)[None, :]
    at = [[grid[np.minimum(j + b, cells[0] - 1)][:, (i + a) % cells[1]] for a in (0, 1)] for b in (0, 1)]
    mixed = (1 - v) * ((1 - u) * at[0][0] + u * at[0][1]) + v * ((1 - u) * at[1][0] + u * at[1][1])
    return sky * np.where(up > 0, np.exp(mixed)[..., None], 1.0)
