"""Six furnished rooms, boxes all. Not unseen any more: constants of gloss.c, sun_find.c and measurement.c were chosen on
these rooms, too; on the last only the doubt about unseen sky was.

  kitchen   closed; four spots at the ceiling and a strip lamp, polished tiles, much steel
  parlour   two windows under a sky that the sun has just left, a lamp, a lit screen, wallpaper, books
  bedroom   sun through one window, a red wall, two lamps with shades that shine, a patterned bed
  lounge    a window whose panes shine as one emitter, twelve small bulbs, a warm and a blue lamp, black polish
  study     sun through blinds, a hall with a brighter lamp behind a door, a panelled wall, a screen with a picture
  cafe      three windows under a grey sky, pendants over a polished counter, neon, a lit board, dark walls
"""
import numpy as np

from furniture import METAL, POLISHED, SATIN, box, join, material, picture, planks, quad, sphere, stripes, tiles
from room_plan import Room, directions


def kitchen(rng):
    room = Room((4.5, 2.6, 4.0), rng)
    room.walls(floor=material(roughness=0.15, specular=0.5,
                              texture=tiles(rng, ((0.7, 0.68, 0.62), (0.08, 0.08, 0.09)))),
               wall=material(color=(0.62, 0.68, 0.6)), ceiling=material(color=(0.82, 0.82, 0.82)))
    backsplash = tiles(rng, ((0.75, 0.78, 0.8),), count=2, joint=(0.25, 0.25, 0.25), joint_width=8)
    room.add(quad("backsplash", (0.6, 0.9, 0.01), (3.3, 0, 0), (0, 0.6, 0),
                  material(roughness=0.2236, specular=0.5, texture=backsplash), (8, 1.5)))
    for k, name in enumerate(("kitchenLowerCabinet", "largeStove", "kitchenDrawersCabinet", "kitchenLowerCabinet")):
        room.model("blendswap-cc-by/" + name, (0.9 + 0.85 * k, 0, 0.33), height=0.9)
        if k != 1:
            room.model("blendswap-cc-by/kitchenUpperCabinet", (0.9 + 0.85 * k, 1.5, 0.2), height=0.75)
    white = material(color=(0.8, 0.8, 0.8))
    room.add(box("strip-body", (2.3, 1.47, 0.1), (3.8, 1.5, 0.16), white),
             quad("strip", (2.32, 1.468, 0.11), (1.46, 0, 0), (0, 0, 0.04), material(emission=(16, 17, 18))))
    for x in (1.2, 3.2):
        for z in (1.4, 3.0):
            room.add(box("spot-ring", (x - 0.09, 2.56, z - 0.09), (x + 0.09, 2.598, z + 0.09),
                         material(METAL, color=(0.7, 0.7, 0.7))),
                     quad("spot", (x - 0.06, 2.557, z - 0.06), (0.12, 0, 0), (0, 0, 0.12),
                          material(emission=(40, 34, 26))))
    for name, at, how in (
            ("blendswap-cc-0/largeFridge", (4.1, 0, 2.2), dict(height=1.85, turned=-90)),
            ("blendswap-cc-by/microwave", (3.4, 0.91, 0.33), dict(height=0.3)),
            ("blendswap-cc-0/kitchenaid", (2.4, 0.91, 0.33), dict(height=0.38, turned=20)),
            ("blendswap-cc-by/espressokettle", (1.7, 0.93, 0.35), dict(height=0.22)),
            ("blendswap-cc-0/oakTable", (1.5, 0, 2.6), dict(height=0.75)),
            ("blendswap-cc-0/oakChair", (1.5, 0, 1.8), dict(height=0.95)),
            ("blendswap-cc-0/oakChair", (1.4, 0, 3.4), dict(height=0.95, turned=180)),
            ("blendswap-cc-by/chair3", (2.6, 0, 2.6), dict(height=0.9, turned=-90)),
            ("scopia/teapot", (1.6, 0.76, 2.6), dict(height=0.2)),
            ("katorlegaz/bowl", (1.2, 0.76, 2.7), dict(height=0.1)),
            ("scopia/apples", (1.2, 0.8, 2.7), dict(height=0.1)),
            ("katorlegaz/coffee-mug", (1.9, 0.76, 2.5), dict(height=0.1)),
            ("blendswap-cc-by/yuccaPlant", (0.4, 0, 3.6), dict(height=1.3)),
            ("blendswap-cc-0/radiator", (4.42, 0.1, 3.3), dict(height=0.6, turned=-90)),
            ("blendswap-cc-0/whiteBoard", (0.08, 1.2, 2.0), dict(height=0.8, turned=90, blocks=False))):
        room.model(name, at, **how)
    room.add(quad("calendar", (0.02, 1.3, 3.5), (0, 0, -0.5), (0, 0.7, 0), material(texture=picture(rng))))
    return room


