"""Six rooms to choose by, none of them a plain box. rooms_report.py has six of another kind, to report on.

  galley    an L; closed: a panel, a pendant; warm strips under a cupboard and one on a shelf that no photograph shows
  gable     an attic under an overcast sky through a window in the gable and two in the roof
  sunroom   a bay of windows and one more under a sunny sky; a hidden lamp behind a screen of wood
  hotel     an alcove for the bed; one exposure saturates the windows' sky and the lamps; a strip behind the headboard
  den       five walls, dark; a screen with a picture, one with a page, one black; strips behind the first
  gallery   a T of white walls; spots, and light above a cornice that no photograph shows
"""
import numpy as np

from furniture import METAL, POLISHED, SATIN, box, join, material, noise, picture, planks, quad, sphere, stripes, tiles
from room_plan import Room, clouds, directions, overcast, panel, polygon

WHITE = material(color=(0.8, 0.8, 0.78))


def strip(name, low, size, radiance, down=True):
    """A strip lamp (dx, dz) that faces down, or up."""
    a, b = (size[0], 0, 0), (0, 0, size[1])
    return quad(name, low, *((a, b) if down else (b, a)), material(emission=radiance))


def galley(rng):
    room = Room((5.0, 2.5, 4.6), rng)
    tile = tiles(rng, ((0.68, 0.72, 0.7), (0.6, 0.66, 0.66)), count=4, joint=(0.35, 0.34, 0.32), joint_width=5)
    room.plan(((0, 0), (5, 0), (5, 2.4), (2.6, 2.4), (2.6, 4.6), (0, 4.6)), 2.5,
              floor=material(roughness=0.25, specular=0.5, texture=tiles(rng, ((0.5, 0.4, 0.3), (0.44, 0.35, 0.27)))),
              wall=material(color=(0.66, 0.6, 0.42)), ceiling=WHITE)
    front, top = material(SATIN, color=(0.25, 0.36, 0.4)), material(roughness=0.3, specular=0.5, color=(0.55, 0.5, 0.45))
    room.add(quad("backsplash", (0.3, 0.9, 0.005), (3.6, 0, 0), (0, 0.52, 0),
                  material(roughness=0.2236, specular=0.5, texture=tile), (7, 1)))
    for k in range(6):
        room.add(box("lower-cupboard", (0.3 + 0.6 * k, 0.1, 0.005), (0.89 + 0.6 * k, 0.86, 0.58), front),
                 box("handle", (0.4 + 0.6 * k, 0.74, 0.585), (0.78 + 0.6 * k, 0.76, 0.61), METAL))
    room.add(box("plinth", (0.3, 0, 0.005), (3.89, 0.1, 0.53), material(color=(0.1, 0.1, 0.1))),
             box("counter", (0.28, 0.86, 0.004), (3.92, 0.9, 0.62), top), blocks=True)
    for k in range(5):
        room.add(box("cupboard", (0.4 + 0.7 * k, 1.46, 0.004), (1.09 + 0.7 * k, 2.16, 0.33), front))
    room.add(box("cupboard-lip", (0.4, 1.40, 0.31), (3.89, 1.46, 0.33), front),
             box("shelf", (0.004, 2.0, 2.7), (0.24, 2.03, 4.3), material(SATIN, texture=planks(rng))),
             box("shelf-lip", (0.22, 2.03, 2.7), (0.24, 2.08, 4.3), material(SATIN, color=(0.3, 0.17, 0.08))))
    for x in (0.6, 1.8, 3.0):
        room.add(strip("under-cupboard", (x, 1.457, 0.08), (0.5, 0.06), (23, 18, 11)), hidden=True)
    room.add(strip("on-shelf", (0.06, 2.035, 2.9), (0.04, 1.2), (14, 11, 8), down=False), hidden=True)
    room.add(quad("panel", (3.0, 2.495, 1.0), (1.2, 0, 0), (0, 0, 0.6), material(emission=(8, 8, 7.6))),
             box("cord", (1.295, 2.05, 3.595), (1.305, 2.5, 3.605), material(color=(0.05, 0.05, 0.05))),
             sphere("pendant", (1.3, 1.95, 3.6), 0.13, material(emission=(9, 7.5, 5))))
    room.models(
        ("blendswap-cc-0/refrigerator", (4.5, 0, 0.45), dict(height=1.85)),
        ("blendswap-cc-by/espressokettle", (0.9, 0.9, 0.33), dict(height=0.22)),
        ("katorlegaz/coffee-maker", (2.2, 0.9, 0.3), dict(height=0.34)),
        ("scopia/toaster", (3.2, 0.9, 0.3), dict(height=0.2)),
        ("scopia/bowlWithFruits", (2.75, 0.9, 0.4), dict(height=0.13)),
        ("blendswap-cc-by/kitchenScale", (1.4, 0.9, 0.33), dict(height=0.22)),
        ("katorlegaz/cafe-table", (1.3, 0, 3.6), dict(height=0.74)),
        ("katorlegaz/dining-chair", (1.3, 0, 2.8), dict(height=0.9)),
        ("katorlegaz/dining-chair", (2.05, 0, 3.6), dict(height=0.9, turned=-90)),
        ("scopia/pottery", (1.3, 0.75, 3.6), dict(height=0.2)),
        ("blendswap-cc-by/washing_machine", (4.6, 0, 1.9), dict(height=0.85, turned=-90)),
        ("katorlegaz/recycling-bin", (0.35, 0, 4.2), dict(height=0.45)),
        ("blendswap-cc-by/bulldog", (0.6, 0, 1.6), dict(height=0.4, turned=60)))
    room.add(quad("poster", (2.595, 1.1, 3.2), (0, 0, 0.9), (0, 0.7, 0), material(texture=picture(rng))),
             quad("calendar", (4.99, 1.2, 0.95), (0, 0, 0.5), (0, 0.6, 0), material(texture=picture(rng))))
    return room


