"""Six rooms to report on, reconstructed once, when nothing is left to choose: their figures must never choose anything.
Of other plans, things and lamps than those of rooms_choice.py.

  workshop   under a roof of one slope; a tube; cold strips below a shelf and in a locker that no photograph shows
  studio     a U around a store; an overcast sky through tall windows and a strip of roof; one lamp
  passage    long and low sun through a row of small windows; a niche with a lamp behind its lintel
  bar        a cut corner; bulbs, neon, a bright street: one exposure saturates them; a strip under the bar's edge
  office     an L; three screens: black, a page, a picture; panels, light above a cornice
  washroom   eight walls, white, glossy tiles; light behind a mirror and below a bench that no photograph shows
"""
import numpy as np

from furniture import METAL, POLISHED, SATIN, box, join, material, noise, picture, planks, quad, sphere, stripes, tiles
from room_plan import Room, clouds, directions, overcast, panel, polygon

STEEL = material(METAL, color=(0.6, 0.6, 0.62))


def lamp(name, low, a, b, radiance):
    """A parallelogram that faces a x b."""
    return quad(name, low, a, b, material(emission=radiance))


def workshop(rng):
    width, deep, front, back = 5.4, 3.8, 3.1, 2.1
    room = Room((width, front, deep), rng)
    room.corners = np.array(((0, 0), (width, 0), (width, deep), (0, deep)))
    block = material(texture=tiles(rng, ((0.55, 0.53, 0.5), (0.5, 0.49, 0.46)), count=5, joint=(0.4, 0.39, 0.37)))
    plaster = material(color=(0.52, 0.56, 0.48))
    room.add(polygon("floor", ((0, 0, 0), (0, 0, deep), (width, 0, deep), (width, 0, 0)),
                     material(texture=0.3 + 0.15 * np.repeat(noise(512, 512, (30, 30), rng)[..., None], 3, 2)), 2.5),
             panel("wall-z0", (0, 0, 0), (width, 0, 0), (0, front, 0), block),
             panel("wall-z1", (width, 0, deep), (-width, 0, 0), (0, back, 0), plaster),
             polygon("wall-x0", ((0, 0, deep), (0, 0, 0), (0, front, 0), (0, back, deep)), plaster),
             polygon("wall-x1", ((width, 0, 0), (width, 0, deep), (width, back, deep), (width, front, 0)), plaster),
             panel("roof", (0, front, 0), (width, 0, 0), (0, back - front, deep),
                   material(texture=planks(rng, count=6, color=(0.6, 0.45, 0.28)))))
    room.keep_out((0, 0, 3.4), (width, 3, deep))
    wood = material(SATIN, texture=planks(rng, color=(0.5, 0.34, 0.18)))
    room.add(box("bench-top", (1.0, 0.86, 3.15), (5.0, 0.92, 3.79), wood),
             *(box("bench-leg", (x, 0, 3.25), (x + 0.09, 0.86, 3.7), wood) for x in (1.1, 2.4, 3.6, 4.8)),
             box("bench-drawers", (2.6, 0.2, 3.3), (3.5, 0.86, 3.75), material(SATIN, color=(0.5, 0.1, 0.06))), blocks=True)
    room.add(box("wall-shelf", (1.2, 1.52, 3.52), (4.8, 1.55, 3.796), wood),
             box("shelf-lip", (1.2, 1.44, 3.52), (4.8, 1.52, 3.545), wood))
    for x in (1.4, 2.75, 4.1):
        room.add(lamp("below-shelf", (x, 1.515, 3.62), (0.55, 0, 0), (0, 0, 0.05), (20, 23, 26)), hidden=True)
    locker = material(roughness=0.4472, specular=0.5, color=(0.16, 0.3, 0.42))
    room.add(box("locker-side", (0.01, 0, 0.9), (0.5, 1.7, 0.92), locker), box("locker-side", (0.01, 0, 1.68), (0.5, 1.7, 1.7), locker),
             box("locker-top", (0.01, 1.7, 0.9), (0.5, 1.72, 1.7), locker), box("locker-lip", (0.47, 1.58, 0.92), (0.5, 1.7, 1.68), locker),
             *(box("locker-board", (0.01, y, 0.92), (0.46, y + 0.02, 1.68), locker) for y in (0.4, 0.95)), blocks=True)
    room.add(lamp("in-locker", (0.3, 1.695, 1.0), (0.05, 0, 0), (0, 0, 0.6), (18, 16, 12)), hidden=True)
    room.add(box("tube-case", (1.7, 2.46, 1.1), (3.3, 2.52, 1.22), STEEL),
             lamp("tube", (1.75, 2.455, 1.135), (1.5, 0, 0), (0, 0, 0.05), (34, 36, 36)),
             lamp("machine-light", (5.385, 1.05, 1.2), (0, 0, 0.05), (0, 0.05, 0), (6, 0.6, 0.3)))
    room.models(
        ("blendswap-cc-0/motorbike", (3.2, 0, 1.2), dict(width=1.6, turned=15)),
        ("blendswap-cc-0/barrel", (0.5, 0, 3.2), dict(height=0.85)),
        ("blendswap-cc-0/crate", (4.9, 0, 0.5), dict(height=0.5, turned=12)),
        ("scopia/step-ladder-wood", (1.1, 0, 0.4), dict(height=1.3)),
        ("katorlegaz/utility-shelving", (5.15, 0, 2.2), dict(height=1.7, turned=-90)),
        ("blendswap-cc-by/radio", (1.7, 0.93, 3.5), dict(height=0.2, turned=180)),
        ("blendswap-cc-0/ammoBox", (2.2, 0.93, 3.5), dict(height=0.2, turned=170)),
        ("blendswap-cc-by/kitchenTools", (3.3, 0.93, 3.5), dict(height=0.25)),
        ("scopia/marteau", (3.9, 0.93, 3.45), dict(height=0.05)),
        ("scopia/cardboard-box", (0.25, 0.42, 1.3), dict(height=0.3)),
        ("scopia/pottery", (0.25, 0.97, 1.3), dict(height=0.25)),
        ("blendswap-cc-by/green_stool", (2.2, 0, 2.4), dict(height=0.5)),
        ("blendswap-cc-0/fireExtinguisher", (5.25, 0.5, 3.1), dict(height=0.5)),
        ("scopia/broom", (2.2, 0, 0.25), dict(height=1.3)))
    return room