def parlour(rng):
    room = Room((6.0, 2.8, 5.0), rng)
    room.walls(floor=material(SATIN, texture=planks(rng)),
               wall=material(texture=stripes(rng, (0.55, 0.5, 0.38), (0.7, 0.66, 0.55))),
               ceiling=material(color=(0.8, 0.8, 0.78)), windows=((0.8, 2.2, 0.9, 2.3), (3.0, 4.4, 0.9, 2.3)))
    leather = material(roughness=0.4472, specular=0.5, color=(0.35, 0.12, 0.1))
    for name, at, how in (
            ("blendswap-cc-0/L_shaped_sofa", (1.3, 0, 1.3), dict(width=2.2, kind=leather)),
            ("katorlegaz/oriental-rug", (2.6, 0.002, 2.4), dict(width=2.4, blocks=False)),
            ("blendswap-cc-by/coffeeTable", (2.7, 0.01, 2.5), dict(height=0.45)),
            ("katorlegaz/full-bookcase", (0.25, 0, 3.2), dict(height=2.1, turned=90)),
            ("katorlegaz/full-bookcase", (0.25, 0, 4.3), dict(height=2.1, turned=90)),
            ("blendswap-cc-0/televisionCabinet", (3.2, 0, 4.65), dict(width=2.0, turned=180)),
            ("blendswap-cc-0/modernArmchair", (4.6, 0, 1.0),
             dict(height=0.8, turned=-40, kind=material(color=(0.15, 0.25, 0.4)))),
            ("blendswap-cc-0/teddyBear", (4.6, 0.42, 1.0), dict(height=0.35, turned=-40)),
            ("blendswap-cc-by/mediumIndoorPlant", (5.5, 0, 4.5), dict(height=1.3)),
            ("katorlegaz/coffee-mug", (2.6, 0.46, 2.4), dict(height=0.12)),
            ("blendswap-cc-by/clock", (0.1, 2.2, 1.5), dict(height=0.4, turned=90, blocks=False))):
        room.model(name, at, **how)
    room.add(box("screen-body", (2.5, 0.9, 4.8), (3.9, 1.7, 4.9),
                 material(roughness=0.2, specular=0.5, color=(0.03, 0.03, 0.03))), blocks=True)
    room.add(quad("screen", (2.55, 0.95, 4.79), (0, 0.7, 0), (1.3, 0, 0), material(emission=(0.9, 1.3, 2.0))),
             box("lamp-rod", (2.98, 2.3, 2.48), (3.02, 2.8, 2.52), material(METAL, color=(0.6, 0.6, 0.6))),
             sphere("lamp", (3.0, 2.2, 2.5), 0.12, material(emission=(9, 7.5, 5.5))))
    for x in (1.2, 2.7, 4.2):
        room.add(box("frame", (x - 0.05, 1.35, 0.001), (x + 0.95, 2.1, 0.028),
                     material(roughness=0.3162, specular=1.0, color=(0.5, 0.35, 0.12))),
                 quad("picture", (x, 1.4, 0.03), (0.9, 0, 0), (0, 0.65, 0),
                      material(roughness=0.2, specular=0.5, texture=picture(rng))))
    # From the horizon up bluer and darker, brighter towards +x, brown below.
    up, around = directions()
    along = 1 + 0.5 * np.cos(around - np.pi / 2)
    room.sky = np.where(up > 0, (8, 9, 11) - up * np.array((5, 4, 3)), (2.2, 1.9, 1.5)) * along
    return room


