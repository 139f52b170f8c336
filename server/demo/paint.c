/* paint.c -- see paint.h. Lengths are in metres. Features are at least a few centimetres wide, so that textures of
 * moderate size resolve them. */
#include "server/demo/paint.h"

#include <math.h>

#include "common/image.h"
#include "common/rng.h"

/* A colour 0xRRGGBB, sRGB. */
static rgb hex(uint32_t code) {
    return rgb_make(image_srgb_to_linear((float)(code >> 16 & 255) / 255.0f),
                    image_srgb_to_linear((float)(code >> 8 & 255) / 255.0f),
                    image_srgb_to_linear((float)(code & 255) / 255.0f));
}

static rgb mix(rgb a, rgb b, float t) { return rgb_mad(rgb_scale(a, 1.0f - t), t, b); }

static float smooth(float from, float to, float x) {
    float t = clampf((x - from) / (to - from), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

/* A number in [0, 1) for a cell of the integer lattice. */
static float cell(int x, int y, int key) {
    uint64_t bits = rng_key((uint64_t)(uint32_t)x, (uint64_t)(uint32_t)y, (uint64_t)(uint32_t)key);
    return rng_to_float((uint32_t)(bits >> 32));
}

/* Value noise of unit wavelength in [0, 1). */
static float noise(float x, float y, int key) {
    int i = (int)floorf(x), j = (int)floorf(y);
    float u = smooth(0.0f, 1.0f, x - (float)i), v = smooth(0.0f, 1.0f, y - (float)j);
    float low = cell(i, j, key) * (1.0f - u) + cell(i + 1, j, key) * u;
    float high = cell(i, j + 1, key) * (1.0f - u) + cell(i + 1, j + 1, key) * u;
    return low * (1.0f - v) + high * v;
}

static float clouds(float x, float y, int key) {
    return 0.55f * noise(x, y, key) + 0.3f * noise(2.1f * x, 2.1f * y, key + 1) +
           0.15f * noise(4.3f * x, 4.3f * y, key + 2);
}

/* 0 to 1 to 0 over one period. */
static float wave(float x) { return 2.0f * fabsf(x - floorf(x) - 0.5f); }

/* --- surfaces; (u, v) are metres in the surface's plane ------------------------------------- */

static rgb planks(float u, float v) {
    int row = (int)floorf(v / 0.16f);
    float shift = u + 1.3f * cell(row, 0, 1);
    int plank = (int)floorf(shift / 1.2f);
    float tone = cell(row, plank, 2);
    float grain = clouds(shift * 2.0f, v * 22.0f, 3 + plank);
    rgb c = mix(hex(0x8a5a34), hex(0xc08c5a), 0.55f * tone + 0.45f * grain);
    float gap = fminf(v / 0.16f - (float)row, (float)row + 1.0f - v / 0.16f) * 0.16f;
    return rgb_scale(c, 0.55f + 0.45f * smooth(0.0f, 0.012f, gap));
}

static rgb wood(float along, float across, uint32_t dark, uint32_t light, int key) {
    float bend = across * 9.0f + 1.6f * clouds(along * 0.9f, across * 2.5f, key);
    return mix(hex(dark), hex(light), 0.7f * wave(bend) + 0.3f * noise(along * 6.0f, across * 30.0f, key));
}

static rgb plaster(float u, float v, uint32_t dark, uint32_t light, int key) {
    return mix(hex(dark), hex(light), clouds(u * 1.7f, v * 1.7f, key));
}

static rgb wallpaper(float u, float v) {
    float stripe = wave(u / 0.36f);
    rgb c = mix(hex(0xd8cfba), hex(0x8aa0a8), smooth(0.45f, 0.55f, stripe));
    float x = (u / 0.36f - floorf(u / 0.36f) - 0.5f) * 0.36f;
    float y = (v / 0.3f - floorf(v / 0.3f) - 0.5f) * 0.3f;
    float flower = sqrtf(x * x + y * y) * (1.0f + 0.25f * cosf(5.0f * atan2f(y, x)));
    return mix(hex(0xa5503c), c, smooth(0.04f, 0.055f, flower));
}

static rgb bricks(float u, float v) {
    int row = (int)floorf(v / 0.1f);
    float shift = u / 0.28f + 0.5f * (float)(row & 1);
    int brick = (int)floorf(shift);
    float edge = fminf(fminf(shift - (float)brick, (float)brick + 1.0f - shift) * 0.28f,
                       fminf(v / 0.1f - (float)row, (float)row + 1.0f - v / 0.1f) * 0.1f);
    float tone = 0.7f * cell(row, brick, 11) + 0.3f * noise(u * 20.0f, v * 20.0f, 12);
    return mix(hex(0xc9c2b4), mix(hex(0x8d4a38), hex(0xb97a5c), tone), smooth(0.006f, 0.014f, edge));
}

static rgb carpet(float x, float z) {
    float u = x - 1.0f, v = z - 0.9f; /* its corner */
    float border = fminf(fminf(u, 2.8f - u), fminf(v, 2.2f - v));
    if (border < 0.05f)
        return hex(0xd9c79a);
    if (border < 0.28f) {
        float run = border == u || border == 2.8f - u ? v : u;
        bool figure = wave(run / 0.2f) > wave((border - 0.05f) / 0.23f);
        return figure ? hex(0x1f3557) : hex(0xb8863b);
    }
    if (border < 0.32f)
        return hex(0xd9c79a);
    float a = (u + v) / 0.34f, b = (u - v) / 0.34f;
    float knot = fmaxf(wave(a), wave(b));
    int i = (int)floorf(a), j = (int)floorf(b);
    rgb field = cell(i, j, 21) < 0.5f ? hex(0x8e2430) : hex(0x6f1b2c);
    if (knot > 0.88f)
        return hex(0xd9c79a);
    return wave(a) < 0.3f && wave(b) < 0.3f ? hex(0x2c5a6e) : field;
}

static rgb landscape(float u, float v) { /* u in [0, 1.6], v in [0, 1] */
    float x = u - 1.15f, y = v - 0.68f;
    rgb c = mix(hex(0xf0c27a), hex(0x4f86b0), smooth(0.35f, 1.0f, v));
    c = mix(hex(0xf0e2b0), c, smooth(0.1f, 0.125f, sqrtf(x * x + y * y)));
    static const uint32_t hill[3] = {0x6b7fa0, 0x4b6b4f, 0x27402f};
    for (int i = 0; i < 3; i++) {
        float top = 0.52f - 0.16f * (float)i + 0.16f * (noise(u * (2.0f + (float)i), 0.5f, 31 + i) - 0.5f);
        c = mix(hex(hill[i]), c, smooth(top - 0.006f, top + 0.006f, v));
    }
    return c;
}

static rgb composition(float u, float v) { /* u in [0, 0.7], v in [0, 0.8] */
    static const float column[] = {0.18f, 0.44f}, row[] = {0.22f, 0.5f, 0.66f};
    static const uint32_t tint[3][4] = {{0xf2ede0, 0xc2281f, 0xf2ede0, 0x1c3f8c},
                                        {0xe3b92b, 0xf2ede0, 0xf2ede0, 0xc2281f},
                                        {0x1c3f8c, 0xf2ede0, 0xe3b92b, 0xf2ede0}};
    int i = 0, j = 0;
    float line = 1.0f;
    for (int k = 0; k < 2; k++) {
        i += u > column[k];
        line = fminf(line, fabsf(u - column[k]));
    }
    for (int k = 0; k < 3; k++) {
        j += v > row[k];
        line = fminf(line, fabsf(v - row[k]));
    }
    return mix(hex(0x16161a), hex(tint[i][j]), smooth(0.012f, 0.018f, line));
}

static rgb books(vec3 p) {
    static const uint32_t cover[6] = {0x7b2d26, 0x1f4e5f, 0xc28e2c, 0x33543a, 0x54356b, 0xb9b3a1};
    int book = 0;
    float x = 3.3f;
    for (int i = 0; i < 9 && p.x > x - 0.001f; i++) {
        x += 0.047f + 0.012f * (float)(i * 7 % 4);
        book = i;
    }
    bool band = fabsf(p.y - 1.06f) < 0.02f || fabsf(p.y - 0.95f) < 0.012f;
    return band ? hex(0xe0cf9a) : hex(cover[book % 6]);
}

static rgb globe(vec3 p) {
    float x = p.x - 4.3f, y = p.y - (1.38f + 0.19f), z = p.z - 0.15f;
    if (y < -0.118f)
        return hex(0x6a4a2c);
    float longitude = atan2f(z, x), latitude = asinf(clampf(y / 0.13f, -1.0f, 1.0f));
    /* Noise of the direction, so that it is periodic. */
    float land = clouds(2.2f * cosf(longitude) + 4.0f * latitude, 2.2f * sinf(longitude) + 9.0f, 41);
    rgb c = mix(hex(0x2d6a9f), hex(0x8a9a4a), smooth(0.5f, 0.54f, land));
    return fabsf(latitude) > 1.15f ? hex(0xe8eef0) : c;
}

static rgb vase(vec3 p) {
    float y = p.y - 0.75f, angle = atan2f(p.z - 1.84f, p.x - 2.12f);
    if (y < 0.03f || fabsf(y - 0.27f) < 0.012f || y > 0.38f)
        return hex(0x27447f);
    if (y > 0.06f && y < 0.25f) {
        float petal = 0.155f + 0.075f * cosf(6.0f * angle);
        if (fabsf(y - petal) < 0.012f)
            return hex(0x3a66b0);
    }
    return hex(0xdcdfe0);
}

static rgb tartan(float u, float v) {
    rgb c = hex(0x4d6b57);
    if (wave(u / 0.24f) > 0.6f)
        c = mix(c, hex(0x223a4a), 0.6f);
    if (wave(v / 0.24f) > 0.6f)
        c = mix(c, hex(0x223a4a), 0.6f);
    if (wave(u / 0.24f + 0.5f) > 0.9f || wave(v / 0.24f + 0.5f) > 0.9f)
        c = mix(c, hex(0xd8b25a), 0.7f);
    return c;
}

/* The two coordinates of the plane most nearly perpendicular to the normal. */
static vec2 in_plane(vec3 p, vec3 n) {
    float x = fabsf(n.x), y = fabsf(n.y), z = fabsf(n.z);
    if (y >= x && y >= z)
        return vec2_make(p.x, p.z);
    return x >= z ? vec2_make(p.z, p.y) : vec2_make(p.x, p.y);
}

rgb paint_base_color(enum room_object object, vec3 p, vec3 normal) {
    vec2 q = in_plane(p, normal);
    switch (object) {
    case ROOM_FLOOR: return planks(p.x, p.z);
    case ROOM_CEILING: return plaster(p.x, p.z, 0xd6d3cb, 0xe4e2dc, 51);
    case ROOM_WALL_WEST: return plaster(p.z, p.y, 0x8f9f80, 0xb3c0a2, 52);
    case ROOM_WALL_EAST: return wallpaper(p.z, p.y);
    case ROOM_WALL_NORTH: return plaster(p.x, p.y, 0xbf9a68, 0xd6b98a, 53);
    case ROOM_WALL_SOUTH: return bricks(p.x, p.y);
    case ROOM_CARPET: return carpet(p.x, p.z);
    case ROOM_TABLE_TOP: return wood(p.x, p.z, 0x7a4a26, 0xb98550, 61);
    case ROOM_TABLE_LEGS: return wood(p.y, q.x, 0x4a2d18, 0x6e4727, 62);
    case ROOM_DOOR: return plaster(p.x * 2.0f, p.y, 0x2f6d70, 0x4a8c8a, 54);
    case ROOM_DOOR_FRAME: return hex(0xdedad0);
    case ROOM_SHELVES: return wood(q.x, q.y, 0xa8845a, 0xd2b58a, 63);
    case ROOM_BOOKS: return books(p);
    case ROOM_GLOBE: return globe(p);
    case ROOM_CHEST: return ((int)floorf(q.x / 0.08f) + (int)floorf(q.y / 0.08f)) & 1 ? hex(0xe8dcc0) : hex(0xa83a2c);
    case ROOM_VASE: return vase(p);
    case ROOM_PAINTING_LARGE: return landscape(p.x - 0.8f, p.y - 1.05f);
    case ROOM_PAINTING_SMALL: return composition(p.z - 0.6f, p.y - 1.25f);
    case ROOM_PICTURE_FRAMES: return hex(0x7a6030);
    case ROOM_SOFA: return tartan(q.x, q.y);
    case ROOM_LAMP_FRAMES: return hex(0x8c8c90);
    case ROOM_WALL_EMITTER:
    case ROOM_CEILING_EMITTER: return hex(0xc8c8c8);
    case ROOM_OBJECT_COUNT: break;
    }
    return rgb_gray(0.5f);
}