def studio(rng):
    room = Room((6.0, 3.2, 4.5), rng)
    wall, store = material(color=(0.72, 0.7, 0.66)), material(texture=planks(rng, count=12, color=(0.4, 0.36, 0.3)))
    room.plan(((0, 0), (6, 0), (6, 4.5), (4, 4.5), (4, 2.2), (2.2, 2.2), (2.2, 4.5), (0, 4.5)), 3.2,
              floor=material(roughness=0.5, specular=0.5, texture=planks(rng, count=7, color=(0.42, 0.3, 0.2))),
              wall=[wall, material(color=(0.3, 0.38, 0.3)), wall, store, store, store, wall, wall], ceiling=None,
              openings={0: ((0.5, 1.1, 0.4, 2.6), (2.7, 3.3, 0.4, 2.6), (4.8, 5.4, 0.4, 2.6)), 7: ((1.6, 2.6, 1.0, 2.4),)})
    # A strip of roof over the passage is open; over the legs the ceiling is closed.
    white = material(color=(0.8, 0.8, 0.8))
    room.add(panel("ceiling", (0, 3.2, 0), (6, 0, 0), (0, 0, 2.2), white, ((1.5, 4.5, 1.5, 2.0),)),
             panel("ceiling", (0, 3.2, 2.2), (2.2, 0, 0), (0, 0, 2.3), white),
             panel("ceiling", (4, 3.2, 2.2), (2, 0, 0), (0, 0, 2.3), white))
    for x0, x1, z0, z1 in ((1.46, 1.5, 1.46, 2.04), (4.5, 4.54, 1.46, 2.04), (1.5, 4.5, 1.46, 1.5), (1.5, 4.5, 2.0, 2.04)):
        room.add(box("roof-frame", (x0, 3.2, z0), (x1, 3.4, z1), white))
    for x, z in ((0.5, 3.6), (5.3, 3.9)):
        room.add(box("canvas", (x - 0.3, 0.8, z), (x + 0.3, 1.6, z + 0.03), material(color=(0.75, 0.72, 0.66))),
                 quad("painting", (x - 0.29, 0.81, z - 0.002), (0, 0.78, 0), (0.58, 0, 0),
                      material(texture=picture(rng))),
                 box("easel", (x - 0.02, 0, z + 0.04), (x + 0.02, 1.8, z + 0.08), material(color=(0.4, 0.26, 0.14))), blocks=True)
    room.add(box("lamp-arm", (5.0, 2.0, 3.3), (5.98, 2.03, 3.33), material(METAL, color=(0.3, 0.3, 0.3))),
             sphere("lamp", (5.0, 1.9, 3.3), 0.1, material(emission=(7, 6, 4.6))))
    room.models(
        ("scopia/table-on-trestles", (3.1, 0, 1.1), dict(height=0.75)),
        ("scopia/tubular_chair", (3.1, 0, 0.5), dict(height=0.8)),
        ("scopia/vase1", (2.9, 0.76, 1.1), dict(height=0.35)),
        ("scopia/apples", (3.5, 0.78, 1.0), dict(height=0.1)),
        ("katorlegaz/futon-couch", (0.6, 0, 2.4), dict(height=0.75, turned=90)),
        ("blendswap-cc-0/plant", (5.5, 0, 0.5), dict(height=1.2)),
        ("blendswap-cc-0/woodToy", (5.0, 0, 2.0), dict(height=0.35, turned=40)),
        ("scopia/mannequinMale", (1.6, 0, 4.0), dict(height=1.75, turned=180)),
        ("scopia/old_jar", (4.4, 0, 4.1), dict(height=0.5)),
        ("katorlegaz/trunk-large", (1.9, 0, 3.0), dict(height=0.4, turned=-90)),
        ("blendswap-cc-0/umbrella", (0.3, 0, 0.4), dict(height=0.9)),
        ("scopia/japanese_style_screen", (5.8, 0, 2.8), dict(height=1.6, turned=-90)))
    room.sky = clouds(overcast((7.5, 8.0, 8.6), (0.7, 0.9, 0.6)), rng, 0.6, cells=(7, 9))
    return room


