/* calibrate_poses.h: cameras are moved by some pixels and found again, held-out ones, too; a capture whose poses are
 * right is left alone. In the long form (UNBAKE_LONG) also with few of them moved, and held-out ones by several numbers
 * of threads. */
#include "server/capture/poses/calibrate_poses.h"

#include "server/scene/rgb_half.h"
#include "tests/render/painted_room.h"

#define FEW 18 /* frames are enough where they are misplaced by little; two of them are held out */

/* From now on there are only the first `count` frames. */
static void take_frames(struct painted *room, size_t count) {
    painted_reset(room);
    room->scene.photograph_count = count;
    views_release(&room->views);
    views_init(&room->views, &room->scene, &room->segments, room->accel, room->pool);
}

static struct poses_found run(struct painted *room, struct parallel *pool) {
    struct tracks tracks;
    struct poses_found found;
    views_release(&room->views);
    views_init(&room->views, &room->scene, &room->segments, room->accel, pool);
    tracks_make(&tracks, &room->views, pool);
    calibrate_poses(&room->scene, &tracks, pool, &found);
    tracks_release(&tracks);
    return found;
}

static void test_clean(struct painted *room) {
    painted_reset(room);
    struct poses_found found = run(room, room->pool);
    CHECK(found.moved_count == 0 && found.shift_px == 0.0);
    for (size_t f = 0; f < room->scene.photograph_count; f++)
        CHECK(memcmp(&room->scene.photograph[f].camera, &room->clean[f].camera, sizeof(struct camera)) == 0);
    poses_found_release(&found);
}

static void misplace(struct painted *room, float turn, float move, size_t every) {
    painted_reset(room);
    for (size_t f = 0; f < room->scene.photograph_count; f += every)
        painted_misplace(&room->scene.photograph[f].camera, f, turn, move);
}

/* Every so many-th frame is misplaced. Two frames look at what hardly any other does: they may stay. */
static void test_misplaced(struct painted *room, float turn, float move, size_t every) {
    misplace(room, turn, move, every);
    double shift_before = painted_shift(room), before = painted_error(room);
    struct poses_found found = run(room, room->pool);
    double shift_after = painted_shift(room), after = painted_error(room);
    size_t close = 0;
    for (uint32_t t = 0; t < room->views.train_count; t++)
        close += painted_frame_shift(room, room->views.train[t]) < 0.4;
    printf("every %zu misplaced: %zu moved, off by %.3f px -> %.3f px, %zu of %zu within 0.4 px, fused error "
           "%.4f -> %.4f\n",
           every, found.moved_count, shift_before, shift_after, close, room->views.train_count, before, after);
    CHECK(shift_before > 1.5);
    CHECK(close + 2 >= room->views.train_count);
    CHECK(after < 0.5 * before);
    CHECK(every > 1 || found.held_out_moved_count == 2);
    poses_found_release(&found);
}

/* Turns a camera about axes of the world, through its centre, and moves it along them. */
static void displace(struct camera *camera, const double turn[3], const double move[3]) {
    struct rigid *m = &camera->world_from_camera;
    vec3 w = {(float)turn[0], (float)turn[1], (float)turn[2]}, column[3];
    for (int k = 0; k < 3; k++) {
        vec3 axis = {m->rotation[0][k], m->rotation[1][k], m->rotation[2][k]};
        column[k] = vec3_add(axis, vec3_cross(w, axis));
    }
    column[0] = vec3_normalize(column[0]);
    column[1] = vec3_normalize(vec3_mad(column[1], -vec3_dot(column[0], column[1]), column[0]));
    column[2] = vec3_cross(column[0], column[1]);
    for (int k = 0; k < 3; k++) {
        m->rotation[0][k] = column[k].x;
        m->rotation[1][k] = column[k].y;
        m->rotation[2][k] = column[k].z;
    }
    m->translation = vec3_add(m->translation, (vec3){(float)move[0], (float)move[1], (float)move[2]});
    camera->camera_from_world = rigid_inverse(m);
}

/* Tracker's drift: a random walk of all frames, from a first turn that they share. */
static void drift(struct painted *room) {
    double turn[3] = {0.0}, move[3] = {0.0};
    for (uint32_t f = 0; f < room->scene.photograph_count; f++) {
        for (uint64_t k = 0; k < 3; k++) {
            turn[k] += 0.006 * (double)painted_random(f, 300 + k);
            move[k] += 0.004 * (double)painted_random(f, 400 + k);
        }
        const double shared[3] = {turn[0] + 0.012, turn[1] - 0.012, turn[2]};
        displace(&room->scene.photograph[f].camera, shared, move);
    }
}

