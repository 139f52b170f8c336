/* Variance of the base-colour gradient at equal time: the engine as it is by default against independent
 * sampling without its further means, by the same code. Paths are those of an optimiser: SPP from one
 * view's camera through each of many texels. Plain sampling: independent numbers (streams of which only
 * the first sample is used), lights picked by power, roulette by throughput alone. The loss is a
 * fixed random weight per texel; the variance is summed over all texels. Prints lines "name value goal
 * better", and what the sampler does alone. */
#include "tests/bench/engine.h"

#define ROUNDS 3

/* Sums over rounds by texel, of the green derivative. */
struct moments {
    double *sum, *square;
};

enum how { DEFAULT, SAMPLER_ONLY, PLAIN, HOW_COUNT };

/* Texels that the camera sees, `count` of them. */
static uint32_t *find_texels(const struct room *room, const struct inverse_uv *inverse, const struct camera *camera,
                             size_t count) {
    uint32_t *texel = mem_array(count, sizeof *texel);
    size_t found = 0;
    vec3 origin = camera_origin(camera);
    for (uint64_t i = 0; found < count; i++) {
        uint32_t t = inverse->valid[rng_key(5, i, 0) % inverse->valid_count], triangle;
        float b1, b2, x, y, depth_m;
        if (!inverse_uv_lookup(inverse, &room->atlas, (float)(t % room->atlas.width) + 0.5f,
                               (float)(t / room->atlas.width) + 0.5f, &triangle, &b1, &b2))
            continue;
        vec3 point = mesh_point(&room->mesh, triangle, b1, b2), to = vec3_sub(point, origin);
        float distance = vec3_length(to);
        if (camera_project(camera, point, &x, &y, &depth_m) && x >= 0.0f && y >= 0.0f && x < (float)camera->width &&
            y < (float)camera->height &&
            !accel_occluded(room->world.accel, origin, vec3_scale(to, 1.0f / distance), 0.0f, 0.999f * distance))
            texel[found++] = t;
    }
    return texel;
}

/* New samples of every texel, with the places in it from the same streams. */
static void set_paths(struct work *w, const struct inverse_uv *inverse, const uint32_t *texel, uint32_t round,
                      enum how how) {
    const struct room *room = w->room;
    w->settings.derivatives = how == DEFAULT;
    w->settings.min_color = how == DEFAULT ? PATH_MIN_COLOR : 0.0f;
    for (size_t i = 0; i < w->path_count; i++) {
        uint32_t look = (uint32_t)(i / SPP), sample = (uint32_t)(i % SPP), t = texel[look], triangle;
        w->key[i] = how == PLAIN ? (struct path_key){(uint32_t)i, round, 0} : (struct path_key){look, round, sample};
        vec2 place = sampler_pair(sampler_key(w->settings.seed, w->key[i].index, round), w->key[i].sample, 0);
        float b1, b2;
        if (inverse_uv_lookup(inverse, &room->atlas, (float)(t % room->atlas.width) + place.x,
                              (float)(t / room->atlas.width) + place.y, &triangle, &b1, &b2))
            w->ray[i].direction = vec3_normalize(vec3_sub(mesh_point(&room->mesh, triangle, b1, b2), w->ray[i].origin));
    }
}

static void backward_chunk(void *user, size_t index, int thread) {
    struct work *w = user;
    size_t first = index * BATCH, count = w->path_count - first < BATCH ? w->path_count - first : BATCH;
    path_batch_trace(w->batch[thread], &w->room->world, &w->settings, count, w->ray + first, w->key + first,
                     w->radiance + first);
    for (size_t i = first; i < first + count; i++)
        w->radiance[i] = rgb_gray(rng_to_float(rng_mix32((uint32_t)(i / SPP))) / SPP);
    gradient_log_clear(w->log[index]);
    path_batch_backward(w->batch[thread], w->radiance + first, w->log[index]);
}

static double round_sec(struct work *w, struct moments *m) {
    double start = cpu_sec();
    parallel_for(w->pool, w->chunk_count, backward_chunk, w);
    gradient_reduce(w->gradient, w->log, w->chunk_count, w->pool);
    double took = cpu_sec() - start;
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
    load_view(&room, name, &camera);
    struct work work;
    work_init(&work, &room, &camera, 0);
    struct inverse_uv inverse;
    inverse_uv_make(&inverse, &room.atlas, room.mesh.triangle_count, room.pool);
    uint32_t *texel = find_texels(&room, &inverse, &camera, (work.path_count + SPP - 1) / SPP);
    size_t texels = (size_t)room.atlas.width * room.atlas.height;
    struct moments moments[HOW_COUNT];
    double took[HOW_COUNT][ROUNDS], cost[HOW_COUNT];
    for (int k = 0; k < HOW_COUNT; k++) {
        moments[k].sum = mem_calloc(texels, sizeof(double));
        moments[k].square = mem_calloc(texels, sizeof(double));
    }
    struct guide *guide = room.world.guide;
    for (int round = 0; round < ROUNDS; round++) {
        for (int k = 0; k < HOW_COUNT; k++) {
            room.world.guide = k == DEFAULT ? guide : NULL;
            set_paths(&work, &inverse, texel, (uint32_t)round, (enum how)k);
            took[k][round] = round_sec(&work, &moments[k]);
        }
    }
    room.world.guide = guide;
    for (int k = 0; k < HOW_COUNT; k++)
        cost[k] = variance(&moments[k], texels) * median(took[k], ROUNDS);
    fprintf(stderr, "%s: the sampler alone %.3f\n", name, cost[SAMPLER_ONLY] / cost[PLAIN]);
    printf("gradient variance at equal time over independent sampling (%s)\t%.4f\t0.5\tlower\n", name,
           cost[DEFAULT] / cost[PLAIN]);
    for (int k = 0; k < HOW_COUNT; k++) {
        mem_free(moments[k].sum);
        mem_free(moments[k].square);
    }
    mem_free(texel);
    inverse_uv_release(&inverse);
    work_release(&work);
}

int main(int argc, char **argv) {
    bench_rooms(argc, argv, bench_room);
    return 0;
}