def gable(rng):
    width, deep, eaves, ridge, middle = 4.6, 5.0, 1.1, 3.0, 2.3
    room = Room((width, ridge, deep), rng)
    wall, slope = material(color=(0.58, 0.63, 0.68)), material(color=(0.74, 0.7, 0.62))
    room.corners = np.array(((0, 0), (width, 0), (width, deep), (0, deep)))
    room.add(polygon("floor", ((0, 0, 0), (0, 0, deep), (width, 0, deep), (width, 0, 0)),
                     material(SATIN, texture=planks(rng, count=10, color=(0.55, 0.4, 0.25))), 1.6),
             panel("knee-wall", (0, 0, deep), (0, 0, -deep), (0, eaves, 0), wall),
             panel("knee-wall", (width, 0, 0), (0, 0, deep), (0, eaves, 0), wall),
             panel("slope", (0, eaves, deep), (0, 0, -deep), (middle, ridge - eaves, 0), slope,
                   ((1.9, 2.9, 0.8, 1.9),)),
             panel("slope", (width, eaves, 0), (0, 0, deep), (-middle, ridge - eaves, 0), slope, ((3.2, 3.9, 0.9, 1.9),)))
    at = eaves + (ridge - eaves) * 1.5 / middle
    window = (0.25, 1.35, 0.9, 2.05)
    room.add(join("gable-z0", [
        panel("", (1.5, 0, 0), (1.6, 0, 0), (0, at, 0), wall, (window,)),
        polygon("", ((0, 0, 0), (1.5, 0, 0), (1.5, at, 0), (0, eaves, 0)), wall),
        polygon("", ((3.1, 0, 0), (width, 0, 0), (width, eaves, 0), (3.1, at, 0)), wall),
        polygon("", ((1.5, at, 0), (3.1, at, 0), (middle, ridge, 0)), wall)], wall),
        polygon("gable-z1", ((width, 0, deep), (0, 0, deep), (0, eaves, deep), (middle, ridge, deep),
                             (width, eaves, deep)), material(texture=stripes(rng, (0.5, 0.2, 0.18), (0.62, 0.5, 0.4)))))
    room.reveal((1.5, 0, 0), (1, 0, 0), (0, 1, 0), window)
    room.keep_out((0, 0, 0), (1.3, ridge, deep))
    room.keep_out((width - 1.3, 0, 0), (width, ridge, deep))
    for z in (0.6, 2.2, 4.4):
        room.add(box("beam", (1.25, 2.2, z), (3.35, 2.34, z + 0.12), material(texture=planks(rng, color=(0.28, 0.16, 0.08)))))
    room.models(
        ("blendswap-cc-0/bed1", (1.0, 0, 3.6), dict(width=1.4, turned=180)),
        ("blendswap-cc-by/chest", (0.5, 0, 1.3), dict(height=0.55, turned=90)),
        ("blendswap-cc-0/desk", (3.95, 0, 1.1), dict(height=0.75, turned=-90)),
        ("blendswap-cc-0/chairWithCushion", (3.3, 0, 1.1), dict(height=0.9, turned=90)),
        ("blendswap-cc-0/shelves", (4.3, 0, 2.6), dict(height=1.0, turned=-90)),
        ("katorlegaz/trunk-large", (4.0, 0, 4.4), dict(height=0.45, turned=-100)),
        ("katorlegaz/oriental-rug", (2.4, 0.003, 2.6), dict(width=1.7, blocks=False)),
        ("scopia/ficus", (2.3, 0, 0.5), dict(height=0.85)),
        ("blendswap-cc-0/teddyBear", (2.9, 0, 4.6), dict(height=0.4, turned=180)),
        ("katorlegaz/MIDI-keyboard", (3.95, 0.76, 0.9), dict(height=0.06, turned=-90)),
        ("blendswap-cc-by/toyTrain", (2.5, 0.01, 3.3), dict(height=0.16, turned=30)))
    room.add(box("lamp-foot", (4.12, 0.75, 1.57), (4.18, 1.0, 1.63), METAL),
             sphere("lamp-shade", (4.15, 1.07, 1.6), 0.09, material(color=(0.6, 0.5, 0.4), emission=(5, 3.4, 1.8))))
    room.sky = clouds(overcast((9, 9.4, 10), (1.2, 1.2, 1.0)), rng, 0.35)
    return room


