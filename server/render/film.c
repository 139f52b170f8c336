/* film.c -- see film.h. A work item is a row of pixels. */
#include "server/render/film.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

#define BATCH 1024            /* paths that a thread traces at once */
#define PASSED_SHARE 0x1p-16f /* of a distance: more than its rounding, as in accel_offset */

/* Channels of the picture. */
enum film_kind {
    FILM_ERRORS, /* mean, standard error */
    FILM_DIRECT, /* the same, direct light */
    FILM_HALVES  /* means of the first half of the groups and of the second */
};

struct film {
    const struct world *world;
    const struct camera *camera;
    const struct path_settings *settings;
    uint32_t spp, iteration; /* spp per group */
    enum film_kind kind;
    struct image *image;
    struct film_slot *slot;
};

/* Scratch of one thread. */
struct film_slot {
    struct path_batch *batch;
    struct ray *ray;
    struct path_key *key;
    uint32_t *pixel; /* column of each path of the batch */
    rgb *radiance;
    rgb *sum;    /* [width][FILM_GROUPS] */
    rgb *direct; /* [width] the same over all groups */
};

/* Distance of the last back that a ray of a camera that looks in passes before it meets a front; 0 of others. */
static float first_front(const struct film *f, vec3 origin, vec3 direction) {
    float near_m = 0.0f;
    struct accel_hit hit;
    while (f->camera->looks_in && accel_intersect(f->world->accel, origin, direction, near_m, INFINITY, &hit) &&
           vec3_dot(f->world->triangle[hit.triangle].normal, direction) > 0.0f)
        near_m = hit.distance_m * (1.0f + PASSED_SHARE) + FLT_MIN;
    return near_m;
}

static void trace(struct film *f, struct film_slot *s, size_t count) {
    path_batch_trace(s->batch, f->world, f->settings, count, s->ray, s->key, s->radiance);
    for (size_t i = 0; i < count; i++) {
        rgb *sum = &s->sum[s->pixel[i] * FILM_GROUPS + s->key[i].iteration % FILM_GROUPS];
        *sum = rgb_add(*sum, s->radiance[i]);
    }
    const rgb *direct = path_batch_direct(s->batch);
    for (size_t i = 0; i < count && f->kind == FILM_DIRECT; i++)
        s->direct[s->pixel[i]] = rgb_add(s->direct[s->pixel[i]], direct[i]);
}

/* Mean of a channel over groups first to end, and of its square. */
static double group_mean(const struct film *f, const rgb sum[FILM_GROUPS], int channel, int first, int end,
                         double *square) {
    double mean = 0.0;
    *square = 0.0;
    for (int g = first; g < end; g++) {
        double value = (double)(channel == 0 ? sum[g].r : channel == 1 ? sum[g].g : sum[g].b) / f->spp;
        mean += value / (end - first);
        *square += value * value / (end - first);
    }
    return mean;
}

static void finish_row(const struct film *f, const struct film_slot *s, uint32_t y) {
    for (uint32_t x = 0; x < f->image->width; x++) {
        float *out = f->image->pixel + ((size_t)y * f->image->width + x) * f->image->channel_count;
        const rgb *sum = s->sum + (size_t)x * FILM_GROUPS;
        double square;
        for (int c = 0; c < 3 && f->kind == FILM_HALVES; c++) {
            out[c] = (float)group_mean(f, sum, c, 0, FILM_GROUPS / 2, &square);
            out[3 + c] = (float)group_mean(f, sum, c, FILM_GROUPS / 2, FILM_GROUPS, &square);
        }
        for (int c = 0; c < 3 && f->kind != FILM_HALVES; c++) {
            double mean = group_mean(f, sum, c, 0, FILM_GROUPS, &square);
            out[c] = (float)mean;
            out[3 + c] = (float)sqrt(fmax(0.0, square - mean * mean) / (FILM_GROUPS - 1));
        }
        if (f->kind == FILM_DIRECT) {
            rgb direct = rgb_scale(s->direct[x], 1.0f / (float)(f->spp * FILM_GROUPS));
            memcpy(out + 6, &direct, sizeof direct);
        }
    }
}