def passage(rng):
    room = Room((8.5, 2.4, 3.6), rng)
    wall = material(color=(0.64, 0.5, 0.4))
    niche = material(texture=stripes(rng, (0.2, 0.32, 0.36), (0.3, 0.42, 0.45), count=6))
    room.plan(((0, 0), (8.5, 0), (8.5, 2.4), (6.2, 2.4), (6.2, 3.6), (4.4, 3.6), (4.4, 2.4), (0, 2.4)), 2.4,
              floor=material(roughness=0.2236, specular=0.5, texture=tiles(rng, ((0.62, 0.6, 0.55), (0.2, 0.2, 0.22)), count=4)),
              wall=[wall, wall, wall, niche, niche, niche, wall, wall], ceiling=material(color=(0.78, 0.77, 0.74)),
              openings={0: ((0.9, 1.5, 1.0, 1.9), (2.6, 3.2, 1.0, 1.9), (4.3, 4.9, 1.0, 1.9), (6.0, 6.6, 1.0, 1.9)),
                        1: ((0.7, 1.7, 0.3, 2.1),)})
    room.add(box("lintel", (4.42, 2.1, 2.44), (6.18, 2.395, 2.5), wall), box("lintel-lip", (4.42, 2.1, 2.5), (6.18, 2.13, 2.6), wall))
    room.add(lamp("behind-lintel", (4.6, 2.14, 2.54), (0, 0, 0.04), (1.4, 0, 0), (24, 19, 12)), hidden=True)
    room.add(box("niche-seat", (4.45, 0, 3.15), (6.15, 0.45, 3.59), material(SATIN, texture=planks(rng))), blocks=True)
    room.add(box("niche-cushion", (4.5, 0.451, 3.2), (6.1, 0.53, 3.55), material(color=(0.6, 0.14, 0.1))),
             quad("runner", (0.8, 0.004, 0.7), (0, 0, 1.0), (6.9, 0, 0),
                  material(texture=stripes(rng, (0.4, 0.1, 0.12), (0.5, 0.4, 0.25), count=3)), (1, 5)))
    for x in (1.0, 2.6):
        room.add(box("frame", (x, 1.1, 2.37), (x + 0.8, 1.9, 2.396), material(SATIN, color=(0.1, 0.08, 0.06))),
                 quad("print", (x + 0.04, 1.14, 2.365), (0, 0.72, 0), (0.72, 0, 0), material(POLISHED, texture=picture(rng))))
    room.add(sphere("globe", (7.4, 2.2, 1.6), 0.1, material(emission=(4.5, 4, 3.2))),
             box("globe-rod", (7.39, 2.29, 1.59), (7.41, 2.4, 1.61), STEEL))
    room.models(
        ("blendswap-cc-0/bench", (1.6, 0, 2.1), dict(height=0.45, turned=180)),
        ("blendswap-cc-by/piano", (3.4, 0, 2.1), dict(height=1.05, turned=180)),
        ("blendswap-cc-0/pianoBench", (3.4, 0, 1.45), dict(height=0.45, turned=180)),
        ("scopia/wall-hanger", (7.2, 1.5, 2.33), dict(width=0.7, turned=180, blocks=False)),
        ("blendswap-cc-by/bike", (7.4, 0, 0.35), dict(height=0.95)),
        ("scopia/woman_shoes", (6.7, 0, 2.1), dict(height=0.14, turned=150)),
        ("katorlegaz/red-wine-bottle-01", (4.7, 0.53, 3.4), dict(height=0.3)),
        ("blendswap-cc-by/luckyBamboo", (0.4, 0, 0.4), dict(height=0.9)),
        ("blendswap-cc-0/radiator1", (3.75, 0.1, 0.12), dict(height=0.55)),
        ("scopia/doormat", (0.4, 0.004, 1.5), dict(width=0.6, turned=90, blocks=False)),
        ("scopia/dog", (5.3, 0, 1.9), dict(height=0.45, turned=80)))
    up, around = directions(512, 1024)
    room.sky = np.where(up > 0, (3.4, 3.3, 3.4) - up * np.array((2.6, 2.2, 1.2)), (0.6, 0.5, 0.35)) * (1 + 0.6 * np.cos(around - 0.9))
    room.add_sun((0.5, 0.4, -0.74), (46000, 33000, 19000), radius_deg=0.5)
    return room