def sunroom(rng):
    room = Room((5.5, 2.7, 4.8), rng)
    room.plan(((0, 0.9), (1.5, 0.9), (1.5, 0), (4, 0), (4, 0.9), (5.5, 0.9), (5.5, 4.8), (0, 4.8)), 2.7,
              floor=material(roughness=0.35, specular=0.5, texture=tiles(rng, ((0.55, 0.3, 0.2), (0.5, 0.26, 0.17)), count=6)),
              wall=material(color=(0.7, 0.68, 0.52)), ceiling=WHITE,
              openings={2: ((0.15, 1.15, 0.6, 2.2), (1.35, 2.35, 0.6, 2.2)), 5: ((0.9, 2.4, 0.8, 2.2),)})
    slats = [box("", (x, 0, 4.2), (x + 0.05, 1.9, 4.24), SATIN) for x in np.arange(0.3, 1.7, 0.06)]
    room.add(join("slats", slats, material(SATIN, texture=planks(rng, color=(0.4, 0.24, 0.12)))), blocks=True)
    room.add(quad("behind-slats", (0.5, 0.15, 4.5), (0, 0, 0.04), (1.0, 0, 0), material(emission=(30, 24, 15))), hidden=True)
    room.add(box("trough", (0.45, 0.0, 4.42), (1.55, 0.14, 4.6), material(color=(0.2, 0.2, 0.2))),
             box("trough-lip", (0.45, 0.14, 4.42), (1.55, 0.3, 4.44), material(color=(0.2, 0.2, 0.2))))
    room.models(
        ("scopia/rattanSofa", (2.75, 0, 4.3), dict(height=0.8, turned=180)),
        ("scopia/rattanArmchair", (0.8, 0, 2.4), dict(height=0.8, turned=80)),
        ("scopia/rattanTable", (2.75, 0, 3.0), dict(height=0.4)),
        ("katorlegaz/cafe-table", (2.75, 0, 1.0), dict(height=0.72)),
        ("katorlegaz/cafe-chair", (2.05, 0, 1.1), dict(height=0.8, turned=90)),
        ("katorlegaz/cafe-chair", (3.45, 0, 1.1), dict(height=0.8, turned=-90)),
        ("scopia/vase3", (2.75, 0.73, 1.0), dict(height=0.25)),
        ("scopia/bonsai-tree", (2.6, 0.41, 3.0), dict(height=0.35)),
        ("blendswap-cc-0/cupboard", (5.25, 0, 4.2), dict(height=1.8, turned=-90)),
        ("blendswap-cc-by/mediumIndoorPlant", (4.9, 0, 1.4), dict(height=1.2)),
        ("blendswap-cc-0/cactus", (0.4, 0, 1.3), dict(height=0.8)),
        ("katorlegaz/scooter", (0.5, 0, 3.5), dict(height=0.9, turned=75)),
        ("scopia/cat", (3.3, 0.41, 3.05), dict(height=0.25, turned=-60)),
        ("scopia/round-carpet", (2.75, 0.003, 2.9), dict(width=2.0, blocks=False)))
    room.add(quad("picture", (0.01, 1.2, 3.2), (0, 0, -1.0), (0, 0.75, 0), material(texture=picture(rng))),
             box("frame", (5.44, 1.1, 3.4), (5.495, 1.9, 4.0), material(METAL, color=(0.5, 0.35, 0.12))),
             quad("print", (5.435, 1.15, 3.45), (0, 0, 0.5), (0, 0.7, 0), material(POLISHED, texture=picture(rng))))
    up, around = directions(512, 1024)
    room.sky = np.where(up > 0, (2.2, 2.9, 4.2) - up * np.array((1.4, 1.4, 1.5)), (0.9, 0.85, 0.6)) * np.ones_like(around)
    room.add_sun((0.42, 0.56, -0.71), (38000, 34000, 27000), radius_deg=0.6)
    return room