static void render_row(void *user, size_t row, int thread) {
    struct film *f = user;
    struct film_slot *s = &f->slot[thread];
    uint32_t width = f->image->width, y = (uint32_t)row;
    for (uint32_t i = 0; i < width * FILM_GROUPS; i++)
        s->sum[i] = (rgb){0.0f, 0.0f, 0.0f};
    memset(s->direct, 0, width * sizeof *s->direct);
    vec3 origin = camera_origin(f->camera);
    size_t count = 0;
    for (uint32_t x = 0; x < width; x++) {
        for (uint32_t i = 0; i < f->spp * FILM_GROUPS; i++) {
            struct path_key key = {y * width + x, f->iteration * FILM_GROUPS + i / f->spp, i % f->spp};
            uint32_t stream = sampler_key(f->settings->seed, key.index, key.iteration);
            vec2 jitter = sampler_pair(stream, key.sample, 0);
            struct ray *ray = &s->ray[count];
            s->key[count] = key;
            s->pixel[count] = x;
            if (camera_direction(f->camera, (float)x + jitter.x, (float)y + jitter.y, &ray->direction)) {
                ray->origin = vec3_mad(origin, first_front(f, origin, ray->direction), ray->direction);
                count++;
            }
            if (count == BATCH) {
                trace(f, s, count);
                count = 0;
            }
        }
    }
    trace(f, s, count);
    finish_row(f, s, y);
}

static uint64_t render(const struct world *world, const struct camera *camera, uint32_t spp,
                       const struct path_settings *settings, uint32_t iteration, enum film_kind kind,
                       struct parallel *pool, struct image *image) {
    static const char *const names[] = {"R", "G", "B", "err.R", "err.G", "err.B", "direct.R", "direct.G", "direct.B"};
    static const char *const halves[] = {"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"};
    image_init(image, camera->width, camera->height, kind == FILM_DIRECT ? 9 : 6, kind == FILM_HALVES ? halves : names);
    int thread_count = parallel_thread_count(pool);
    struct film_slot *slot = mem_calloc((size_t)thread_count, sizeof *slot);
    for (int i = 0; i < thread_count; i++) {
        slot[i].batch = path_batch_new_forward(BATCH);
        slot[i].ray = mem_array(BATCH, sizeof *slot[i].ray);
        slot[i].key = mem_array(BATCH, sizeof *slot[i].key);
        slot[i].pixel = mem_array(BATCH, sizeof *slot[i].pixel);
        slot[i].radiance = mem_array(BATCH, sizeof *slot[i].radiance);
        slot[i].sum = mem_array((size_t)camera->width * FILM_GROUPS, sizeof *slot[i].sum);
        slot[i].direct = mem_array(camera->width, sizeof *slot[i].direct);
    }
    uint32_t group_spp = (spp + FILM_GROUPS - 1) / FILM_GROUPS;
    struct film film = {world, camera, settings, group_spp, iteration, kind, image, slot};
    parallel_for(pool, camera->height, render_row, &film);
    uint64_t dropped = 0;
    for (int i = 0; i < thread_count; i++) {
        uint64_t rays, lost;
        path_batch_counts(slot[i].batch, &rays, &lost);
        dropped += lost;
        path_batch_free(slot[i].batch);
        mem_free(slot[i].ray);
        mem_free(slot[i].key);
        mem_free(slot[i].pixel);
        mem_free(slot[i].radiance);
        mem_free(slot[i].sum);
        mem_free(slot[i].direct);
    }
    mem_free(slot);
    return dropped;
}

uint64_t film_render(const struct world *world, const struct camera *camera, uint32_t spp,
                     const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                     struct image *image) {
    return render(world, camera, spp, settings, iteration, FILM_ERRORS, pool, image);
}

uint64_t film_render_direct(const struct world *world, const struct camera *camera, uint32_t spp,
                            const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                            struct image *image) {
    return render(world, camera, spp, settings, iteration, FILM_DIRECT, pool, image);
}

uint64_t film_render_halves(const struct world *world, const struct camera *camera, uint32_t spp,
                            const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                            struct image *image) {
    return render(world, camera, spp, settings, iteration, FILM_HALVES, pool, image);
}

