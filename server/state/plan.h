/* plan.h -- amounts of work, forecast of the time left, and reduction of the work to a time limit.
 *
 * The work has parts, each with an amount in its own unit. Seconds per unit start from a prior, measured once on a
 * known machine, and are corrected by measurements of this run: of the part itself, and of the machine's speed relative
 * to all priors so far. Time is the job's working time (reconstruct_hooks.worked_sec); nothing here reads a clock.
 *
 * Without a limit the amounts are those asked for, and the plan only forecasts. With one, plan_fit reduces work in this
 * order until the rest fits:
 *   1. observations of refine, down to a tenth;
 *   2. samples of the held-out re-renders, down to an eighth;
 *   3. detail finer than a photograph's pixel;
 *   4. base colour of three texels of four (they take it from the fourth);
 *   5. directions of gathered light, down to a quarter;
 *   6. what is left of refine;
 *   7. what is left of samples, but one.
 * If even that does not fit, the limit is not kept (plan_is_kept). */
#ifndef UNBAKE_STATE_PLAN_H
#define UNBAKE_STATE_PLAN_H

#include <stdbool.h>

enum plan_part {
    PLAN_PREPARE, /* 1: all of it, as the next */
    PLAN_FUSE,
    PLAN_GATHER,  /* directions, of all probes and passes */
    PLAN_FIT,     /* 1: what solve fits between these, of all passes */
    PLAN_MEASURE, /* texels whose base colour is measured, of all passes */
    PLAN_DETAIL,  /* texels times steps */
    PLAN_REFINE,  /* observations */
    PLAN_REPORT,  /* paths of held-out re-renders */
    PLAN_EXPORT,  /* 1: all of it */
    PLAN_PARTS
};

struct plan_work {
    double wanted; /* asked for; infinite: as much as the limit allows */
    double modest; /* left by the first cut */
    double least;  /* left by the last cut; both are `wanted` where nothing can be cut */
    double now;    /* planned; at least `done` */
    double done;
    double prior_sec;   /* of a unit */
    double spent_sec;   /* measured in this run */
    double spent_prior; /* prior's forecast for the same work */
    bool is_over;       /* no more work will be done */
};

struct plan {
    double limit_sec; /* INFINITY: none */
    double used_sec;  /* working time of all attempts */
    double last_sec;  /* working time of this attempt at the last update */
    struct plan_work part[PLAN_PARTS];
};

/* No work yet. limit_sec 0: none. */
void plan_init(struct plan *p, double limit_sec);

/* Sets a part's work; `done` stays. */
void plan_set(struct plan *p, enum plan_part part, double wanted, double modest, double least, double prior_sec);
/* The same for a part that cannot be cut. */
void plan_set_fixed(struct plan *p, enum plan_part part, double wanted, double prior_sec);

/* Adds `work` to a part; the time since the last update counts as spent on it. worked_sec: of this attempt. */
void plan_advance(struct plan *p, enum plan_part part, double work, double worked_sec);
/* Adds time that was not spent on any part. */
void plan_pass_time(struct plan *p, double worked_sec);
/* Sets the work done by earlier attempts, whose time is not known here. */
void plan_resume(struct plan *p, enum plan_part part, double done);
/* Ends a part. */
void plan_close(struct plan *p, enum plan_part part);

/* Forecast seconds of a unit of the part. */
double plan_rate(const struct plan *p, enum plan_part part);
/* Forecast seconds of the planned work that is not done. */
double plan_left_sec(const struct plan *p);
/* Part of the planned work of parts first to last that is done, in [0, 1], weighted by time. */
double plan_share_done(const struct plan *p, enum plan_part first, enum plan_part last);

/* Plans what is not done, within the limit. */
void plan_fit(struct plan *p);
/* Whether the plan fits the limit. */
bool plan_is_kept(const struct plan *p);
/* Whether less of the part is planned than asked for. */
bool plan_is_cut(const struct plan *p, enum plan_part part);

#endif
