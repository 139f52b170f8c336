/* Speed on all cores over (speed of one core x cores), primal and gradient. Other work on the
 * machine disturbs two busy cores more than one, and longer runs more than short ones. So one
 * optimiser's iteration at a time (some 0.1 s) is timed, one core and all cores taking turns, the
 * best time of REPEATS is kept for each, and the best times of PARTS different iterations are
 * summed. Prints lines "name value goal better". */
#include "tests/bench/engine.h"

#define PARTS 4
#define PART_CHUNKS 32
#define REPEATS 20

/* Seconds for one iteration's chunks. */
static double part_sec(struct work *w, size_t part, bool backward) {
    w->backward = backward;
    /* Parts are spread over the view. */
    w->first = part * (w->chunk_count - PART_CHUNKS) / (PARTS - 1);
    double start = clock_sec();
    parallel_for(w->pool, PART_CHUNKS, trace_chunk, w);
    if (backward)
        gradient_reduce(w->gradient, w->log + w->first, PART_CHUNKS, w->pool);
    return clock_sec() - start;
}

static double best_sec(struct work *one, struct work *all, bool backward, double best[2]) {
    best[0] = best[1] = 0.0;
    for (size_t part = 0; part < PARTS; part++) {
        double least[2] = {INFINITY, INFINITY};
        for (int i = 0; i < REPEATS; i++) {
            least[0] = fmin(least[0], part_sec(one, part, backward));
            least[1] = fmin(least[1], part_sec(all, part, backward));
        }
        best[0] += least[0];
        best[1] += least[1];
    }
    return best[0] / best[1] / parallel_thread_count(all->pool);
}

static void bench_room(const char *name) {
    struct room room;
    struct camera camera;
    load_view(&room, name, &camera);
    struct work one, all;
    work_init(&one, &room, &camera, 1);
    work_init(&all, &room, &camera, 0);
    for (int backward = 0; backward < 2; backward++) {
        double best[2], share = best_sec(&one, &all, backward, best);
        double paths = (double)PARTS * PART_CHUNKS * BATCH * 1e-6;
        const char *what = backward ? "gradient" : "primal";
        fprintf(stderr, "%s: %s: one core %.3f, all cores %.3f million paths per second\n", name, what, paths / best[0],
                paths / best[1]);
        printf("all %d cores over one core times %d, %s (%s)\t%.4f\t0.95\thigher\n", parallel_thread_count(all.pool),
               parallel_thread_count(all.pool), what, name, share);
    }
    work_release(&one);
    work_release(&all);
}

int main(void) {
    bench_room("staircase2");
    bench_room("bathroom");
    return 0;
}
