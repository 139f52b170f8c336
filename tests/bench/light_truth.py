"""The truth of a furnished room's light: truth/lights.json, and its sky as truth/environment.exr.

lights.json:
  sources   of each part that emits: kind "lamp", object, name, radiance (mean), area (m^2), power (radiance x area x pi),
            pixels: those of all training photographs that show any of it (from its front; in mirrors does not count),
            hidden: fewer than HIDDEN_PIXELS.
            kind "sky": pixels. kind "sun": direction (towards it), radius_deg, irradiance (on what faces it), pixels.
  segments  of each object that training photographs show: how many points of it were measured, its mean irradiance there
            (all bounces) and the shares of it: of each hidden lamp by its object, of the sky, the sun, and "lamps",
            all others together. Points lie as photographs show them: what they show from near has more.
environment.exr: radiance, row (height - 1) acos(y) / pi, column width atan2(x, -z) / 2 pi; with the sun's disc."""
import json

import drjit as dr
import mitsuba as mi
import numpy as np

from rendering import Numbers, intersect, rays_of, scene_of

STEP = 4       # every such pixel is a point where irradiance is measured
AT_ONCE = 32   # samples of all points at once
DEPTH = 16
HIDDEN_PIXELS = 8  # a few edges of pixels do not show a lamp
OFFSETS = ((0.125, 0.375), (0.375, 0.875), (0.625, 0.125), (0.875, 0.625))  # in a pixel: what it shows


def emitters(room):
    return [k for k, part in enumerate(room.parts) if np.max(part.material.emission) > 0]


def area(part):
    a, b, c = (part.positions[part.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def pixels_shown(room, scene, poses):
    """Of each part the training pixels that show its front; of the sky; of the sun."""
    numbers, counts, sky, sun = Numbers(scene), np.zeros(len(room.parts), int), 0, 0
    for pose in poses:
        origin = pose[:3, 3]
        direction = np.concatenate([rays_of(pose, 1, offset)[1] for offset in OFFSETS])
        hit = intersect(scene, origin, direction)
        none = ~np.array(hit.is_valid())
        shown = np.where(none, -2, numbers.shown(hit, direction))
        if room.sun:
            shown[none & (direction @ room.sun["direction"] > np.cos(np.radians(room.sun["radius_deg"])))] = -3
        shown = shown.reshape(len(OFFSETS), -1)
        for number in np.unique(shown[shown >= 0]):
            counts[number] += (shown == number).any(0).sum()
        sky, sun = sky + int((shown == -2).any(0).sum()), sun + int((shown == -3).any(0).sum())
    return counts, sky, sun


def points_of(scene, poses):
    """First hits of every STEP-th pixel: origins, directions, numbers of parts."""
    numbers, origins, directions, found = Numbers(scene), [], [], []
    for pose in poses:
        origin, direction = rays_of(pose, STEP, (STEP / 2, STEP / 2))
        number = numbers(intersect(scene, origin, direction))
        origins.append(np.broadcast_to(origin, direction.shape)[number >= 0])
        directions.append(direction[number >= 0])
        found.append(number[number >= 0])
    return np.concatenate(origins), np.concatenate(directions), np.concatenate(found)


def can_measure(room):
    """Mitsuba 3.9 looks a texture's place on a mesh up by rays of its own, which a CUDA kernel cannot mix with others."""
    return not mi.variant().startswith("cuda") or all(np.ndim(room.parts[k].material.emission) == 1 for k in emitters(room))


def irradiance(scene, points, samples, parts):
    """Mean over the points of each part [parts][3], on the side that the photograph shows."""
    origins, directions, numbers = points
    path = mi.load_dict({"type": "path", "max_depth": DEPTH, "rr_depth": 8, "hide_emitters": True})
    total = np.zeros((parts, 3))
    rounds = max(1, samples // AT_ONCE)
    repeat = min(samples, AT_ONCE)
    for seed in range(rounds):
        hit = intersect(scene, np.repeat(origins, repeat, 0), np.repeat(directions, repeat, 0))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(numbers) * repeat)
        normal = dr.select(dr.dot(hit.n, hit.to_world(hit.wi)) > 0, hit.n, -hit.n)
        hit.n = normal
        frame = mi.Frame3f(normal)
        light, weight = scene.sample_emitter_direction(hit, sampler.next_2d(), True)
        direct = weight * dr.maximum(dr.dot(light.d, normal), 0) & (light.pdf > 0)
        away = frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        bounced, _, _ = path.sample(scene, sampler, hit.spawn_ray(away))
        arrived = np.array(direct + bounced * np.pi).reshape(3, -1)
        arrived[~np.isfinite(arrived)] = 0
        for c in range(3):
            total[:, c] += np.bincount(numbers, arrived[c].reshape(-1, repeat).mean(1), parts)
    return total / np.maximum(np.bincount(numbers, minlength=parts), 1)[:, None] / rounds


def sources_of(room, counts, sky_pixels, sun_pixels):
    found = []
    for k in emitters(room):
        part = room.parts[k]
        radiance = np.reshape(part.material.emission, (-1, 3)).mean(0)
        found.append({"kind": "lamp", "object": k, "name": part.name, "radiance": radiance.tolist(), "area": area(part),
                      "power": (radiance * area(part) * np.pi).tolist(), "pixels": int(counts[k]),
                      "hidden": bool(counts[k] < HIDDEN_PIXELS)})
    if room.sky is not None:
        found.append({"kind": "sky", "pixels": sky_pixels})
    if room.sun:
        found.append({"kind": "sun", "direction": list(map(float, room.sun["direction"])),
                      "radius_deg": room.sun["radius_deg"], "irradiance": room.sun["irradiance"], "pixels": sun_pixels})
    return found


def write(room, scene, poses, out, samples):
    """poses: of training."""
    if not can_measure(room):
        raise RuntimeError("the light of a part that shines by a texture is measured by the variant llvm_ad_rgb only")
    found = sources_of(room, *pixels_shown(room, scene, poses))
    points = points_of(scene, poses)
    hidden = [s["object"] for s in found if s.get("hidden")]
    shown = {s["object"] for s in found if s["kind"] == "lamp" and not s["hidden"]}
    lights = {str(k): ({k}, None) for k in hidden}
    if shown:
        lights["lamps"] = (shown, None)
    if room.sky is not None:
        lights["sky"] = (set(), room.sky - (room.sun["disc"] if room.sun else 0))
        mi.Bitmap(room.sky.astype(np.float32)).write(out + "/truth/environment.exr")
    if room.sun:
        lights["sun"] = (set(), room.sun["disc"])
    by_light = {name: irradiance(scene_of(room, *light), points, samples, len(room.parts))
                for name, light in lights.items()}
    total = sum(by_light.values())
    measured = np.bincount(points[2], minlength=len(room.parts))
    segments = [{"object": k, "points": int(measured[k]), "irradiance": total[k].tolist(),
                 "shares": {name: float(of[k].sum() / max(total[k].sum(), 1e-12)) for name, of in by_light.items()}}
                for k in range(len(room.parts)) if measured[k] > 0]
    with open(out + "/truth/lights.json", "w") as file:
        json.dump({"sources": found, "segments": segments}, file, indent=1)
