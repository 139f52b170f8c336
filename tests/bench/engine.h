/* engine.h -- what the engine's benches share: a room of the test data with an atlas of its own, one
 * view's paths, and ways to time them. */
#ifndef UNBAKE_TESTS_BENCH_ENGINE_H
#define UNBAKE_TESTS_BENCH_ENGINE_H

#include <time.h>

#include "common/clock.h"
#include "server/render/film.h"
#include "server/render/gradient.h"
#include "server/render/sampler.h"
#include "server/scene/inverse_uv.h"
#include "tests/render/room.h"

#define SPP 16
#define DEPTH 9
#define BATCH 2048
#define ATLAS 2048
/* As the settings of a job have it by default. */
#define ROULETTE_DEPTH 4

/* Processor time of all threads: what else runs on the machine hardly moves it. */
static inline double cpu_sec(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline double median(double *value, int count) {
    qsort(value, (size_t)count, sizeof *value, by_value);
    return count % 2 ? value[count / 2] : 0.5 * (value[count / 2 - 1] + value[count / 2]);
}

/* Paths of one view, in batches of neighbouring pixels, and a pool to run them. */
struct work {
    const struct room *room;
    struct path_settings settings;
    size_t path_count, chunk_count;
    struct ray *ray;
    struct path_key *key;
    rgb *radiance;
    struct parallel *pool;
    struct path_batch **batch, **forward; /* [threads] */
    struct gradient_log **log;            /* [chunk_count] */
    struct gradient *gradient;
    bool backward;
    size_t first; /* chunk of this iteration */
};

static inline void trace_chunk(void *user, size_t index, int thread) {
    struct work *w = user;
    index += w->first;
    size_t first = index * BATCH, count = w->path_count - first < BATCH ? w->path_count - first : BATCH;
    path_batch_trace(w->backward ? w->batch[thread] : w->forward[thread], &w->room->world, &w->settings, count,
                     w->ray + first, w->key + first, w->radiance + first);
    if (w->backward) {
        gradient_log_clear(w->log[index]);
        path_batch_backward(w->batch[thread], w->radiance + first, w->log[index]);
    }
}

/* Seconds for all paths, in iterations of 32 chunks as an optimiser's; each reduces its gradients. */
static inline double run(struct work *w, bool backward) {
    double start = clock_sec();
    w->backward = backward;
    for (w->first = 0; w->first < w->chunk_count; w->first += 32) {
        size_t count = w->chunk_count - w->first < 32 ? w->chunk_count - w->first : 32;
        parallel_for(w->pool, count, trace_chunk, w);
        if (backward)
            gradient_reduce(w->gradient, w->log + w->first, count, w->pool);
    }
    return clock_sec() - start;
}

static inline void work_init(struct work *w, const struct room *room, const struct camera *camera, int threads) {
    memset(w, 0, sizeof *w);
    w->room = room;
    w->settings = (struct path_settings){.max_depth = DEPTH,
                                         .roulette_depth = ROULETTE_DEPTH,
                                         .derivatives = true,
                                         .seed = 1,
                                         .min_color = PATH_MIN_COLOR};
    w->path_count = (size_t)camera->width * camera->height * SPP;
    w->chunk_count = (w->path_count + BATCH - 1) / BATCH;
    w->ray = mem_array(w->path_count, sizeof *w->ray);
    w->key = mem_array(w->path_count, sizeof *w->key);
    w->radiance = mem_array(w->path_count, sizeof *w->radiance);
    for (size_t i = 0; i < w->path_count; i++) {
        uint32_t pixel = (uint32_t)(i / SPP), sample = (uint32_t)(i % SPP);
        vec2 jitter = sampler_pair(sampler_key(1, pixel, 0), sample, 0);
        w->key[i] = (struct path_key){pixel, 0, sample};
        w->ray[i].origin = camera_origin(camera);
        CHECK(camera_direction(camera, (float)(pixel % camera->width) + jitter.x,
                               (float)(pixel / camera->width) + jitter.y, &w->ray[i].direction));
    }
    w->pool = parallel_new(threads);
    w->batch = mem_array((size_t)parallel_thread_count(w->pool), sizeof *w->batch);
    w->forward = mem_array((size_t)parallel_thread_count(w->pool), sizeof *w->forward);
    for (int t = 0; t < parallel_thread_count(w->pool); t++) {
        w->batch[t] = path_batch_new(BATCH, DEPTH);
        w->forward[t] = path_batch_new_forward(BATCH);
    }
    w->log = mem_array(w->chunk_count, sizeof *w->log);
    for (size_t c = 0; c < w->chunk_count; c++)
        w->log[c] = gradient_log_new(room->segments.count);
    w->gradient = gradient_new(room->atlas.width, room->atlas.height, room->segments.count);
}

static inline void work_release(struct work *w) {
    for (int t = 0; t < parallel_thread_count(w->pool); t++) {
        path_batch_free(w->batch[t]);
        path_batch_free(w->forward[t]);
    }
    for (size_t c = 0; c < w->chunk_count; c++)
        gradient_log_free(w->log[c]);
    gradient_free(w->gradient);
    parallel_free(w->pool);
    mem_free(w->ray);
    mem_free(w->key);
    mem_free(w->radiance);
    mem_free(w->batch);
    mem_free(w->forward);
    mem_free(w->log);
}

/* With the atlas that a reconstruction would use and the constant materials of truth/objects.json. */
static inline void load(struct room *room, const char *name) {
    char path[128];
    struct error err;
    memset(room, 0, sizeof *room);
    snprintf(path, sizeof path, "rooms/%s/mesh.ply", name);
    room_must(mesh_file_read(check_data(path), path, MESH_MAX_TRIANGLES, &room->mesh, NULL, &err), &err);
    struct mesh_report report;
    room_must(mesh_check(&room->mesh, path, &report, &err), &err);
    segments_from_object_id(&room->segments, &room->mesh);
    room_must(atlas_make(&room->atlas, &room->mesh, &room->segments, ATLAS, 0.0f, ATLAS_PADDING, &err), &err);
    room->pool = parallel_new(0);
    struct inverse_uv inverse;
    inverse_uv_make(&inverse, &room->atlas, room->mesh.triangle_count, room->pool);
    materials_init(&room->materials, &inverse, room->segments.count, rgb_gray(0.5f), 0.5f, 0.5f);
    snprintf(path, sizeof path, "rooms/%s/truth/objects.json", name);
    cJSON *list;
    room_must(json_read(check_data(path), (size_t)1 << 26, &list, &err), &err);
    rgb *color = mem_calloc(room->segments.count, sizeof *color);
    const cJSON *o;
    cJSON_ArrayForEach(o, list) {
        for (size_t s = 0; s < room->segments.count; s++) {
            if (room->segments.id[s] != (int64_t)cJSON_GetObjectItem(o, "id")->valuedouble)
                continue;
            room_rgb(cJSON_GetObjectItem(o, "flat_base_color"), &color[s]);
            room->materials.roughness[s] = (float)cJSON_GetObjectItem(o, "roughness")->valuedouble;
            room->materials.specular[s] = (float)cJSON_GetObjectItem(o, "specular")->valuedouble;
            room_rgb(cJSON_GetObjectItem(o, "emission"), &room->materials.emission[s]);
        }
    }
    cJSON_Delete(list);
    for (size_t i = 0; i < inverse.valid_count; i++) {
        uint32_t texel = inverse.valid[i];
        rgb c = color[room->segments.of_triangle[inverse.triangle[texel]]];
        memcpy(room->materials.base_color.texel[texel], (float[4]){c.r, c.g, c.b, 1.0f}, 4 * sizeof(float));
    }
    mem_free(color);
    inverse_uv_release(&inverse);
    room_must(
        world_init(&room->world, &room->mesh, &room->segments, &room->atlas, &room->materials, NULL, room->pool, &err),
        &err);
}

/* The same, and the camera of its frame 014, which sees most of either room. */
static inline void load_view(struct room *room, const char *name, struct camera *camera) {
    char path[128];
    load(room, name);
    snprintf(path, sizeof path, "rooms/%s/transforms.json", name);
    room_camera(path, "images/014.exr", camera);
}

/* Measures the rooms of the test data, or the one that the command line names. */
static inline void bench_rooms(int argc, char **argv, void (*bench)(const char *name)) {
    if (argc > 1) {
        bench(argv[1]);
        return;
    }
    bench("staircase2");
    bench("bathroom");
}

#endif