def hotel(rng):
    room = Room((4.4, 2.6, 4.8), rng)
    wall, niche = material(color=(0.62, 0.56, 0.5)), material(color=(0.22, 0.3, 0.28))
    room.plan(((0, 0), (4.4, 0), (4.4, 3.2), (3.4, 3.2), (3.4, 4.8), (1, 4.8), (1, 3.2), (0, 3.2)), 2.6,
              floor=material(texture=stripes(rng, (0.3, 0.24, 0.3), (0.38, 0.3, 0.34), count=16)),
              wall=[wall, wall, wall, niche, niche, niche, wall, wall], ceiling=WHITE,
              openings={0: ((0.5, 1.9, 0.8, 2.2), (2.5, 3.9, 0.8, 2.2))})
    room.add(box("headboard", (1.2, 0.3, 4.66), (3.2, 1.15, 4.7), material(POLISHED, color=(0.3, 0.16, 0.08))))
    room.add(quad("behind-headboard", (1.3, 1.08, 4.72), (0, 0, 0.04), (1.8, 0, 0), material(emission=(26, 18, 9))),
             hidden=True)
    for x in (1.25, 3.15):
        room.add(sphere("bed-lamp", (x, 1.45, 4.55), 0.08, material(color=(0.6, 0.6, 0.55), emission=(20, 15, 9))),
                 box("bed-lamp-arm", (x - 0.01, 1.44, 4.62), (x + 0.01, 1.46, 4.8), METAL))
    curtain = material(color=(0.55, 0.25, 0.15))
    for x in (0.2, 2.05, 4.05):
        folds = [quad("", (x + 0.05 * k, 0.1, 0.06 + 0.05 * (k % 2)), (0.05, 0, 0.05 - 0.1 * (k % 2)), (0, 2.3, 0), curtain)
                 for k in range(5 if x > 1 else 4)]
        room.add(join("curtain", folds, curtain))
    room.models(
        ("blendswap-cc-0/bed3", (2.2, 0, 3.6), dict(width=1.7, turned=180)),
        ("katorlegaz/chair-ottoman", (0.6, 0, 1.2), dict(height=0.5, turned=30)),
        ("katorlegaz/mid-century-chair", (0.65, 0, 2.4), dict(height=0.8, turned=100)),
        ("scopia/round-table", (1.4, 0, 1.0), dict(height=0.5)),
        ("blendswap-cc-by/laptop", (1.4, 0.51, 1.0), dict(width=0.35, turned=200)),
        ("blendswap-cc-by/dresserWithDrawers", (4.1, 0, 1.9), dict(height=0.85, turned=-90)),
        ("scopia/vase1", (4.1, 0.86, 2.2), dict(height=0.3)),
        ("blendswap-cc-by/suitcase", (3.9, 0, 0.8), dict(height=0.55, turned=-70)),
        ("katorlegaz/red-wine-bottle-01", (1.2, 0.51, 1.2), dict(height=0.3)),
        ("scopia/wardrobe1", (4.1, 0, 2.85), dict(height=1.6, turned=-90)))
    room.add(box("mirror-frame", (4.36, 1.1, 1.3), (4.399, 1.9, 2.4), material(SATIN, color=(0.5, 0.4, 0.2))),
             quad("mirror", (4.355, 1.15, 1.35), (0, 0, 1.0), (0, 0.7, 0),
                  material(color=(0.3, 0.31, 0.32), roughness=0.06, specular=1.0)),
             quad("picture", (0.01, 1.2, 2.2), (0, 0, -1.1), (0, 0.8, 0), material(SATIN, texture=picture(rng))),
             quad("ceiling-lamp", (2.0, 2.595, 1.5), (0.4, 0, 0), (0, 0, 0.4), material(emission=(12, 10, 7))))
    up, around = directions()
    room.sky = np.where(up > 0, (13, 14, 16) - up * np.array((5, 4, 2)), (3.5, 3.2, 2.4)) * (1 + 0.4 * np.cos(around - 5.5))
    room.single_exposure = 0.5
    return room


