/* Variance of the base-colour gradient at equal time: our sampler against independent numbers. The
 * same code runs both: independent numbers are those of streams of which only the first sample is
 * used. The loss is a fixed random weight per pixel; the variance is summed over all texels. Prints
 * lines "name value goal better". */
#include "tests/bench/engine.h"

#define ROUNDS 6

/* Sums over rounds by texel, of the green derivative. */
struct moments {
    double *sum, *square;
};

/* New samples of every pixel, with the jitter over the pixel from the same streams. */
static void set_paths(struct work *w, const struct camera *camera, uint32_t round, bool independent) {
    for (size_t i = 0; i < w->path_count; i++) {
        uint32_t pixel = (uint32_t)(i / SPP), sample = (uint32_t)(i % SPP);
        w->key[i] = independent ? (struct path_key){(uint32_t)i, round, 0}
                                : (struct path_key){pixel, round, sample};
        vec2 jitter = sampler_pair(sampler_key(w->settings.seed, w->key[i].index, round), w->key[i].sample, 0);
        CHECK(camera_direction(camera, (float)(pixel % camera->width) + jitter.x,
                               (float)(pixel / camera->width) + jitter.y, &w->ray[i].direction));
    }
}

static void backward_chunk(void *user, size_t index, int thread) {
    struct work *w = user;
    size_t first = index * BATCH, count = w->path_count - first < BATCH ? w->path_count - first : BATCH;
    path_batch_trace(w->batch[thread], &w->room->world, &w->settings, count, w->ray + first,
                     w->key + first, w->radiance + first);
    for (size_t i = first; i < first + count; i++)
        w->radiance[i] = rgb_gray(rng_to_float(rng_mix32((uint32_t)(i / SPP))) / SPP);
    gradient_log_clear(w->log[index]);
    path_batch_backward(w->batch[thread], &w->room->world, w->radiance + first, w->log[index]);
}

static double round_sec(struct work *w, struct moments *m) {
    double start = now_sec();
    parallel_for(w->pool, w->chunk_count, backward_chunk, w);
    gradient_reduce(w->gradient, w->log, w->chunk_count, w->pool);
    double took = now_sec() - start;
    const struct gradient *g = w->gradient;
    for (size_t i = 0; i < g->texel_count; i++) {
        double value = (double)g->d_base_color[i].g;
        m->sum[g->texel[i]] += value;
        m->square[g->texel[i]] += value * value;
    }
    return took;
}

static double variance(const struct moments *m, size_t count) {
    double total = 0.0;
    for (size_t i = 0; i < count; i++) {
        double mean = m->sum[i] / ROUNDS;
        total += (m->square[i] / ROUNDS - mean * mean) * ROUNDS / (ROUNDS - 1);
    }
    return total;
}

static void bench_room(const char *name) {
    struct room room;
    struct camera camera;
    char path[128];
    load(&room, name);
    snprintf(path, sizeof path, "rooms/%s/transforms.json", name);
    room_camera(path, "images/014.exr", &camera);
    struct work work;
    work_init(&work, &room, &camera, 0);
    size_t texels = (size_t)room.atlas.width * room.atlas.height;
    struct moments moments[2];
    double took[2][ROUNDS];
    for (int k = 0; k < 2; k++) {
        moments[k].sum = mem_calloc(texels, sizeof(double));
        moments[k].square = mem_calloc(texels, sizeof(double));
    }
    for (int round = 0; round < ROUNDS; round++) {
        for (int independent = 0; independent < 2; independent++) {
            set_paths(&work, &camera, (uint32_t)round, independent);
            took[independent][round] = round_sec(&work, &moments[independent]);
        }
    }
    double ours = variance(&moments[0], texels) * median(took[0], ROUNDS);
    double theirs = variance(&moments[1], texels) * median(took[1], ROUNDS);
    printf("gradient variance at equal time over independent sampling (%s)\t%.4f\t0.5\tlower\n", name,
           ours / theirs);
    for (int k = 0; k < 2; k++) {
        mem_free(moments[k].sum);
        mem_free(moments[k].square);
    }
    work_release(&work);
}

int main(void) {
    bench_room("staircase2");
    bench_room("bathroom");
    return 0;
}
