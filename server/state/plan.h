/* plan.h -- how much work a reconstruction does, how long what is left will take, and what a time limit leaves out.
 *
 * The work is cut into parts, each with an amount in a unit of its own. Seconds per unit come from a prior, measured
 * once on a known machine, and are corrected by what has been measured in this run: of the part itself, and of how
 * much faster or slower than its prior everything has been so far. Time is what the job really had, as its
 * surroundings tell it (reconstruct_hooks.worked_sec); nothing here reads a clock.
 *
 * Without a limit the amounts are those that were asked for, whatever the time: the plan then only tells the time left.
 * With one, plan_fit takes work away in this order until the rest fits:
 *   1. observations of refine, down to a tenth;
 *   2. samples of the held-out re-renders, down to an eighth;
 *   3. detail finer than a photograph's pixel;
 *   4. base colour of three texels of four (they take it from the fourth);
 *   5. directions of gathered light, down to a quarter;
 *   6. what is left of refine;
 *   7. what is left of samples, but one.
 * What fits less than all of that is not kept: plan_is_kept says so. */
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
    double modest; /* the first cut leaves so much */
    double least;  /* no cut leaves less; of what cannot be cut both are `wanted` */
    double now;    /* planned, at least `done` */
    double done;
    double prior_sec;   /* for a unit */
    double spent_sec;   /* on `done`, of what this run has seen */
    double spent_prior; /* seconds that the prior gave for that */
    bool is_over;       /* nothing more is done of it */
};

struct plan {
    double limit_sec;   /* INFINITY: none */
    double used_sec;    /* by all attempts */
    double last_sec;    /* of this attempt's time, when it was last told */
    struct plan_work part[PLAN_PARTS];
};

/* No work yet. limit_sec 0: none. */
void plan_init(struct plan *p, double limit_sec);

/* States a part's work; what is done of it stays. */
void plan_set(struct plan *p, enum plan_part part, double wanted, double modest, double least, double prior_sec);
/* The same for what cannot be cut. */
void plan_set_fixed(struct plan *p, enum plan_part part, double wanted, double prior_sec);

/* So much more of a part is done, and this attempt has had worked_sec by now: the time since the last call went into
 * that. */
void plan_advance(struct plan *p, enum plan_part part, double work, double worked_sec);
/* The same where it was not spent on any part. */
void plan_pass_time(struct plan *p, double worked_sec);
/* So much was done by earlier attempts: none of it is measured here. */
void plan_resume(struct plan *p, enum plan_part part, double done);
/* No more of it will be done. */
void plan_close(struct plan *p, enum plan_part part);

/* Seconds for a unit of the part. */
double plan_rate(const struct plan *p, enum plan_part part);
/* Seconds that what is planned will still take. */
double plan_left_sec(const struct plan *p);
/* What part of the planned work of parts first to last is done, in [0, 1], by what it takes. */
double plan_share_done(const struct plan *p, enum plan_part first, enum plan_part last);

/* Plans anew what is not done, within the limit. */
void plan_fit(struct plan *p);
/* Whether what is planned fits. */
bool plan_is_kept(const struct plan *p);
/* Whether less of the part is planned than was asked for. */
bool plan_is_cut(const struct plan *p, enum plan_part part);

#endif