def bar(rng):
    room = Room((6.0, 2.9, 4.8), rng)
    wood = material(POLISHED, texture=planks(rng, count=5, color=(0.26, 0.13, 0.07)))
    green = material(color=(0.08, 0.2, 0.15))
    room.plan(((0, 0), (6, 0), (6, 3.2), (4.4, 4.8), (0, 4.8)), 2.9,
              floor=material(SATIN, texture=tiles(rng, ((0.7, 0.68, 0.64), (0.1, 0.1, 0.1)), count=8)),
              wall=[green, material(color=(0.45, 0.4, 0.3)), wood, green, green], ceiling=material(color=(0.5, 0.3, 0.25)),
              openings={1: ((0.5, 2.7, 0.9, 2.4),)})
    room.add(box("bar-body", (1.2, 0, 2.9), (4.2, 1.0, 3.3), wood),
             box("bar-top", (1.1, 1.0, 2.6), (4.3, 1.06, 3.36), material(roughness=0.12, specular=0.5, color=(0.1, 0.05, 0.03))),
             box("bar-edge", (1.1, 0.93, 2.6), (4.3, 1.0, 2.63), wood), blocks=True)
    room.add(lamp("under-bar", (1.3, 0.995, 2.68), (2.8, 0, 0), (0, 0, 0.04), (18, 7, 3)), hidden=True)
    for k in range(9):
        x = 0.7 + 0.6 * k
        room.add(box("bulb-cord", (x - 0.004, 2.32, 1.296), (x + 0.004, 2.9, 1.304), material(color=(0.05, 0.05, 0.05))),
                 sphere("bulb", (x, 2.28, 1.3), 0.045, material(emission=(48, 36, 20)), rows=12))
    room.add(lamp("neon", (0.02, 1.7, 2.6), (0, 0, -1.3), (0, 0.05, 0), (2, 14, 5)),
             lamp("neon", (0.02, 1.85, 2.6), (0, 0, -0.9), (0, 0.05, 0), (16, 3, 12)))
    glass = [material(POLISHED, color=c) for c in ((0.05, 0.2, 0.08), (0.35, 0.16, 0.04), (0.4, 0.38, 0.34))]
    for y in (1.25, 1.65):
        room.add(box("bottle-shelf", (1.4, y - 0.03, 4.5), (4.0, y, 4.79), wood))
        for k in range(9):
            room.add(*room.catalogue.model("katorlegaz/red-wine-bottle-01", (1.55 + 0.28 * k, y, 4.66),
                                           height=0.24 + 0.03 * (k % 3), kind=glass[(k + int(10 * y)) % 3]))
    room.models(
        *(("katorlegaz/bar-stool", (1.7 + 0.8 * k, 0, 2.2), dict(height=0.75)) for k in range(3)),
        ("scopia/bar_table", (0.9, 0, 1.1), dict(height=1.0)),
        ("scopia/round-table", (5.0, 0, 1.1), dict(height=0.74)),
        ("blendswap-cc-0/thonet", (4.3, 0, 1.0), dict(height=0.88, turned=90)),
        ("blendswap-cc-0/thonet", (5.2, 0, 1.9), dict(height=0.88, turned=190)),
        ("blendswap-cc-0/coffeeBrewer", (3.6, 1.06, 3.0), dict(height=0.4, turned=180)),
        ("blendswap-cc-by/mp3Station", (1.6, 1.06, 3.05), dict(height=0.18, turned=180)),
        ("scopia/candelabre", (5.0, 0.75, 1.1), dict(height=0.3)),
        ("scopia/dart_game", (2.6, 1.4, 0.05), dict(height=0.5, blocks=False)),
        ("blendswap-cc-0/decorativePlant", (5.6, 0, 2.9), dict(height=1.1)))
    room.add(quad("mirror", (3.9, 2.0, 4.79), (-2.4, 0, 0), (0, 0.6, 0),
                  material(color=(0.3, 0.31, 0.32), roughness=0.1, specular=1.0)))
    up, around = directions()
    room.sky = np.where(up > 0, (15, 15, 15.5) - up * np.array((8, 7, 5)), (5, 4.6, 4)) * (1 + 0.5 * np.sin(2 * around) * (1 - up * up))
    room.single_exposure = 0.5
    return room


