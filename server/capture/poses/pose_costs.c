/* pose_costs.c -- see pose_costs.h. */
#include "server/capture/poses/pose_costs.h"

#include "common/mem.h"

/* Of log residuals: 5 %. One for all photographs, so that their agreement compares. */
#define COMMON_SCALE 0.05 /* +25 %: no change */
#define OFFSET_ROUNDS 2   /* of weights and offsets */

struct track_costs {
    const struct pose_solver *solver;
    double *cost; /* [held-out tracks] mean over its observations; NAN: none */
};

static void cost_of_track(void *user, size_t index, int thread) {
    (void)thread;
    const struct track_costs *costs = user;
    const struct pose_solver *s = costs->solver;
    size_t track = index * POSE_HELD_OUT_EVERY;
    const struct pose_observation *observation = s->observation + track * POSE_OBSERVATIONS_MAX;
    double consensus, weight[POSE_OBSERVATIONS_MAX], count = 0.0, sum = 0.0;
    pose_weigh_track(s, track, &consensus, weight);
    for (size_t k = 0; k < pose_observation_count(s->track[track]) && isfinite(consensus); k++) {
        if (!isfinite(observation[k].value))
            continue;
        sum += pose_robust_cost((double)observation[k].value - s->x[observation[k].offset] - consensus, COMMON_SCALE);
        count += 1.0;
    }
    costs->cost[index] = count > 0.0 ? sum / count : (double)NAN;
}

void pose_costs(struct pose_solver *s, double *cost) {
    bool *is_fixed = mem_array(s->frames + 1, sizeof *is_fixed);
    for (size_t f = 0; f < s->frames; f++) {
        is_fixed[f] = s->frame[f].is_fixed;
        s->frame[f].is_fixed = true;
    }
    s->level = 0;
    for (int round = 0; round < OFFSET_ROUNDS; round++) {
        pose_linearise(s);
        pose_reweight(s);
        pose_solve(s); /* offsets only: all frames are fixed */
    }
    for (size_t f = 0; f < s->frames; f++)
        s->frame[f].is_fixed = is_fixed[f];
    parallel_for(s->pool, pose_costs_count(s), cost_of_track, &(struct track_costs){s, cost});
    mem_free(is_fixed);
}

struct validation pose_costs_compare(const double *before, const double *now, size_t count) {
    struct validation v = {0};
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(before[i]) || !isfinite(now[i]))
            continue;
        validation_add(&v, before[i], now[i]);
    }
    return v;
}