def den(rng):
    room = Room((5.2, 2.5, 4.4), rng)
    dark, brick = material(color=(0.12, 0.14, 0.2)), material(
        texture=tiles(rng, ((0.36, 0.16, 0.11), (0.44, 0.2, 0.14), (0.3, 0.14, 0.1)), count=8, joint=(0.4, 0.38, 0.35)))
    room.plan(((0, 0), (5.2, 0), (5.2, 3), (3.8, 4.4), (0, 4.4)), 2.5,
              floor=material(POLISHED, texture=planks(rng, count=9, color=(0.22, 0.12, 0.07))),
              wall=[dark, dark, brick, dark, material(color=(0.5, 0.32, 0.12))], ceiling=material(color=(0.6, 0.58, 0.55)))
    black = material(POLISHED, color=(0.025, 0.025, 0.025))
    room.add(box("screen-body", (1.5, 0.85, 0.14), (3.3, 1.87, 0.18), black),
             quad("screen", (1.54, 0.89, 0.185), (1.72, 0, 0), (0, 0.94, 0),
                  material(color=(0.03, 0.03, 0.03), emission=4.0 * picture(rng) ** 1.5)))
    for x in (1.6, 3.15):
        room.add(quad("behind-screen", (x, 0.95, 0.13), (0, 0.8, 0), (0.03, 0, 0), material(emission=(9, 4, 16))), hidden=True)
    room.add(box("black-screen", (5.1, 1.0, 0.7), (5.15, 1.65, 1.8), black),
             box("black-screen-glass", (5.09, 1.03, 0.73), (5.1, 1.62, 1.77),
                 material(roughness=0.08, specular=0.5, color=(0.02, 0.02, 0.02))),
             quad("page-screen", (0.65, 0.82, 2.45), (0, 0, -0.5), (-0.06, 0.32, 0),
                  material(color=(0.03, 0.03, 0.03), emission=(2.6, 2.7, 2.9))),
             box("page-screen-back", (0.5, 0.8, 1.93), (0.58, 1.1, 2.47), black))
    room.models(
        ("blendswap-cc-by/tvStand", (2.4, 0, 0.3), dict(height=0.5)),
        ("blendswap-cc-0/speaker2", (0.8, 0, 0.35), dict(height=1.0)),
        ("blendswap-cc-0/speaker2", (4.0, 0, 0.35), dict(height=1.0)),
        ("scopia/leather_sofa", (2.3, 0, 3.6), dict(height=0.85, turned=180)),
        ("scopia/coffee-table2", (2.3, 0, 2.3), dict(height=0.4)),
        ("blendswap-cc-by/simpleDesk", (0.5, 0, 2.2), dict(height=0.78, turned=90)),
        ("scopia/office_chair", (1.15, 0, 2.2), dict(height=0.95, turned=-90)),
        ("blendswap-cc-0/armchair2", (4.4, 0, 2.6), dict(height=0.85, turned=-110)),
        ("blendswap-cc-by/decorativePlant", (3.6, 0, 4.0), dict(height=1.0)),
        ("blendswap-cc-by/rubix2", (2.0, 0.41, 2.3), dict(height=0.08, turned=25)),
        ("katorlegaz/bowl", (2.6, 0.41, 2.35), dict(height=0.1)),
        ("blendswap-cc-0/electricGuitar", (0.2, 0.02, 3.9), dict(height=1.0, turned=90)))
    brass = material(METAL, color=(0.6, 0.42, 0.15))
    room.add(box("stand", (4.78, 0, 2.88), (4.82, 1.5, 2.92), brass),
             sphere("stand-lamp", (4.8, 1.62, 2.9), 0.14, material(emission=(26, 18, 9))),
             sphere("desk-lamp", (0.35, 1.25, 1.5), 0.06, material(emission=(60, 50, 34))),
             box("desk-lamp-foot", (0.34, 0.78, 1.49), (0.36, 1.2, 1.51), brass),
             quad("poster", (0.01, 1.3, 4.1), (0, 0, -1.0), (0, 0.8, 0), material(texture=picture(rng))))
    return room