def office(rng):
    room = Room((6.2, 2.7, 5.2), rng)
    grey, blue = material(color=(0.6, 0.6, 0.58)), material(color=(0.2, 0.3, 0.5))
    carpet = np.array((0.2, 0.22, 0.25)) * (0.7 + 0.6 * noise(512, 512, (200, 200), rng)[..., None])
    room.plan(((0, 0), (6.2, 0), (6.2, 5.2), (3.4, 5.2), (3.4, 2.8), (0, 2.8)), 2.7,
              floor=material(texture=carpet), wall=[grey, blue, grey, grey, grey, blue],
              ceiling=material(texture=tiles(rng, ((0.78, 0.78, 0.76),), count=3, joint=(0.5, 0.5, 0.5), joint_width=3)))
    black = material(SATIN, color=(0.03, 0.03, 0.03))
    page = np.full((160, 240, 3), 2.2)
    for row in range(16, 144, 10):
        page[row:row + 4, 16:16 + int(rng.integers(120, 208))] = 0.15
    screens = (((4.6, 0.35), np.zeros(3)), ((5.4, 0.35), page), ((1.2, 0.35), 3.5 * picture(rng) ** 1.3))
    for (x, z), emission in screens:
        shown = material(roughness=0.1, specular=0.5, color=(0.025, 0.025, 0.025), emission=emission)
        room.add(box("screen-body", (x - 0.33, 0.95, z - 0.03), (x + 0.33, 1.35, z), black),
                 quad("screen", (x - 0.31, 0.97, z + 0.003), (0.62, 0, 0), (0, 0.36, 0), shown),
                 box("screen-foot", (x - 0.03, 0.75, z - 0.04), (x + 0.03, 0.96, z - 0.02), black))
    for x, z in ((1.5, 1.4), (4.8, 1.4), (4.8, 3.8)):
        room.add(quad("ceiling-panel", (x - 0.3, 2.694, z - 0.3), (0.6, 0, 0), (0, 0, 0.6), material(emission=(9, 9.4, 10))))
    room.add(box("cornice", (6.02, 2.3, 0.3), (6.196, 2.33, 4.9), grey), box("cornice-lip", (6.02, 2.33, 0.3), (6.04, 2.4, 4.9), grey))
    room.add(lamp("above-cornice", (6.1, 2.335, 0.5), (0, 0, 4.2), (0.05, 0, 0), (12, 10, 7)), hidden=True)
    room.add(box("cabinet-light-box", (3.41, 0.9, 3.2), (3.75, 1.6, 4.6), material(SATIN, color=(0.7, 0.68, 0.62))), blocks=True)
    room.add(lamp("below-cabinet", (3.5, 0.895, 3.4), (0.04, 0, 0), (0, 0, 1.0), (14, 14, 15)),
             hidden=True)
    room.add(box("sideboard", (3.41, 0, 3.2), (3.85, 0.5, 4.6), material(SATIN, color=(0.35, 0.2, 0.12))))
    room.models(
        ("blendswap-cc-by/officeTable", (5.0, 0, 0.5), dict(width=2.0)),
        ("scopia/desk_table", (1.2, 0, 0.5), dict(height=0.75)),
        ("scopia/office_chair", (5.0, 0, 1.3), dict(height=0.95, turned=170)),
        ("katorlegaz/office-chair", (1.3, 0, 1.3), dict(height=0.95, turned=200)),
        ("katorlegaz/filing-cabinet", (3.0, 0, 0.35), dict(height=1.2)),
        ("blendswap-cc-0/whiteBoard", (0.08, 1.1, 1.6), dict(height=0.9, turned=90, blocks=False)),
        ("katorlegaz/bullet-trash-can", (2.3, 0, 0.35), dict(height=0.6)),
        ("scopia/inkjet_and_scanner_printer", (3.63, 0.5, 3.9), dict(height=0.2, turned=90)),
        ("scopia/water_cooler", (3.75, 0, 4.9), dict(height=1.1, turned=90)),
        ("katorlegaz/folding-table", (5.2, 0, 3.9), dict(height=0.74)),
        ("scopia/chair4", (5.2, 0, 3.1), dict(height=0.85)),
        ("scopia/chair4", (5.2, 0, 4.7), dict(height=0.85, turned=180)),
        ("blendswap-cc-by/wirelessOfficePhone3", (4.15, 0.76, 0.5), dict(height=0.08)),
        ("scopia/bamboo", (0.4, 0, 2.4), dict(height=1.4)),
        ("katorlegaz/newspaper", (5.3, 0.75, 3.9), dict(height=0.02)))
    return room


