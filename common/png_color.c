/* png_color.c -- see png_color.h. Chunks: PNG specification, third edition, 11.3.2.
 *
 * libpng is not used: before 1.6.46 it ignores cICP, and of several kinds of chunks it keeps the first. */
#include "common/png_color.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

#include "common/color_cicp.h"
#include "common/color_icc.h"
#include "common/mem.h"

#define CHUNK_MAX ((size_t)8 << 20)    /* bytes; no picture has a longer profile */
#define PROFILE_MAX ((size_t)16 << 20) /* inflated */

enum chunk_kind { CICP, ICCP, SRGB, CHRM, GAMA, KIND_COUNT };
static const char kind_name[KIND_COUNT][5] = {"cICP", "iCCP", "sRGB", "cHRM", "gAMA"};
static const size_t least_length[KIND_COUNT] = {4, 4, 1, 32, 4};

struct chunk {
    uint8_t *data; /* NULL: not there; owned */
    size_t length;
};

static uint32_t big_endian(const uint8_t *at) {
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

static void warn(struct color *color, const char *kind, const char *what) {
    snprintf(color->warning, sizeof color->warning, "its chunk %s %s", kind, what);
}

/* Reads the chunk at `at`, with its checksum; false, with a warning, where it is damaged. */
static bool read_chunk(struct image_source *source, uint64_t at, size_t length, enum chunk_kind kind,
                       struct chunk *chunk, struct color *color) {
    if (length < least_length[kind] || length > CHUNK_MAX) {
        warn(color, kind_name[kind], "has an impossible length");
        return false;
    }
    uint8_t *data = mem_alloc(length + 8); /* name, data, checksum */
    size_t got = image_source_read(source, at + 4, data, length + 8);
    bool is_whole = got == length + 8 && crc32_z(0, data, length + 4) == big_endian(data + 4 + length);
    if (is_whole) {
        memmove(data, data + 4, length);
        *chunk = (struct chunk){data, length};
        return true;
    }
    warn(color, kind_name[kind], "is damaged");
    mem_free(data);
    return false;
}

/* The first of each kind, before the pixels. */
static void find_chunks(struct image_source *source, struct chunk found[KIND_COUNT], struct color *color) {
    uint8_t head[8];
    uint64_t at = 8;
    while (image_source_read(source, at, head, sizeof head) == sizeof head && memcmp(head + 4, "IDAT", 4) != 0 &&
           memcmp(head + 4, "IEND", 4) != 0) {
        size_t length = big_endian(head);
        for (int k = 0; k < KIND_COUNT; k++)
            if (memcmp(head + 4, kind_name[k], 4) == 0 && !found[k].data)
                read_chunk(source, at, length, (enum chunk_kind)k, &found[k], color);
        at += 12 + (uint64_t)length;
    }
}

/* --- each kind ------------------------------------------------------------------------------ */

static bool use_cicp(const uint8_t *data, int bits, struct color *color) {
    return color_set_cicp(color, "its chunk cICP", data, bits);
}

/* A name, 0, the method (0: deflate), the profile. */
static bool use_iccp(const struct chunk *chunk, bool is_grey, int bits, struct color *color) {
    size_t name = strnlen((const char *)chunk->data, chunk->length), at = name + 2;
    if (at >= chunk->length || chunk->data[name + 1] != 0) {
        warn(color, "iCCP", "is damaged");
        return false;
    }
    size_t room = (chunk->length - at) * 32 < PROFILE_MAX ? (chunk->length - at) * 32 + 4096 : PROFILE_MAX;
    uint8_t *profile = mem_alloc(room);
    uLongf length = room;
    int result = uncompress(profile, &length, chunk->data + at, chunk->length - at);
    if (result == Z_MEM_ERROR)
        mem_exhausted("zlib");
    if (result == Z_OK)
        color_set_profile(color, profile, length, is_grey, bits);
    else
        warn(color, "iCCP", "is damaged");
    mem_free(profile);
    return color->warning[0] == '\0';
}

static double hundred_thousandths(const uint8_t *at) { return (double)big_endian(at) / 100000.0; }

/* sRGB files may carry gAMA 1/2.2 for programs that know only gAMA (11.3.2.5); together with sRGB's primaries or none
 * this means sRGB. Files without gAMA have sRGB's curve. */
static bool use_numbers(const struct chunk *chrm, const struct chunk *gama, int bits, struct color *color) {
    struct color_primaries p = color_rec709;
    char name[COLOR_NAME_SIZE] = "", curve[32] = "";
    double *const xy[8] = {&p.white[0], &p.white[1], &p.red[0],  &p.red[1],
                           &p.green[0], &p.green[1], &p.blue[0], &p.blue[1]};
    for (int i = 0; i < 8 && chrm->data; i++)
        *xy[i] = hundred_thousandths(chrm->data + 4 * i);
    double stored = gama->data ? hundred_thousandths(gama->data) : 1.0 / 2.2;
    bool is_srgb_curve = fabs(stored - 1.0 / 2.2) < 1e-4;
    if (gama->data && stored == 1.0)
        snprintf(curve, sizeof curve, "linear light");
    else if (gama->data)
        snprintf(curve, sizeof curve, "gamma %.4g", 1.0 / stored);
    if (chrm->data)
        snprintf(name, sizeof name, "primaries of its own%s%s", curve[0] ? ", " : "", curve);
    else
        snprintf(name, sizeof name, "%s", curve);
    color_set(color, name, &p, is_srgb_curve ? COLOR_SRGB : COLOR_POWER, 1.0 / stored, bits);
    return color->warning[0] == '\0';
}

bool png_color_read(struct image_source *source, bool is_grey, int bits, struct color *color) {
    struct chunk found[KIND_COUNT] = {{0}};
    struct color before;
    color_init(color);
    find_chunks(source, found, color);
    before = *color; /* keeps the warning of a damaged chunk */
    bool is_told = (found[CICP].data && use_cicp(found[CICP].data, bits, color)) ||
                   (found[ICCP].data && use_iccp(&found[ICCP], is_grey, bits, color)) || found[SRGB].data != NULL ||
                   ((found[CHRM].data || found[GAMA].data) && use_numbers(&found[CHRM], &found[GAMA], bits, color));
    if (is_told && before.warning[0] && !color->warning[0])
        memcpy(color->warning, before.warning, sizeof color->warning);
    for (int k = 0; k < KIND_COUNT; k++)
        mem_free(found[k].data);
    return is_told;
}

const char *image_zlib_version(void) { return zlibVersion(); }
