/* plan.h in closed form: rates, the time left, what a limit cuts in which order, what it gives back. The clock is the
 * test's. */
#include "server/state/plan.h"

#include <math.h>

#include "tests/check.h"

/* Each part takes 10 s by its prior: 100 units of .1 s, of which a limit leaves a tenth, an eighth or a quarter. */
static void ten_each(struct plan *p, double limit_sec) {
    plan_init(p, limit_sec);
    for (int i = 0; i < PLAN_PARTS; i++)
        plan_set_fixed(p, (enum plan_part)i, 100.0, 0.1);
    plan_set(p, PLAN_REFINE, 100.0, 10.0, 0.0, 0.1);
    plan_set(p, PLAN_REPORT, 100.0, 12.5, 1.0, 0.1);
    plan_set(p, PLAN_DETAIL, 100.0, 100.0, 0.0, 0.1);
    plan_set(p, PLAN_MEASURE, 100.0, 100.0, 25.0, 0.1);
    plan_set(p, PLAN_GATHER, 100.0, 100.0, 25.0, 0.1);
}

#define ALL_SEC (10.0 * PLAN_PARTS)
/* Of the time left .03 are kept free: the limit that leaves so much. */
#define LIMIT(sec) ((sec) / 0.97)

static void test_without_limit(void) {
    struct plan p;
    ten_each(&p, 0.0);
    plan_fit(&p);
    CHECK_NEAR(plan_left_sec(&p), ALL_SEC, 1e-9);
    plan_advance(&p, PLAN_PREPARE, 100.0, 1e6); /* however long it takes */
    plan_fit(&p);
    for (int i = 0; i < PLAN_PARTS; i++)
        CHECK(p.part[i].now == 100.0 && !plan_is_cut(&p, (enum plan_part)i));
    CHECK(plan_is_kept(&p) && p.used_sec == 1e6);
}

/* A machine of half the speed is known as one by its first part; of a part itself its own rate is believed. */
static void test_rates(void) {
    struct plan p;
    ten_each(&p, 0.0);
    plan_advance(&p, PLAN_PREPARE, 100.0, 20.0);
    double slowness = (20.0 + 5.0) / (10.0 + 5.0);
    CHECK_NEAR(plan_rate(&p, PLAN_FUSE), 0.1 * slowness, 1e-9);
    CHECK_NEAR(plan_left_sec(&p), (ALL_SEC - 10.0) * slowness, 1e-6);
    plan_advance(&p, PLAN_FUSE, 47.0, 20.0 + 47.0 * 0.4);
    slowness = (20.0 + 18.8 + 5.0) / (10.0 + 4.7 + 5.0);
    CHECK_NEAR(plan_rate(&p, PLAN_FUSE), (3.0 * 0.1 * slowness + 18.8) / 50.0, 1e-9);
    /* What earlier attempts did says nothing of this machine, but need not be done. */
    double left = plan_left_sec(&p);
    plan_resume(&p, PLAN_EXPORT, 100.0);
    CHECK_NEAR(left - plan_left_sec(&p), 100.0 * plan_rate(&p, PLAN_EXPORT), 1e-9);
}

static void check_cut(double limit_sec, double refine, double report, double detail, double measure, double gather,
                      bool kept) {
    struct plan p;
    ten_each(&p, LIMIT(limit_sec));
    plan_fit(&p);
    const double wanted[] = {refine, report, detail, measure, gather};
    const enum plan_part part[] = {PLAN_REFINE, PLAN_REPORT, PLAN_DETAIL, PLAN_MEASURE, PLAN_GATHER};
    for (int i = 0; i < 5; i++) {
        CHECK_THAT(fabs(p.part[part[i]].now - wanted[i]) < 1e-6, "limit %g, part %d: %g, not %g", limit_sec,
                   (int)part[i], p.part[part[i]].now, wanted[i]);
        CHECK(plan_is_cut(&p, part[i]) == (wanted[i] < 100.0));
    }
    CHECK(!plan_is_cut(&p, PLAN_PREPARE) && plan_is_kept(&p) == kept);
    if (kept)
        CHECK_THAT(plan_left_sec(&p) <= limit_sec + 1e-6, "%g s of %g", plan_left_sec(&p), limit_sec);
}

static void test_cuts(void) {
    check_cut(ALL_SEC, 100, 100, 100, 100, 100, true);
    check_cut(ALL_SEC - 5.0, 50, 100, 100, 100, 100, true);
    check_cut(ALL_SEC - 9.0 - 4.0, 10, 60, 100, 100, 100, true);
    /* Detail goes as a whole, and gives what it has freed too much to the samples that were cut before. */
    check_cut(ALL_SEC - 9.0 - 8.75 - 4.0, 10, 72.5, 0, 100, 100, true);
    check_cut(ALL_SEC - 9.0 - 8.75 - 10.0 - 7.5, 10, 12.5, 0, 25, 100, true);
    check_cut(ALL_SEC - 9.0 - 8.75 - 10.0 - 7.5 - 5.0, 10, 12.5, 0, 25, 50, true);
    check_cut(ALL_SEC - 9.0 - 8.75 - 10.0 - 7.5 - 7.5 - 0.5, 5, 12.5, 0, 25, 25, true);
    check_cut(ALL_SEC - 10.0 - 9.9 - 10.0 - 7.5 - 7.5, 0, 1, 0, 25, 25, true);
    check_cut(1.0, 0, 1, 0, 25, 25, false);
}

/* What is done is not cut, and what is over neither grows nor shrinks. */
static void test_underway(void) {
    struct plan p;
    ten_each(&p, LIMIT(30.0));
    plan_advance(&p, PLAN_REFINE, 60.0, 6.0);
    plan_close(&p, PLAN_DETAIL);
    plan_fit(&p);
    CHECK(p.part[PLAN_REFINE].now == 60.0 && p.part[PLAN_DETAIL].now == 0.0 && plan_is_cut(&p, PLAN_DETAIL));
    CHECK_NEAR(plan_share_done(&p, PLAN_REFINE, PLAN_REFINE), 1.0, 1e-12);
    CHECK_NEAR(plan_share_done(&p, PLAN_FIT, PLAN_FIT), 0.0, 1e-12);
}

/* Without an end refine gets what the rest leaves, and is never called cut. */
static void test_endless(void) {
    struct plan p;
    ten_each(&p, LIMIT(ALL_SEC + 40.0));
    plan_set(&p, PLAN_REFINE, (double)INFINITY, 10.0, 0.0, 0.1);
    plan_fit(&p);
    CHECK_NEAR(p.part[PLAN_REFINE].now, 500.0, 1e-6);
    CHECK(!plan_is_cut(&p, PLAN_REFINE));
    p.limit_sec = LIMIT(ALL_SEC - 10.0 - 3.0);
    plan_fit(&p);
    CHECK_NEAR(p.part[PLAN_REFINE].now, 10.0, 1e-6);
    CHECK_NEAR(p.part[PLAN_REPORT].now, 60.0, 1e-6);
}

int main(void) {
    test_without_limit();
    test_rates();
    test_cuts();
    test_underway();
    test_endless();
    return check_result();
}