enum {
    BASE_R,
    BASE_G,
    BASE_B,
    ROUGHNESS,
    SPECULAR,
    EMISSION_R,
    EMISSION_G,
    EMISSION_B,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
    SEGMENT,
    DEPTH,
    COVERAGE,
    CHANNELS
};

static void add_hit(const struct film *f, const struct accel_hit *hit, vec3 direction, float depth_m, bool first,
                    float *out) {
    const struct materials *m = f->world->materials;
    const struct world_triangle *t = &f->world->triangle[hit->triangle];
    struct texture_taps taps;
    vec2 place = atlas_point(f->world->atlas, hit->triangle, hit->b1, hit->b2);
    texture_taps(&m->base_color, place.x, place.y, &taps);
    rgb base = texture_gather(&m->base_color, &taps);
    rgb emission = materials_emission(m, t->segment, place.x, place.y);
    vec3 point = mesh_point(f->world->mesh, hit->triangle, hit->b1, hit->b2);
    vec3 normal = surface_shading(f->world->mesh, hit->triangle, hit->b1, hit->b2, t->normal);
    normal = vec3_dot(normal, direction) > 0.0f ? vec3_neg(normal) : normal;
    float roughness = m->roughness[t->segment], metallic;
    if (m->metallic)
        materials_gloss(m, t->segment, place.x, place.y, &roughness, &metallic);
    const float value[] = {base.r,     base.g,     base.b,     roughness, m->specular[t->segment],
                           emission.r, emission.g, emission.b, normal.x,  normal.y,
                           normal.z,   point.x,    point.y,    point.z};
    for (int c = 0; c < SEGMENT; c++)
        out[c] += value[c];
    if (first)
        out[SEGMENT] = (float)t->segment;
    out[DEPTH] += depth_m;
    out[COVERAGE] += 1.0f;
}

static void first_hit_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct film *f = user;
    uint32_t y = (uint32_t)row;
    vec3 origin = camera_origin(f->camera);
    for (uint32_t x = 0; x < f->image->width; x++) {
        float *out = f->image->pixel + ((size_t)y * f->image->width + x) * CHANNELS;
        out[SEGMENT] = -1.0f;
        uint32_t stream = sampler_key(f->settings->seed, y * f->image->width + x, 0);
        for (uint32_t i = 0; i < f->spp; i++) {
            vec2 jitter = sampler_pair(stream, i, 0);
            vec3 direction;
            struct accel_hit hit;
            if (!camera_direction(f->camera, (float)x + jitter.x, (float)y + jitter.y, &direction) ||
                !accel_intersect(f->world->accel, origin, direction, first_front(f, origin, direction), INFINITY, &hit))
                continue;
            bool is_panorama = f->camera->model == CAMERA_PANORAMA;
            float along = is_panorama ? 1.0f : rigid_direction(&f->camera->camera_from_world, direction).z;
            add_hit(f, &hit, direction, along * hit.distance_m, i == 0, out);
        }
        float over_all = 1.0f / (float)f->spp;
        for (int c = NORMAL_X; c <= DEPTH && out[COVERAGE] > 0.0f; c++)
            out[c] /= c == SEGMENT ? 1.0f : out[COVERAGE];
        for (int c = 0; c < NORMAL_X; c++)
            out[c] *= over_all;
        out[COVERAGE] *= over_all;
    }
}

void film_render_first_hits(const struct world *world, const struct camera *camera, uint32_t spp, uint64_t seed,
                            struct parallel *pool, struct image *image) {
    static const char *const names[CHANNELS] = {
        "base_color.R", "base_color.G", "base_color.B", "roughness", "specular", "emission.R",
        "emission.G",   "emission.B",   "normal.X",     "normal.Y",  "normal.Z", "position.X",
        "position.Y",   "position.Z",   "segment",      "depth",     "coverage"};
    image_init(image, camera->width, camera->height, CHANNELS, names);
    struct path_settings settings = {.max_depth = 1, .roulette_depth = 1, .seed = seed};
    struct film film = {world, camera, &settings, spp, 0, FILM_ERRORS, image, NULL};
    parallel_for(pool, camera->height, first_hit_row, &film);
}