def bedroom(rng):
    room = Room((4.8, 2.7, 4.2), rng)
    room.walls(floor=material(roughness=0.2, specular=0.5, texture=planks(rng, count=6, color=(0.5, 0.32, 0.18))),
               wall=material(color=(0.75, 0.73, 0.68)), ceiling=material(color=(0.85, 0.85, 0.84)),
               windows=((1.2, 2.8, 0.8, 2.2),))
    room.add(quad("red-wall", (0.01, 0, 4.2), (0, 0, -4.2), (0, 2.7, 0), material(color=(0.6, 0.09, 0.07))))
    for name, at, how in (
            ("blendswap-cc-0/bedWithTexture", (1.3, 0, 2.1), dict(width=2.1, turned=90)),
            ("blendswap-cc-by/bedsideTable", (0.35, 0, 0.7), dict(height=0.5, turned=90)),
            ("blendswap-cc-by/bedsideTable", (0.35, 0, 3.5), dict(height=0.5, turned=90)),
            ("blendswap-cc-by/wardrobe", (3.2, 0, 0.35), dict(height=2.0)),
            ("blendswap-cc-by/dresserWithDrawers", (3.0, 0, 3.85), dict(height=0.9, turned=180)),
            ("blendswap-cc-0/antiqueChair", (4.2, 0, 3.5), dict(height=1.0, turned=-120)),
            ("blendswap-cc-0/pianoBench", (3.9, 0, 1.9), dict(height=0.45, turned=90)),
            ("scopia/round-carpet", (3.2, 0.003, 2.2), dict(width=1.6, blocks=False)),
            ("blendswap-cc-by/tulips", (2.7, 0.91, 3.85), dict(height=0.35)),
            ("scopia/teapot", (3.4, 0.91, 3.85), dict(height=0.2)),
            ("blendswap-cc-0/cactus", (4.45, 0, 0.5), dict(height=0.8))):
        room.model(name, at, **how)
    for z in (0.7, 3.5):
        room.add(box("lamp-foot", (0.32, 0.5, z - 0.03), (0.38, 0.72, z + 0.03), material(METAL, color=(0.5, 0.4, 0.2))),
                 sphere("lamp-shade", (0.35, 0.8, z), 0.11, material(color=(0.7, 0.6, 0.45), emission=(3.5, 2.2, 1.1))))
    room.add(box("mirror-frame", (2.2, 1.1, 4.16), (3.8, 2.1, 4.199), material(SATIN, color=(0.2, 0.1, 0.05))),
             quad("mirror", (3.72, 1.18, 4.155), (-1.44, 0, 0), (0, 0.84, 0),
                  material(color=(0.25, 0.27, 0.28), roughness=0.12, specular=1.0)))
    up, around = directions()
    room.sky = np.where(up > 0, (3, 3.6, 4.5) - up * np.array((1.5, 1.5, 1.2)), (1.0, 0.9, 0.7)) * np.ones_like(around)
    room.add_sun((0.72, 0.55, 0.3), (900, 800, 640))
    return room


