/* pose_walk.h: the energy of a walk in closed form, whichever way the cameras look; a drift that all share costs
 * nothing; what is expected between two photographs and beyond the last; and the variances of a simulated walk found
 * again. */
#include "server/capture/poses/pose_walk.h"

#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define FRAMES 300
#define FOCAL 200.0f
#define DEPTH 2.0

struct chain {
    struct views views;
    struct tracks tracks;
    struct pose_solver solver;
};

/* A rotation by `angle` about an axis between y and z. */
static struct camera camera_turned(float angle) {
    float c = cosf(angle), s = sinf(angle);
    struct camera camera = {.width = 320, .height = 240, .fx = FOCAL, .fy = FOCAL, .cx = 160.0f, .cy = 120.0f};
    camera.camera_from_world = (struct rigid){{{c, 0.8f * s, -0.6f * s},
                                               {-0.8f * s, 0.36f + 0.64f * c, 0.48f - 0.48f * c},
                                               {0.6f * s, 0.48f - 0.48f * c, 0.64f + 0.36f * c}},
                                              {0.3f, -angle, 1.0f}};
    camera.world_from_camera = rigid_inverse(&camera.camera_from_world);
    return camera;
}

/* Cameras that look everywhere, at every second place of the order but for one gap. */
static void chain_init(struct chain *chain, size_t frames) {
    *chain = (struct chain){.solver = {.frames = frames}};
    chain->views.train_count = frames;
    chain->views.train = mem_array(frames, sizeof *chain->views.train);
    chain->tracks.views = &chain->views;
    chain->solver.tracks = &chain->tracks;
    chain->solver.frame = mem_calloc(frames, sizeof *chain->solver.frame);
    for (size_t f = 0; f < frames; f++) {
        struct camera camera = camera_turned(2.0f * (float)f);
        chain->views.train[f] = (uint32_t)(f < 2 ? f : 2 * f);
        pose_frame_init(&chain->solver.frame[f], &camera);
        chain->solver.frame[f].depth_m = DEPTH;
    }
    chain->solver.walk = (struct pose_walk){.is_known = true, .turn_variance = 1e-6, .move_variance = 4e-6};
}

static void chain_release(struct chain *chain) {
    mem_free(chain->views.train);
    mem_free(chain->solver.frame);
}

static void set_drift(struct pose_frame *frame, double turn, double move) {
    struct pose_drift drift = {{turn, -turn, 0.5 * turn}, {move, 0.0, -move}};
    pose_walk_twist(frame, &drift, frame->total);
}

static double energy(const struct pose_solver *s) {
    double x[4 * POSE_UNKNOWNS], out[4 * POSE_UNKNOWNS] = {0.0}, pull[4 * POSE_UNKNOWNS] = {0.0}, sum = 0.0;
    for (size_t f = 0; f < 4; f++)
        memcpy(x + POSE_UNKNOWNS * f, s->frame[f].total, sizeof s->frame[f].total);
    pose_walk_multiply(s, x, out);
    pose_walk_pull(s, pull);
    for (size_t i = 0; i < 4 * POSE_UNKNOWNS; i++) {
        sum += x[i] * out[i];
        CHECK_NEAR(out[i] + pull[i], 0.0, 1e-9 + 1e-9 * fabs(out[i]));
    }
    return sum;
}

static void test_energy(void) {
    struct chain chain;
    chain_init(&chain, 4);
    struct pose_frame *frame = chain.solver.frame;
    for (size_t f = 0; f < 4; f++)
        set_drift(&frame[f], 0.004, 0.01);
    CHECK_NEAR(energy(&chain.solver), 0.0, 1e-4);
    struct pose_drift same = pose_walk_drift(&frame[2]);
    CHECK_NEAR(same.turn[1], -0.004, 1e-8);
    CHECK_NEAR(same.move[2], -0.01, 1e-8);
    /* The last one step of two places away: 2.25 turn^2 / (2 v), 2 move^2 / (2 v). */
    set_drift(&frame[3], 0.006, 0.011);
    CHECK_NEAR(energy(&chain.solver), 2.25 * 4e-6 / 2e-6 + 2.0 * 1e-6 / 8e-6, 1e-3);
    double diagonal[2];
    pose_walk_diagonal(&chain.solver, 1, diagonal); /* 1 place to the left, 3 to the right */
    CHECK_NEAR(diagonal[0], (1.0 + 1.0 / 3.0) / (FOCAL * FOCAL * 1e-6), 1e-5);
    CHECK_NEAR(diagonal[1], (1.0 + 1.0 / 3.0) * DEPTH * DEPTH / (FOCAL * FOCAL * 4e-6), 1e-5);
    chain_release(&chain);
}

static void test_expected(void) {
    struct chain chain;
    chain_init(&chain, 4); /* at 0, 1, 4, 6 */
    for (size_t f = 0; f < 4; f++)
        set_drift(&chain.solver.frame[f], 0.001 * (double)(f * f), 0.0);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 1).turn[0], 0.001, 1e-8);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 2).turn[0], 0.002, 1e-8);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 3).turn[0], 0.003, 1e-8);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 5).turn[1], -0.0065, 1e-8);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 9).turn[0], 0.009, 1e-8);
    CHECK_NEAR(pose_walk_expect(&chain.solver, 0).turn[0], 0.0, 1e-8);
    chain_release(&chain);
}

/* Frames whose own equations are sure, or leave a known variance: as much is added to that of the differences. */
static void test_learnt(double precision, double turn, double move) {
    struct chain chain;
    uint64_t draw = 0;
    struct pose_drift drift = {{0.0}, {0.0}};
    chain_init(&chain, FRAMES);
    double(*block)[POSE_UNKNOWNS][POSE_UNKNOWNS] = mem_calloc(FRAMES, sizeof *block);
    for (size_t f = 0; f < FRAMES; f++) {
        double steps = f > 0 ? (double)(chain.views.train[f] - chain.views.train[f - 1]) : 0.0;
        for (int k = 0; k < 3; k++) {
            drift.turn[k] += turn * sqrt(steps) * normal(1, draw);
            drift.move[k] += move * sqrt(steps) * normal(2, draw++);
        }
        pose_walk_twist(&chain.solver.frame[f], &drift, chain.solver.frame[f].total);
        for (int k = 0; k < POSE_UNKNOWNS; k++)
            block[f][k][k] = sqrt(precision);
    }
    pose_walk_update_variances(&chain.solver, block);
    double px = 2.0 / precision / 2.0; /* both ends, over two places, pixels^2 */
    double turn_goal = turn * turn + px / (FOCAL * FOCAL),
           move_goal = move * move + px * DEPTH * DEPTH / (FOCAL * FOCAL);
    printf("learnt: turn %.3g of %.3g, move %.3g of %.3g\n", chain.solver.walk.turn_variance, turn_goal,
           chain.solver.walk.move_variance, move_goal);
    CHECK_NEAR(chain.solver.walk.turn_variance / turn_goal, 1.0, 0.1);
    CHECK_NEAR(chain.solver.walk.move_variance / move_goal, 1.0, 0.1);
    mem_free(block);
    chain_release(&chain);
}

int main(void) {
    test_energy();
    test_expected();
    test_learnt(1e6, 0.002, 0.01);
    test_learnt(4.0, 0.002, 0.01);
    return check_result();
}
