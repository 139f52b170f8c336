/* pose_registration.h: cameras that lie beside the mesh by one small motion are moved onto it, held-out ones, too, and
 * the calibration reports it; cameras that are right stay, byte for byte, the estimate being 0 within its errors. */
#include "server/capture/poses/pose_registration.h"

#include "server/reconstruct/calibrate.h"
#include "tests/render/painted_room.h"
#include "tests/render/shell.h"

/* So many of the frames are enough but for walls that mirror; of them two are held out. */
#define FEW 16

static void make_tracks(struct painted *room, struct parallel *pool, struct tracks *tracks) {
    views_release(&room->views);
    views_init(&room->views, &room->scene, &room->segments, room->accel, pool);
    tracks_make(tracks, &room->views, pool);
}

static bool register_mesh(struct painted *room, bool is_rest, struct parallel *pool,
                          struct pose_registration *registration) {
    struct tracks tracks;
    make_tracks(room, pool, &tracks);
    bool moved = pose_registration_find(&room->scene, &tracks, is_rest, pool, registration);
    tracks_release(&tracks);
    return moved;
}

/* By .9 px. */
static void lie_beside(struct painted *room, struct pose_registration *beside) {
    *beside = (struct pose_registration){.turn = {0.001, -0.004, 0.002}, .move = {0.003, -0.005, 0.004}};
    painted_reset(room);
    for (size_t f = 0; f < PAINTED_FRAMES; f++)
        pose_registration_move(beside, &room->scene.photograph[f].camera);
}

static void check_unmoved(const struct painted *room) {
    for (size_t f = 0; f < room->scene.photograph_count; f++)
        CHECK(memcmp(&room->scene.photograph[f].camera, &room->clean[f].camera, sizeof(struct camera)) == 0);
}

static double worst_shift(const struct painted *room) {
    double worst = 0.0;
    for (uint32_t f = 0; f < room->scene.photograph_count; f++)
        worst = fmax(worst, painted_frame_shift(room, f));
    return worst;
}

static void test_right(struct painted *room) {
    struct pose_registration found;
    painted_reset(room);
    CHECK(!register_mesh(room, false, room->pool, &found) && !found.is_applied);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(found.turn[k], 0.0, 3.5 * found.turn_error[k]);
        CHECK_NEAR(found.move[k], 0.0, 3.5 * found.move_error[k]);
        CHECK(found.turn_error[k] > 0.0 && found.move_error[k] > 0.0);
    }
    check_unmoved(room);
}

/* The rest is found once edges and tracks are those of the new cameras. first[]: those before. */
static void test_beside(struct painted *room, struct camera first[PAINTED_FRAMES]) {
    struct pose_registration beside, found, rest;
    struct photograph told[PAINTED_FRAMES], right[PAINTED_FRAMES];
    struct tracks tracks;
    lie_beside(room, &beside);
    double before = painted_shift(room);
    CHECK(register_mesh(room, false, room->pool, &found));
    double after = painted_shift(room);
    for (size_t f = 0; f < PAINTED_FRAMES; f++)
        first[f] = room->scene.photograph[f].camera;
    CHECK(register_mesh(room, true, room->pool, &rest));
    pose_registration_add(&found, &rest);
    for (size_t f = 0; f < PAINTED_FRAMES; f++) {
        told[f] = right[f] = room->scene.photograph[f];
        told[f].camera = room->clean[f].camera;
        pose_registration_move(&beside, &told[f].camera);
    }
    make_tracks(room, room->pool, &tracks);
    CHECK(pose_registration_agrees(&found, &tracks, told, room->pool));
    CHECK_NEAR(found.shift_px, before, 0.2 * before);
    CHECK(!pose_registration_agrees(&found, &tracks, right, room->pool)); /* no move at all */
    tracks_release(&tracks);
    printf("beside the mesh: sure by %.0f deviations; off by %.3f px -> %.3f px -> %.3f px, at most %.3f px\n",
           found.deviations, before, after, painted_shift(room), worst_shift(room));
    for (int k = 0; k < 3; k++)
        CHECK_NEAR(found.turn[k], -beside.turn[k], 4.0 * found.turn_error[k]);
    CHECK(before > 0.4 && after < 0.15 * before && worst_shift(room) < 0.1);
}