def lounge(rng):
    room = Room((6.5, 3.2, 5.0), rng)
    room.walls(floor=material(POLISHED, texture=tiles(rng, ((0.25, 0.14, 0.08), (0.4, 0.26, 0.15)), count=8,
                                                      joint=(0.1, 0.06, 0.04), joint_width=2)),
               wall=material(color=(0.42, 0.5, 0.52)), ceiling=material(color=(0.78, 0.76, 0.7)))
    for k in range(3):
        room.add(quad("pane", (6.49, 1.0, 1.15 + 0.95 * k), (0, 0, 0.85), (0, 1.5, 0), material(emission=(7, 8, 9.5))))
    room.add(box("window-frame", (6.46, 0.9, 1.0), (6.498, 1.0, 4.0), material(SATIN, color=(0.85, 0.85, 0.85))),
             box("window-frame", (6.46, 2.5, 1.0), (6.498, 2.6, 4.0), material(SATIN, color=(0.85, 0.85, 0.85))))
    for z in (1.0, 2.0, 2.95, 3.9):
        room.add(box("window-post", (6.46, 1.0, z), (6.498, 2.5, z + 0.14), material(SATIN, color=(0.85, 0.85, 0.85))))
    for name, at, how in (
            ("blendswap-cc-0/pianoAQueue", (4.6, 0, 3.9), dict(width=1.6, turned=200)),
            ("blendswap-cc-0/winchesterSofa", (1.6, 0, 0.6), dict(width=2.0)),
            ("blendswap-cc-0/winchesterArmchair", (0.7, 0, 2.4), dict(width=1.0, turned=80)),
            ("blendswap-cc-0/oakTable", (4.3, 0, 1.4), dict(height=0.75)),
            ("blendswap-cc-0/thonet", (4.3, 0, 0.7), dict(height=0.95)),
            ("blendswap-cc-0/thonet", (4.2, 0, 2.2), dict(height=0.95, turned=180)),
            ("blendswap-cc-0/electricGuitar", (0.25, 0.02, 3.6), dict(height=1.0, turned=90)),
            ("blendswap-cc-0/decorativePlant", (6.0, 0, 0.5), dict(height=1.4)),
            ("katorlegaz/oriental-rug", (1.8, 0.002, 2.4), dict(width=2.2, blocks=False)),
            ("blendswap-cc-by/coffeeTable", (1.8, 0.01, 2.2), dict(height=0.42)),
            ("scopia/vase2", (4.3, 0.76, 1.4), dict(height=0.3)),
            ("blendswap-cc-by/bulldog", (2.9, 0, 3.4), dict(height=0.4, turned=150)),
            ("blendswap-cc-by/laptop", (1.8, 0.43, 2.2), dict(width=0.35, turned=20)),
            ("scopia/fireplace1", (2.2, 0, 4.75), dict(height=1.2, turned=180))):
        room.model(name, at, **how)
    brass = material(METAL, color=(0.6, 0.42, 0.15))
    room.add(box("chandelier", (3.2, 2.35, 2.3), (3.3, 3.2, 2.4), brass))
    for k in range(12):
        x, z = 3.25 + 0.4 * np.cos(np.pi * k / 6), 2.35 + 0.4 * np.sin(np.pi * k / 6)
        room.add(sphere("bulb", (x, 2.42, z), 0.03, material(emission=(45, 36, 24)), rows=10),
                 box("arm", (min(x, 3.25), 2.36, min(z, 2.35)), (max(x, 3.25) + 0.01, 2.38, max(z, 2.35) + 0.01), brass))
    room.add(box("stand", (0.38, 0, 4.48), (0.42, 1.5, 4.52), brass),
             sphere("warm-lamp", (0.4, 1.6, 4.5), 0.13, material(emission=(16, 8, 2.5))),
             quad("blue-tube", (5.2, 3.19, 0.2), (1.0, 0, 0), (0, 0, 0.06), material(emission=(2, 5, 20))))
    for x in (3.2, 4.9):
        room.add(quad("picture", (x, 1.5, 0.03), (1.1, 0, 0), (0, 0.8, 0), material(texture=picture(rng))))
    return room


