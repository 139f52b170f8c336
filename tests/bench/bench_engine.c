/* Speed ratios that need only the engine, each measured within one run by one thread's processor time:
 * the medians of interleaved repetitions. Prints lines "name value goal better", which run.sh
 * collects. */
#include "tests/bench/engine.h"

#define REPEATS 5

/* All rays of the paths, depth by depth, in the order of the paths. */
struct record {
    size_t count[2], capacity[2]; /* nearest hit, shadow */
    struct accel_ray *ray[2];
};

static void record_rays(void *user, bool shadow, size_t count, const struct accel_ray *ray) {
    struct record *r = user;
    if (r->count[shadow] + count > r->capacity[shadow]) {
        r->capacity[shadow] = 2 * (r->count[shadow] + count);
        r->ray[shadow] = mem_realloc_array(r->ray[shadow], r->capacity[shadow], sizeof **r->ray);
    }
    memcpy(r->ray[shadow] + r->count[shadow], ray, count * sizeof *ray);
    r->count[shadow] += count;
}

/* Seconds for the recorded rays by single queries and nothing else. */
static double run_bare(const struct room *room, const struct record *r) {
    double start = cpu_sec();
    uint64_t found = 0;
    for (size_t i = 0; i < r->count[0]; i++) {
        const struct accel_ray *a = &r->ray[0][i];
        struct accel_hit hit;
        found += accel_intersect(room->world.accel, a->origin, a->direction, a->near_m, a->far_m, &hit);
    }
    for (size_t i = 0; i < r->count[1]; i++) {
        const struct accel_ray *a = &r->ray[1][i];
        found += accel_occluded(room->world.accel, a->origin, a->direction, a->near_m, a->far_m);
    }
    double took = cpu_sec() - start;
    return found > 0 ? took : 0.0;
}

static double run_engine(struct work *one, bool backward) {
    double start = cpu_sec();
    run(one, backward);
    return cpu_sec() - start;
}

static void bench_room(const char *name) {
    struct room room;
    struct camera camera;
    load_view(&room, name, &camera);
    struct work one;
    work_init(&one, &room, &camera, 1);

    struct record record = {{0, 0}, {0, 0}, {NULL, NULL}};
    path_batch_set_tap(one.forward[0], record_rays, &record);
    run(&one, false);
    path_batch_set_tap(one.forward[0], NULL, NULL);
    size_t rays = record.count[0] + record.count[1];

    double bare[REPEATS], primal[REPEATS], gradient[REPEATS];
    for (int i = 0; i < REPEATS; i++) {
        bare[i] = run_bare(&room, &record);
        primal[i] = run_engine(&one, false);
        gradient[i] = run_engine(&one, true);
    }
    double b = median(bare, REPEATS), p = median(primal, REPEATS), g = median(gradient, REPEATS);
    double paths = (double)one.path_count;
    fprintf(stderr,
            "%s: %zu paths, %.2f rays each; one core: bare %.2f Mrays/s, primal %.3f, gradient %.3f "
            "Mpaths/s\n",
            name, one.path_count, (double)rays / paths, (double)rays / b * 1e-6, paths / p * 1e-6, paths / g * 1e-6);
    printf("ray rate over bare Embree (%s)\t%.4f\t0.75\thigher\n", name, b / p);
    printf("gradient over primal cost (%s)\t%.4f\t1.3\tlower\n", name, g / p);
    mem_free(record.ray[0]);
    mem_free(record.ray[1]);
    work_release(&one);
}

int main(int argc, char **argv) {
    bench_rooms(argc, argv, bench_room);
    return 0;
}
