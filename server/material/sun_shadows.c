/* sun_shadows.c -- see sun_shadows.h. */
#include "server/material/sun_shadows.h"

#include "common/mem.h"

#define CHUNK 1024 /* texels a work item */
#define TILE 32    /* texels a side; look-ups of wider footprints may miss an edge */
/* A pixel averages over its width, and a bilinear look-up weights pixels by a triangle: three uniform variables, of
 * whose sum these are quantiles 1/16, 3/16, .. along each axis, in pixels. */
#define LOOKUPS 8
static const float lookup[LOOKUPS] = {-0.7789f, -0.4599f, -0.2576f, -0.0836f, 0.0836f, 0.2576f, 0.4599f, 0.7789f};

#define CUBIC_PIXELS 2.0f /* that a bicubic look-up reads, each way */

struct finding {
    struct sun_shadows *shadows;
    const struct sun *sun;
    const struct accel *accel;
};

static void find_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct finding *job = user;
    const struct surface *s = &job->shadows->surface;
    size_t begin = chunk * CHUNK,
           end = begin + CHUNK < s->inverse->valid_count ? begin + CHUNK : s->inverse->valid_count;
    for (size_t i = begin; i < end; i++) {
        struct surface_point at;
        uint32_t texel = s->inverse->valid[i];
        if (surface_at_texel(s->mesh, s->atlas, s->inverse, texel, &at))
            job->shadows->visible[texel] = (uint8_t)(255.0f * sun_visibility(job->sun, job->accel, &at, 0) + 0.5f);
    }
}

static size_t tile_of(const struct sun_shadows *s, uint32_t x, uint32_t y) {
    return (size_t)(y / TILE) * s->tiles_across + x / TILE;
}

/* Marks each tile in which, or beside which, texels differ. */
static void find_mixed(struct sun_shadows *s) {
    const struct inverse_uv *inverse = s->surface.inverse;
    uint32_t width = s->surface.atlas->width, down = (s->surface.atlas->height + TILE - 1) / TILE;
    s->tiles_across = (width + TILE - 1) / TILE;
    size_t tiles = (size_t)s->tiles_across * down;
    uint8_t(*range)[2] = mem_array(tiles, sizeof *range);
    s->is_mixed = mem_calloc(tiles, sizeof *s->is_mixed);
    for (size_t i = 0; i < tiles; i++)
        range[i][0] = 255, range[i][1] = 0;
    for (size_t i = 0; i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i];
        uint8_t visible = s->visible[texel], *of = range[tile_of(s, texel % width, texel / width)];
        of[0] = visible < of[0] ? visible : of[0];
        of[1] = visible > of[1] ? visible : of[1];
    }
    for (uint32_t y = 0; y < down; y++) {
        for (uint32_t x = 0; x < s->tiles_across; x++) {
            uint8_t least = 255, most = 0;
            for (uint32_t v = y > 0 ? y - 1 : 0; v <= y + 1 && v < down; v++) {
                for (uint32_t u = x > 0 ? x - 1 : 0; u <= x + 1 && u < s->tiles_across; u++) {
                    const uint8_t *of = range[(size_t)v * s->tiles_across + u];
                    least = of[0] < least ? of[0] : least;
                    most = of[1] > most ? of[1] : most;
                }
            }
            s->is_mixed[(size_t)y * s->tiles_across + x] = least < most;
        }
    }
    mem_free(range);
}

void sun_shadows_init(struct sun_shadows *s, const struct surface *surface, const struct sun *sun,
                      const struct accel *accel, struct parallel *pool) {
    *s = (struct sun_shadows){.surface = *surface};
    if (!sun->is_there)
        return;
    s->visible = mem_calloc_large((size_t)surface->atlas->width * surface->atlas->height, sizeof *s->visible);
    struct finding job = {s, sun, accel};
    parallel_for(pool, (surface->inverse->valid_count + CHUNK - 1) / CHUNK, find_chunk, &job);
    find_mixed(s);
}

void sun_shadows_release(struct sun_shadows *s) {
    mem_free(s->visible);
    mem_free(s->is_mixed);
    *s = (struct sun_shadows){0};
}

float sun_shadows_at(const struct sun_shadows *s, uint32_t texel) {
    return s->visible ? (float)s->visible[texel] / 255.0f : 0.0f;
}

bool sun_shadows_blurs(const struct sun_shadows *s, uint32_t texel) {
    if (!s->visible)
        return false;
    uint32_t width = s->surface.atlas->width;
    return s->is_mixed[tile_of(s, texel % width, texel / width)];
}

/* Mean over the texels of the chart at `scale` times the places of a look-up, and whether they differ from its own. */
static bool average(const struct sun_shadows *s, uint32_t texel, const struct footprint *pixel, float scale,
                    float *mean) {
    const struct inverse_uv *inverse = s->surface.inverse;
    uint32_t width = s->surface.atlas->width, height = s->surface.atlas->height;
    uint32_t chart = surface_chart(&s->surface, texel), sum = s->visible[texel], count = 1;
    float x0 = (float)(texel % width) + 0.5f, y0 = (float)(texel / width) + 0.5f;
    bool differ = false;
    for (int i = 0; i < LOOKUPS * LOOKUPS; i++) {
        float across = scale * lookup[i % LOOKUPS], down = scale * lookup[i / LOOKUPS];
        float x = x0 + across * pixel->across.x + down * pixel->down.x;
        float y = y0 + across * pixel->across.y + down * pixel->down.y;
        if (!(x >= 0.0f && y >= 0.0f && x < (float)width && y < (float)height))
            continue;
        uint32_t other = (uint32_t)y * width + (uint32_t)x;
        if (inverse->triangle[other] == INVERSE_UV_NONE || surface_chart(&s->surface, other) != chart)
            continue;
        differ = differ || s->visible[other] != s->visible[texel];
        sum += s->visible[other];
        count++;
    }
    *mean = (float)sum / (255.0f * (float)count);
    return differ;
}

bool sun_shadows_seen(const struct sun_shadows *s, uint32_t texel, const struct footprint *pixel, float *seen) {
    bool differ = average(s, texel, pixel, CUBIC_PIXELS / lookup[LOOKUPS - 1], seen);
    if (differ)
        average(s, texel, pixel, 1.0f, seen);
    return differ;
}