def study(rng):
    room = Room((7.0, 2.7, 4.5), rng)
    wall = material(color=(0.66, 0.62, 0.54))
    room.walls(floor=material(POLISHED, texture=planks(rng, count=10, color=(0.3, 0.17, 0.09))), wall=wall,
               ceiling=material(color=(0.8, 0.8, 0.8)), windows=((1.0, 3.4, 0.8, 2.2),))
    slats = [quad("blinds", (6.94, y, 1.02), (0, 0, 2.36), (0.022, 0.012, 0), wall) for y in np.arange(0.82, 2.18, 0.035)]
    room.add(join("blinds", slats, material(roughness=0.4472, specular=0.5, color=(0.75, 0.73, 0.68))),
             box("partition", (2.35, 0, 0), (2.45, 2.7, 1.4), wall), box("partition", (2.35, 0, 2.3), (2.45, 2.7, 4.5), wall),
             box("lintel", (2.35, 2.0, 1.4), (2.45, 2.7, 2.3), wall),
             sphere("hall-lamp", (1.2, 2.3, 2.2), 0.1, material(emission=(34, 32, 28))))
    room.boxes += [(np.array((2.1, 0, 0)), np.array((2.7, 2.7, 1.6))), (np.array((2.1, 0, 2.1)), np.array((2.7, 2.7, 4.5)))]
    room.add(box("panels", (3.0, 0, 4.47), (7.0, 1.3, 4.499), material(POLISHED, texture=planks(rng, color=(0.16, 0.08, 0.05)))),
             box("mirror-frame", (4.1, 0.5, 0.001), (5.9, 2.1, 0.03), material(SATIN, color=(0.03, 0.03, 0.03))),
             quad("mirror", (4.15, 0.55, 0.035), (1.7, 0, 0), (0, 1.5, 0),
                  material(color=(0.3, 0.32, 0.33), roughness=0.05, specular=1.0)),
             box("screen-body", (2.451, 1.1, 2.6), (2.48, 1.95, 4.0), material(POLISHED, color=(0.03, 0.03, 0.03))),
             quad("screen", (2.485, 1.15, 3.95), (0, 0, -1.3), (0, 0.75, 0),
                  material(color=(0.02, 0.02, 0.02), emission=3.0 * picture(rng) ** 2)))
    for name, at, how in (
            ("katorlegaz/custom-desk", (5.2, 0, 3.7), dict(width=1.8, turned=180)),
            ("katorlegaz/office-chair", (5.1, 0, 2.8), dict(height=1.0, turned=20)),
            ("blendswap-cc-0/verticalShelves", (3.5, 0, 0.3), dict(height=2.0)),
            ("blendswap-cc-by/bookcase", (0.25, 0, 1.2), dict(height=2.0, turned=90)),
            ("blendswap-cc-0/designChair", (3.3, 0, 3.3), dict(height=0.9, turned=130)),
            ("blendswap-cc-by/suitcase", (0.5, 0, 3.9), dict(height=0.6, turned=60)),
            ("blendswap-cc-by/yuccaPlant", (6.5, 0, 0.5), dict(height=1.4)),
            ("scopia/cardboard-box", (1.8, 0, 0.5), dict(height=0.4, turned=15)),
            ("blendswap-cc-by/radio", (5.8, 0.78, 3.8), dict(height=0.2, turned=180)),
            ("scopia/round-carpet", (4.6, 0.003, 1.8), dict(width=1.8, blocks=False)),
            ("blendswap-cc-by/clock", (0.1, 2.1, 3.2), dict(height=0.35, turned=90, blocks=False))):
        room.model(name, at, **how)
    room.add(box("lamp-hood", (4.6, 1.25, 3.6), (4.9, 1.29, 3.9), material(SATIN, color=(0.05, 0.15, 0.08))),
             box("lamp-rod", (4.73, 0.78, 3.87), (4.77, 1.25, 3.9), material(METAL, color=(0.5, 0.5, 0.5))),
             sphere("lamp", (4.75, 1.2, 3.75), 0.04, material(emission=(60, 44, 26))))
    up, around = directions()
    room.sky = np.where(up > 0, (4, 4.8, 6) - up * np.array((2, 2, 2)), (1.2, 1.1, 0.8)) * np.ones_like(around)
    room.add_sun((0.75, 0.42, -0.25), (700, 600, 450))
    return room