def gallery(rng):
    room = Room((7.0, 3.0, 5.4), rng)
    white = material(color=(0.86, 0.86, 0.85))
    concrete = 0.55 * (0.85 + 0.3 * noise(512, 512, (14, 14), rng)[..., None]) * np.array((1.0, 0.98, 0.95))
    room.plan(((0, 0), (7, 0), (7, 2.6), (4.6, 2.6), (4.6, 5.4), (2.2, 5.4), (2.2, 2.6), (0, 2.6)), 3.0,
              floor=material(roughness=0.3, specular=0.5, texture=concrete), wall=white,
              ceiling=material(color=(0.88, 0.88, 0.88)))
    room.add(box("cornice", (0.005, 2.55, 0.004), (6.995, 2.59, 0.16), white),
             box("cornice-lip", (0.005, 2.59, 0.14), (6.995, 2.66, 0.16), white),
             box("cornice", (2.204, 2.55, 2.8), (2.36, 2.59, 5.395), white),
             box("cornice-lip", (2.34, 2.59, 2.8), (2.36, 2.66, 5.395), white))
    room.add(strip("above-cornice", (0.2, 2.595, 0.04), (6.6, 0.04), (15, 14, 12), down=False),
             strip("above-cornice", (2.24, 2.595, 2.9), (0.04, 2.4), (15, 14, 12), down=False), hidden=True)
    for x, z in ((1.2, 1.8), (2.8, 1.8), (4.4, 1.8), (6.0, 1.8), (3.4, 3.4), (3.4, 4.6)):
        room.add(box("spot-ring", (x - 0.08, 2.93, z - 0.08), (x + 0.08, 2.999, z + 0.08), material(color=(0.1, 0.1, 0.1))),
                 quad("spot", (x - 0.06, 2.925, z - 0.06), (0.12, 0, 0), (0, 0, 0.12), material(emission=(45, 42, 36))))
    for k, x in enumerate((0.7, 2.5, 4.3)):
        room.add(box("frame", (x, 1.0, 0.004), (x + 1.3, 2.0, 0.03), material(SATIN, color=(0.08, 0.07, 0.06))),
                 quad("painting", (x + 0.05, 1.05, 0.035), (1.2, 0, 0), (0, 0.9, 0),
                      material(SATIN if k else POLISHED, texture=picture(rng))))
    room.add(quad("painting", (4.59, 1.0, 3.2), (0, 0, 1.5), (0, 1.0, 0), material(texture=picture(rng))),
             quad("painting", (6.99, 0.9, 0.6), (0, 0, 1.4), (0, 1.1, 0), material(texture=picture(rng))))
    for at, size in (((1.1, 0, 1.6), 0.9), ((5.8, 0, 1.5), 1.0), ((3.4, 0, 4.7), 0.8)):
        room.add(box("pedestal", (at[0] - 0.2, 0, at[2] - 0.2), (at[0] + 0.2, size, at[2] + 0.2), white), blocks=True)
    bronze = material(METAL, color=(0.45, 0.28, 0.14))
    room.models(
        ("blendswap-cc-by/horse", (1.1, 0.9, 1.6), dict(height=0.45, turned=30, kind=bronze)),
        ("scopia/vase1", (5.8, 1.0, 1.5), dict(height=0.4)),
        ("blendswap-cc-by/siameseCat", (3.4, 0.8, 4.7), dict(height=0.22, kind=material(SATIN, color=(0.03, 0.03, 0.03)))),
        ("katorlegaz/bench", (3.4, 0, 2.6), dict(height=0.45)),
        ("blendswap-cc-0/decorativePlant", (2.6, 0, 5.0), dict(height=1.3)),
        ("blendswap-cc-by/plaidChair", (0.6, 0, 2.1), dict(height=0.85, turned=120)))
    return room


ROOMS = {make.__name__: make for make in (galley, gable, sunroom, hotel, den, gallery)}
