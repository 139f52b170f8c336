/* seen.h: surface on an edge of the only training picture is not seen, nor is what the picture does
 * not show, nor what is hidden; emitters and empty space are neither plain nor seen. */
#include <string.h>

#include "server/evaluate/score.h"
#include "server/evaluate/seen.h"
#include "tests/check.h"

/* Each pixel is 1 x 1 m of the plane z = 8: two walls that meet at x = 3.5 (columns 0 to 2 and 4 to 7
 * show one of them, column 3 both), and beyond the right wall, from x = 12 on, a lamp. */
#define SIZE 8
#define DISTANCE 8.0f

static struct camera camera_at(float x) {
    struct camera c = {.width = SIZE, .height = SIZE, .fx = DISTANCE, .fy = DISTANCE, .cx = SIZE / 2, .cy = SIZE / 2};
    for (int i = 0; i < 3; i++)
        c.world_from_camera.rotation[i][i] = 1.0f;
    c.world_from_camera.translation = (vec3){x + SIZE / 2, SIZE / 2, 0.0f};
    c.camera_from_world = rigid_inverse(&c.world_from_camera);
    return c;
}

int main(void) {
    vec3 position[] = {{-20, -20, 8}, {3.5f, -20, 8}, {3.5f, 20, 8}, {-20, 20, 8},
                       {12, -20, 8},  {12, 20, 8},    {15, -20, 8},  {15, 20, 8}};
    uint32_t index[][3] = {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}, {4, 6, 7}, {4, 7, 5}};
    int64_t object[] = {0, 0, 1, 1, 2, 2};
    bool emits[] = {false, false, false, false, true, true};
    struct photograph photograph[2] = {{.camera = camera_at(0.0f)}, {.camera = camera_at(7.0f), .is_test = true}};
    struct scene scene = {.photograph_count = 2, .photograph = photograph};
    scene.mesh = (struct mesh){
        .vertex_count = 8, .position = position, .triangle_count = 6, .index = index, .object_id = object};
    struct parallel *pool = parallel_new(2);
    struct accel *accel;
    struct error err;
    CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
    struct seen seen;
    seen_init(&seen, &scene, accel, emits, pool);
    CHECK(seen.train_count == 1 && seen.train[0] == 0);
    uint8_t flags[SIZE * SIZE];

    /* As the training picture itself: a look-up in columns 2 to 4 can read column 3. */
    seen_flags(&seen, &photograph[0].camera, pool, flags);
    for (int x = 0; x < SIZE; x++)
        CHECK_THAT(flags[4 * SIZE + x] == (x >= 2 && x <= 4 ? SCORE_PLAIN : SCORE_PLAIN | SCORE_SEEN), "column %d: %d",
                   x, flags[4 * SIZE + x]);

    /* Seven metres to the right: one column that the picture shows, then four that it does not, then
     * the lamp from x = 12 on. */
    seen_flags(&seen, &photograph[1].camera, pool, flags);
    CHECK(flags[4 * SIZE] == (SCORE_PLAIN | SCORE_SEEN));
    for (int x = 1; x < 5; x++)
        CHECK(flags[4 * SIZE + x] == SCORE_PLAIN);
    for (int x = 5; x < SIZE; x++)
        CHECK(flags[4 * SIZE + x] == 0);
    seen_release(&seen);
    accel_free(accel);

    /* The lamp a metre before the training picture's camera, beside the other one's: what both look
     * at, columns 5 to 7 of the other, is hidden. Without the lamp it is seen. */
    photograph[0].camera = camera_at(-1.0f);
    photograph[1].camera = camera_at(-6.0f);
    memset(index[2], 0, 2 * sizeof index[2]); /* the right wall is gone */
    for (int away = 0; away < 2; away++) {
        float y = away ? 100.0f : 0.0f;
        position[4] = (vec3){0, y - 5, 1}, position[6] = (vec3){10, y - 5, 1};
        position[7] = (vec3){10, y + 12, 1}, position[5] = (vec3){0, y + 12, 1};
        CHECK(accel_new(&accel, &scene.mesh, pool, &err) == STATUS_OK);
        seen_init(&seen, &scene, accel, emits, pool);
        seen_flags(&seen, &photograph[1].camera, pool, flags);
        for (int x = 0; x < SIZE; x++)
            CHECK_THAT(flags[4 * SIZE + x] == (away && x >= 5 ? SCORE_PLAIN | SCORE_SEEN : SCORE_PLAIN),
                       "lamp %s, column %d: %d", away ? "away" : "before", x, flags[4 * SIZE + x]);
        seen_release(&seen);
        accel_free(accel);
    }
    parallel_free(pool);
    return check_result();
}