def washroom(rng):
    room = Room((4.6, 2.5, 4.2), rng)
    white = material(color=(0.84, 0.84, 0.83))
    tiled = material(roughness=0.15, specular=0.5, texture=tiles(rng, ((0.82, 0.83, 0.83),), count=4, joint=(0.62, 0.62, 0.6), joint_width=4))
    room.plan(((0.9, 0), (3.7, 0), (4.6, 0.9), (4.6, 3.3), (3.7, 4.2), (0.9, 4.2), (0, 3.3), (0, 0.9)), 2.5,
              floor=material(roughness=0.3, specular=0.5, texture=tiles(rng, ((0.74, 0.75, 0.76), (0.66, 0.68, 0.7)), count=4)),
              wall=[tiled, white, tiled, white, tiled, white, white, white], ceiling=material(color=(0.86, 0.86, 0.86)),
              openings={6: ((0.9, 1.5, 1.3, 1.9),)})
    room.add(box("mirror-back", (1.3, 1.1, 0.06), (3.3, 1.9, 0.09), white),
             quad("mirror", (1.32, 1.12, 0.093), (1.96, 0, 0), (0, 0.76, 0),
                  material(color=(0.3, 0.31, 0.31), roughness=0.06, specular=1.0)))
    for x in (1.34, 3.2):
        room.add(lamp("behind-mirror", (x, 1.15, 0.055), (0, 0.7, 0), (0.05, 0, 0), (17, 17, 16)), hidden=True)
    room.add(box("vanity", (1.2, 0.5, 0.004), (3.4, 0.86, 0.5), material(SATIN, color=(0.32, 0.22, 0.14))),
             box("vanity-top", (1.18, 0.86, 0.004), (3.42, 0.9, 0.52), material(POLISHED, color=(0.86, 0.86, 0.85))), blocks=True)
    room.add(box("seat", (4.15, 0.4, 1.2), (4.59, 0.45, 3.0), material(SATIN, texture=planks(rng))),
             box("seat-lip", (4.15, 0.32, 1.2), (4.17, 0.4, 3.0), material(SATIN, texture=planks(rng))), blocks=True)
    room.add(lamp("below-seat", (4.35, 0.395, 1.35), (0.05, 0, 0), (0, 0, 1.5), (13, 11, 8)), hidden=True)
    room.add(sphere("ball", (2.3, 2.2, 2.1), 0.16, material(emission=(9, 8.6, 8))),
             box("ball-rod", (2.29, 2.35, 2.09), (2.31, 2.5, 2.11), STEEL),
             quad("ceiling-spot", (3.6, 2.495, 2.0), (0.1, 0, 0), (0, 0, 0.1), material(emission=(40, 38, 33))),
             quad("towel", (0.95, 0.7, 4.16), (0.55, 0, 0), (0, 0.9, 0), material(color=(0.15, 0.4, 0.45))))
    room.add(box("towel", (2.9, 0.6, 4.12), (3.4, 1.4, 4.16), material(texture=stripes(rng, (0.7, 0.2, 0.15), (0.75, 0.7, 0.6)))))
    room.models(
        ("blendswap-cc-by/bath_jay_hardy", (1.0, 0, 2.4), dict(height=0.6, turned=90)),
        ("blendswap-cc-by/modernToilet", (3.5, 0, 3.6), dict(height=0.75, turned=-135)),
        ("scopia/basin", (2.3, 0.9, 0.28), dict(height=0.14)),
        ("blendswap-cc-by/bathroomRadiator", (2.2, 0.5, 4.1), dict(height=1.2, turned=180)),
        ("scopia/clothes-basket", (3.9, 0, 0.9), dict(height=0.55)),
        ("blendswap-cc-0/stool2", (2.5, 0, 1.5), dict(height=0.45)),
        ("scopia/calla_lily_with_roses", (1.5, 0.9, 0.3), dict(height=0.35)),
        ("blendswap-cc-0/flacon", (3.0, 0.9, 0.25), dict(height=0.12)),
        ("katorlegaz/spray-bottle", (3.2, 0.9, 0.3), dict(height=0.22)))
    room.sky = overcast((5, 5.3, 5.8), (1.0, 1.1, 0.8))
    return room


ROOMS = {make.__name__: make for make in (workshop, studio, passage, bar, office, washroom)}
