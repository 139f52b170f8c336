/* plan.c -- see plan.h. */
#include "server/state/plan.h"

#include <math.h>
#include <stddef.h>

/* Weight of the prior in a part's rate, as a part of its work: measured and prior count alike when 3 % is done. */
#define PRIOR_SHARE 0.03
/* Weight of the prior in the machine's speed, seconds of measured work. Shorter ones are ruled by caches and
 * other processes. */
#define PRIOR_SPEED_SEC 5.0
/* Part of the time left that is not planned, since rates are estimates: of ten minutes 18 s. */
#define RESERVE 0.03
/* Parts below this are rounding of sums. */
#define NOTHING 1e-9

enum plan_target { MODEST, LEAST };
static const struct {
    enum plan_part part;
    enum plan_target to;
    bool whole; /* cut entirely or not at all */
} cuts[] = {
    {PLAN_REFINE, MODEST, false}, {PLAN_REPORT, MODEST, false}, {PLAN_DETAIL, LEAST, true},
    {PLAN_MEASURE, LEAST, true},  {PLAN_GATHER, LEAST, false},  {PLAN_REFINE, LEAST, false},
    {PLAN_REPORT, LEAST, false},
};
#define CUTS (sizeof cuts / sizeof *cuts)

void plan_init(struct plan *p, double limit_sec) {
    *p = (struct plan){.limit_sec = limit_sec > 0.0 ? limit_sec : (double)INFINITY};
}

void plan_set(struct plan *p, enum plan_part part, double wanted, double modest, double least, double prior_sec) {
    struct plan_work *w = &p->part[part];
    w->wanted = wanted;
    w->modest = modest;
    w->least = least;
    w->prior_sec = prior_sec;
    w->now = fmax(isinf(wanted) ? modest : wanted, w->done);
}

void plan_set_fixed(struct plan *p, enum plan_part part, double wanted, double prior_sec) {
    plan_set(p, part, wanted, wanted, wanted, prior_sec);
}

void plan_pass_time(struct plan *p, double worked_sec) {
    p->used_sec += worked_sec - p->last_sec;
    p->last_sec = worked_sec;
}

void plan_advance(struct plan *p, enum plan_part part, double work, double worked_sec) {
    struct plan_work *w = &p->part[part];
    w->spent_sec += worked_sec - p->last_sec;
    w->spent_prior += work * w->prior_sec;
    w->done += work;
    w->now = fmax(w->now, w->done);
    plan_pass_time(p, worked_sec);
}

void plan_resume(struct plan *p, enum plan_part part, double done) {
    p->part[part].done = done;
    p->part[part].now = fmax(p->part[part].now, done);
}

void plan_close(struct plan *p, enum plan_part part) {
    p->part[part].is_over = true;
    p->part[part].now = p->part[part].done;
}

/* Measured over prior time of everything so far. */
static double slowness(const struct plan *p) {
    double spent = 0.0, prior = 0.0;
    for (int i = 0; i < PLAN_PARTS; i++) {
        spent += p->part[i].spent_sec;
        prior += p->part[i].spent_prior;
    }
    return (spent + PRIOR_SPEED_SEC) / (prior + PRIOR_SPEED_SEC);
}

double plan_rate(const struct plan *p, enum plan_part part) {
    const struct plan_work *w = &p->part[part];
    double prior = w->prior_sec * slowness(p);
    double measured = w->prior_sec > 0.0 ? w->spent_prior / w->prior_sec : 0.0; /* units */
    double weight = PRIOR_SHARE * (isinf(w->wanted) ? w->modest : w->wanted);
    return weight + measured > 0.0 ? (weight * prior + w->spent_sec) / (weight + measured) : prior;
}

static double part_left_sec(const struct plan *p, enum plan_part part) {
    const struct plan_work *w = &p->part[part];
    return w->now > w->done ? (w->now - w->done) * plan_rate(p, part) : 0.0;
}

double plan_left_sec(const struct plan *p) {
    double left = 0.0;
    for (int i = 0; i < PLAN_PARTS; i++)
        left += part_left_sec(p, (enum plan_part)i);
    return left;
}

double plan_share_done(const struct plan *p, enum plan_part first, enum plan_part last) {
    double done = 0.0, all = 0.0;
    for (int i = (int)first; i <= (int)last; i++) {
        const struct plan_work *w = &p->part[i];
        done += w->done * w->prior_sec;
        all += w->now * w->prior_sec;
    }
    return all > 0.0 ? fmin(done / all, 1.0) : 0.0;
}

/* Seconds available for the work that is not done. */
static double available_sec(const struct plan *p) { return fmax(p->limit_sec - p->used_sec, 0.0) * (1.0 - RESERVE); }

/* Plans all work as asked for, and of an endless part what fits beside the rest. */
static void want_all(struct plan *p) {
    int endless = -1;
    for (int i = 0; i < PLAN_PARTS; i++) {
        struct plan_work *w = &p->part[i];
        if (w->is_over)
            continue;
        if (isinf(w->wanted))
            endless = i;
        w->now = fmax(isinf(w->wanted) ? 0.0 : w->wanted, w->done);
    }
    if (endless < 0)
        return;
    struct plan_work *w = &p->part[endless];
    double rate = plan_rate(p, (enum plan_part)endless), spare = available_sec(p) - plan_left_sec(p);
    w->now = fmax(w->modest, w->done + (rate > 0.0 ? fmax(spare, 0.0) / rate : 0.0));
}

static double target_of(const struct plan_work *w, size_t cut) {
    return w->is_over ? w->now : fmax(cuts[cut].to == MODEST ? w->modest : w->least, w->done);
}

void plan_fit(struct plan *p) {
    double before[CUTS]; /* planned of its part before each cut */
    want_all(p);
    if (isinf(p->limit_sec))
        return;
    double over = plan_left_sec(p) - available_sec(p);
    size_t made = 0;
    for (; made < CUTS && over > 0.0; made++) {
        struct plan_work *w = &p->part[cuts[made].part];
        double rate = plan_rate(p, cuts[made].part), target = target_of(w, made);
        before[made] = w->now;
        if (target >= w->now)
            continue;
        double saved = (w->now - target) * rate;
        w->now = saved <= over || cuts[made].whole ? target : w->now - over / rate;
        over -= saved <= over || cuts[made].whole ? saved : over;
    }
    /* An entire cut may have freed more than needed: give it back to the cuts before. */
    while (made-- > 0 && over < 0.0) {
        struct plan_work *w = &p->part[cuts[made].part];
        double rate = plan_rate(p, cuts[made].part);
        if (cuts[made].whole || before[made] <= w->now || !(rate > 0.0))
            continue;
        double more = fmin(before[made] - w->now, -over / rate);
        w->now += more;
        over += more * rate;
    }
}

bool plan_is_kept(const struct plan *p) { return p->used_sec + plan_left_sec(p) <= p->limit_sec; }

bool plan_is_cut(const struct plan *p, enum plan_part part) {
    const struct plan_work *w = &p->part[part];
    return !isinf(w->wanted) && w->now < w->wanted * (1.0 - NOTHING);
}
