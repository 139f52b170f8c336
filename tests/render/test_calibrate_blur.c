/* calibrate_blur.h: smeared photographs are found and trusted less; sharp ones are left alone. */
#include "server/capture/calibrate_blur.h"

#include "tests/render/painted_room.h"

static struct blur_found run(struct painted *room, struct parallel *pool) {
    struct tracks tracks;
    struct blur_found found;
    tracks_make(&tracks, &room->views, pool);
    calibrate_blur(&room->scene, &tracks, &found);
    tracks_release(&tracks);
    return found;
}

static void test_clean(struct painted *room) {
    painted_reset(room);
    struct blur_found found = run(room, room->pool);
    CHECK_THAT(found.blurred_count == 0, "%zu", found.blurred_count);
    for (int f = 0; f < PAINTED_FRAMES; f++)
        CHECK(room->scene.photograph[f].blur_px == 0.0f);
}

/* A third of the photographs is smeared over 17 pixels, which is a standard deviation of 4.9. Not
 * all see edges that it could smear, with four others that see them too. */
static void test_smeared(struct painted *room) {
    painted_reset(room);
    for (int f = 0; f < PAINTED_FRAMES; f += 3)
        painted_smear(&room->scene.photograph[f], 8);
    double before = painted_error(room);
    struct blur_found found = run(room, room->pool);
    double after = painted_error(room);
    size_t right = 0, wrong = 0, smeared = 0;
    for (size_t t = 0; t < room->views.train_count; t++) {
        uint32_t f = room->views.train[t];
        bool is_blurred = room->scene.photograph[f].blur_px > 0.0f;
        smeared += f % 3 == 0;
        right += is_blurred && f % 3 == 0;
        wrong += is_blurred && f % 3 != 0;
    }
    printf("%zu of %zu smeared photographs found, %zu others, blur %.2f px, fused error %.4f -> %.4f\n", right, smeared,
           wrong, found.blur_px, before, after);
    CHECK(right >= 3);
    CHECK(wrong == 0);
    CHECK(found.blur_px > 2.0 && found.blur_px < 10.0);
    CHECK(after < 0.92 * before);
}

static void test_threads(struct painted *room) {
    float first[PAINTED_FRAMES];
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        first[f] = room->scene.photograph[f].blur_px;
        room->scene.photograph[f].blur_px = 0.0f;
    }
    struct parallel *pool = parallel_new(3);
    run(room, pool);
    for (int f = 0; f < PAINTED_FRAMES; f++)
        CHECK(room->scene.photograph[f].blur_px == first[f]);
    parallel_free(pool);
}

int main(void) {
    struct painted room;
    painted_make(&room, 1, true);
    test_clean(&room);
    test_smeared(&room);
    test_threads(&room);
    painted_release(&room);
    return check_result();
}