/* Tracker's drift, in photographs every third of which shows little: a window of a ninth, the rest masked. Those follow
 * their neighbours, and so does one that is held out. */
static void test_drift(struct painted *room) {
    double before = 0.0, after = 0.0;
    uint8_t *mask = mem_array(PAINTED_WIDTH * PAINTED_HEIGHT, 1);
    for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT; i++)
        mask[i] = i % PAINTED_WIDTH / (PAINTED_WIDTH / 3) == 1 && i / PAINTED_WIDTH / (PAINTED_HEIGHT / 3) == 1;
    painted_reset(room);
    drift(room);
    for (uint32_t f = 0; f < room->scene.photograph_count; f++) {
        room->scene.photograph[f].mask = f % 3 == 1 ? mask : NULL;
        before += f % 3 == 1 ? painted_frame_shift(room, f) / 8.0 : 0.0;
    }
    struct poses_found found = run(room, room->pool);
    for (uint32_t f = 0; f < room->scene.photograph_count; f++) {
        after += f % 3 == 1 ? painted_frame_shift(room, f) / 8.0 : 0.0;
        room->scene.photograph[f].mask = NULL;
    }
    printf("drift: %zu moved, those that show little off by %.3f px -> %.3f px\n", found.moved_count, before, after);
    CHECK(before > 1.5);
    CHECK(after < 0.3 * before);
    poses_found_release(&found);
    mem_free(mask);
}

/* The same drift under noise of .6 of each channel: few frames are surely moved by themselves, all together are. */
static void test_noisy_drift(struct painted *room) {
    painted_reset(room);
    painted_noise = 1.05f;
    for (int f = 0; f < PAINTED_FRAMES; f++)
        painted_take(room, f);
    painted_noise = PAINTED_NOISE;
    drift(room);
    double before = painted_shift(room);
    struct poses_found found = run(room, room->pool);
    double after = painted_shift(room);
    printf("drift of noisy photographs: %zu moved, off by %.3f px -> %.3f px\n", found.moved_count, before, after);
    CHECK(found.is_drift);
    CHECK(after < 0.3 * before);
    poses_found_release(&found);
}

/* After all frames were misplaced and found: what a held-out photograph shows moved its own camera, and moves no other,
 * whatever the number of threads. */
static void test_held_out(struct painted *room) {
    struct camera first[PAINTED_FRAMES];
    double worst = 0.0;
    for (uint32_t f = 0; f < room->scene.photograph_count; f++) {
        first[f] = room->scene.photograph[f].camera;
        if (room->scene.photograph[f].is_test)
            worst = fmax(worst, painted_frame_shift(room, f));
    }
    misplace(room, 0.02f, 0.02f, 1);
    for (uint32_t f = 0; f < room->scene.photograph_count; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT && photo->is_test; i++)
            rgb_to_half(photo->pixel[i], rgb_gray(1.5f + painted_random(f, i)));
    }
    struct parallel *pool = parallel_new(parallel_thread_count(room->pool) + 1);
    struct poses_found found = run(room, pool);
    parallel_free(pool);
    for (uint32_t f = 0; f < room->scene.photograph_count; f++)
        if (!room->scene.photograph[f].is_test)
            CHECK(memcmp(&first[f], &room->scene.photograph[f].camera, sizeof first[f]) == 0);
    printf("held out: off by %.3f px at most; of noise %zu moved\n", worst, found.held_out_moved_count);
    CHECK(worst < 0.4 && found.held_out_moved_count == 0);
    poses_found_release(&found);
}

static void test_threads(struct painted *room) {
    struct camera first[PAINTED_FRAMES];
    for (int k = 0; k < 2; k++) {
        misplace(room, 0.02f, 0.02f, 1);
        struct parallel *pool = parallel_new(1 + 2 * k);
        struct poses_found found = run(room, pool);
        poses_found_release(&found);
        for (size_t f = 0; f < room->scene.photograph_count; f++) {
            if (k == 0)
                first[f] = room->scene.photograph[f].camera;
            else
                CHECK(memcmp(&first[f], &room->scene.photograph[f].camera, sizeof first[f]) == 0);
        }
        parallel_free(pool);
    }
}

int main(void) {
    struct painted room;
    painted_make(&room, 0, false);
    take_frames(&room, FEW);
    test_clean(&room);
    test_misplaced(&room, 0.02f, 0.02f, 1);
    test_held_out(&room);
    take_frames(&room, PAINTED_FRAMES);
    test_misplaced(&room, 0.06f, 0.06f, 2);
    test_drift(&room);
    test_noisy_drift(&room);
    if (getenv("UNBAKE_LONG")) {
        test_misplaced(&room, 0.03f, 0.03f, 4);
        test_threads(&room);
    }
    painted_release(&room);
    return check_result();
}