def cafe(rng):
    room = Room((8.0, 3.0, 6.0), rng)
    room.walls(floor=material(roughness=0.3162, specular=0.5,
                              texture=tiles(rng, ((0.55, 0.5, 0.42), (0.12, 0.16, 0.18), (0.4, 0.2, 0.12)), count=6)),
               wall=material(color=(0.1, 0.16, 0.24)), ceiling=material(color=(0.35, 0.34, 0.33)),
               windows=((0.8, 2.0, 0.7, 2.5), (2.4, 3.6, 0.7, 2.5), (4.0, 5.2, 0.7, 2.5)))
    marble = material(roughness=0.1, specular=0.5, color=(0.75, 0.73, 0.7))
    room.add(box("counter", (1.2, 0, 1.2), (1.9, 1.0, 4.2), material(SATIN, texture=planks(rng, count=12, color=(0.45, 0.25, 0.1)))),
             box("counter-top", (1.1, 1.0, 1.1), (2.0, 1.05, 4.3), marble), blocks=True)
    for k in range(3):
        z = 1.8 + 0.9 * k
        room.add(box("cord", (1.545, 2.0, z - 0.005), (1.555, 3.0, z + 0.005), material(color=(0.05, 0.05, 0.05))),
                 box("pendant-cap", (1.5, 1.97, z - 0.05), (1.6, 2.03, z + 0.05), material(METAL, color=(0.7, 0.4, 0.2))),
                 sphere("pendant", (1.55, 1.88, z), 0.09, material(emission=(24, 17, 9))))
    room.add(box("board-body", (0.001, 1.7, 1.4), (0.06, 2.6, 3.9), material(METAL, color=(0.3, 0.3, 0.3))),
             quad("board", (0.065, 1.75, 3.85), (0, 0, -2.4), (0, 0.8, 0),
                  material(color=(0.05, 0.05, 0.05), emission=4.0 * picture(rng))),
             quad("neon", (3.0, 2.2, 0.02), (1.6, 0, 0), (0, 0.05, 0), material(emission=(18, 1.5, 4))),
             quad("neon", (3.0, 2.35, 0.02), (1.2, 0, 0), (0, 0.05, 0), material(emission=(1.5, 5, 16))),
             quad("panel", (5.0, 2.995, 2.4), (1.2, 0, 0), (0, 0, 1.2), material(emission=(5, 5.2, 5.5))),
             box("mirror-frame", (4.9, 0.9, 5.95), (6.9, 2.3, 5.999), material(SATIN, color=(0.4, 0.28, 0.08))),
             quad("mirror", (6.85, 0.95, 5.945), (-1.9, 0, 0), (0, 1.3, 0),
                  material(color=(0.3, 0.32, 0.33), roughness=0.08, specular=1.0)),
             quad("brick", (4.4, 0, 5.99), (-4.4, 0, 0), (0, 3.0, 0),
                  material(texture=tiles(rng, ((0.4, 0.13, 0.08), (0.5, 0.2, 0.12)), joint=(0.6, 0.58, 0.55))), (5, 4)))
    for name, at, how in (
            ("blendswap-cc-0/coffeeBrewer", (1.5, 1.05, 3.7), dict(height=0.45, turned=90)),
            ("blendswap-cc-by/coffee_cup", (1.6, 1.05, 2.9), dict(height=0.1)),
            ("blendswap-cc-by/breadBox", (1.5, 1.05, 1.6), dict(height=0.25, turned=80)),
            ("blendswap-cc-by/beer_bottle", (1.7, 1.05, 2.3), dict(height=0.25)),
            ("blendswap-cc-0/stool", (2.5, 0, 2.0), dict(height=0.75)),
            ("blendswap-cc-0/stool", (2.5, 0, 3.2), dict(height=0.75)),
            ("blendswap-cc-0/tableWithTablecloth", (4.2, 0, 1.4), dict(height=0.75)),
            ("blendswap-cc-by/cafe_set_tonon_chair", (3.4, 0, 1.4), dict(height=0.85, turned=90)),
            ("blendswap-cc-by/cafe_set_tonon_chair", (5.0, 0, 1.5), dict(height=0.85, turned=-90)),
            ("blendswap-cc-by/table", (5.6, 0, 4.2), dict(height=0.75)),
            ("blendswap-cc-by/leaf_chair", (4.8, 0, 4.9), dict(height=0.85, turned=150)),
            ("blendswap-cc-0/antiqueChair", (6.4, 0, 4.0), dict(height=1.0, turned=-80)),
            ("blendswap-cc-by/succulentPlant", (5.6, 0.76, 4.2), dict(height=0.2)),
            ("blendswap-cc-0/bread", (4.2, 0.76, 1.4), dict(height=0.12)),
            ("scopia/candelabre", (4.0, 0.76, 1.2), dict(height=0.3)),
            ("blendswap-cc-by/bike", (6.9, 0, 0.5), dict(height=1.0)),
            ("blendswap-cc-0/decorativePlant", (7.4, 0, 5.5), dict(height=1.5)),
            ("katorlegaz/full-bookcase", (3.4, 0, 5.7), dict(height=2.0, turned=180)),
            ("blendswap-cc-0/umbrella", (0.4, 0, 5.4), dict(height=0.9)),
            ("blendswap-cc-0/radiator", (7.92, 0.1, 3.0), dict(height=0.55, turned=-90))):
        room.model(name, at, **how)
    up, around = directions()
    room.sky = np.where(up > 0, (2.4, 2.6, 2.9) * (1 + 2 * up) / 2, (0.5, 0.5, 0.45)) * np.ones_like(around)
    return room


ROOMS = {make.__name__: make for make in (kitchen, parlour, bedroom, lounge, study, cafe)}