/* Chi-square, of six errors, of what was found against a motion; exceeded once in a thousand times. */
#define CHI_SQUARE_6 22.5
static double chi_square(const struct pose_registration *found, const struct pose_registration *beside) {
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        double turn = (found->turn[k] + beside->turn[k]) / found->turn_error[k];
        double move = (found->move[k] + beside->move[k]) / found->move_error[k];
        square += turn * turn + move * move;
    }
    return square;
}

/* Walls that mirror a part of what is opposite: reflections move with the camera, which no motion of the mesh explains.
 * They are taken for none, and what is found is 0 within the stated errors. */
static void test_mirrors(void) {
    struct painted room;
    struct pose_registration found, beside = {0};
    painted_mirror = 0.2f;
    painted_make(&room, 0, true);
    CHECK(!register_mesh(&room, false, room.pool, &found));
    double square = chi_square(&found, &beside);
    printf("walls that mirror: chi-square of six errors %.1f, %.1f deviations, response %.2f, %.3f px\n", square,
           found.deviations, found.response, found.shift_px);
    CHECK(square < CHI_SQUARE_6 && found.response < 0.9);
    check_unmoved(&room);
    lie_beside(&room, &beside);
    CHECK(register_mesh(&room, false, room.pool, &found));
    painted_release(&room);
    painted_mirror = 0.0f;
}

/* Moved by one thread as they were by several. */
static void test_threads(struct painted *room, const struct camera first[PAINTED_FRAMES]) {
    struct pose_registration beside, found;
    lie_beside(room, &beside);
    struct parallel *pool = parallel_new(1);
    CHECK(register_mesh(room, false, pool, &found));
    parallel_free(pool);
    for (size_t f = 0; f < FEW; f++)
        CHECK(memcmp(&first[f], &room->scene.photograph[f].camera, sizeof first[f]) == 0);
}

static void log_line(void *user, const char *line) {
    bool *is_told = user;
    *is_told = *is_told || strstr(line, "degrees against the mesh");
}

/* As part of the calibration, which moves most photographs by themselves before, and two not at all: with the motion
 * none has to be. */
static void test_reported(struct painted *room, bool is_beside) {
    struct pose_registration beside;
    struct settings settings = shell_settings("{\"calibrate\":true}");
    bool is_told = false;
    const struct reconstruct_hooks hooks = {.user = &is_told, .log = log_line};
    struct reconstruction r = {.scene = &room->scene,
                               .settings = &settings,
                               .pool = room->pool,
                               .atlas = room->atlas,
                               .inverse = room->inverse,
                               .report = cJSON_CreateObject()};
    painted_reset(room);
    if (is_beside)
        lie_beside(room, &beside);
    views_release(&room->views);
    views_init(&room->views, &room->scene, &room->segments, room->accel, room->pool);
    calibrate(&r, &room->views, &hooks);
    const cJSON *registration = cJSON_GetObjectItem(cJSON_GetObjectItem(r.report, "calibration"), "registration");
    CHECK(cJSON_IsTrue(cJSON_GetObjectItem(registration, "applied")) == is_beside && is_told == is_beside);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(cJSON_GetObjectItem(r.report, "calibration"), "poses_moved")) ==
          0.0);
    CHECK(cJSON_GetArraySize(cJSON_GetObjectItem(registration, "turn_degrees")) == 3);
    printf("calibrated: off by %.3f px at most\n", worst_shift(room));
    if (is_beside)
        CHECK(worst_shift(room) < 0.1);
    else
        check_unmoved(room);
    cJSON_Delete(r.report);
    settings_release(&settings);
}

int main(void) {
    struct painted room;
    struct camera first[PAINTED_FRAMES];
    painted_make(&room, 3, false);
    room.scene.photograph_count = FEW;
    test_right(&room);
    test_beside(&room, first);
    test_threads(&room, first);
    test_reported(&room, false);
    test_reported(&room, true);
    room.scene.photograph_count = PAINTED_FRAMES;
    painted_release(&room);
    test_mirrors();
    return check_result();
}
