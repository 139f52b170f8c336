/* test_outlines.c -- the part of an error that lies beside outlines, in closed form. */
#include "server/reconstruct/outlines.h"

#include "common/mem.h"
#include "server/demo/room.h"
#include "tests/check.h"

#define WIDTH 20
#define HEIGHT 10

/* Left half at 2 m, right half at 3 m: beside the outline are the columns 7 to 12, OUTLINE_REACH around 9 and 10. */
static void test_share(void) {
    float depth[WIDTH * HEIGHT];
    struct image photograph, halves;
    image_init_rgb(&photograph, WIDTH, HEIGHT);
    image_init(&halves, WIDTH, HEIGHT, 6, (const char *const[]){"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"});
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH;
        depth[i] = x < WIDTH / 2 ? 2.0f + 0.02f * (float)x : 3.0f;
        for (int c = 0; c < 3; c++)
            photograph.pixel[3 * i + c] = 1.0f;
        for (int c = 0; c < 6; c++)
            halves.pixel[6 * i + c] = x == 9 || x == 15 ? 1.1f : 1.0f;
    }
    struct outline_error e = outlines_measure(depth, &photograph, &halves, 1.0);
    CHECK_NEAR(e.pixel_share, 6.0 / WIDTH, 1e-9);
    CHECK_NEAR(e.msre_part, 0.01 / 1.01 / WIDTH, 1e-6); /* column 9 of the two */
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        if (i % WIDTH == 9)
            photograph.pixel[3 * i + 1] = NAN; /* does not count, nor does its part of the pixels */
    e = outlines_measure(depth, &photograph, &halves, 1.0);
    CHECK_NEAR(e.pixel_share, 5.0 / (WIDTH - 1), 1e-9);
    CHECK_NEAR(e.msre_part, 0.0, 1e-9);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        depth[i] = INFINITY;
    e = outlines_measure(depth, &photograph, &halves, 1.0);
    CHECK(e.pixel_share == 0.0 && e.msre_part == 0.0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        photograph.pixel[3 * i] = NAN;
    CHECK(isnan(outlines_measure(depth, &photograph, &halves, 1.0).msre_part));
    image_release(&photograph);
    image_release(&halves);
}

/* Straight at a wall of the room, 5 x 2.8 x 4 m: everywhere the same depth, out of it nothing. */
static void test_depth(void) {
    struct parallel *pool = parallel_new(1);
    struct room room;
    struct error err;
    CHECK(room_init(&room, &(struct room_look){64, 15.0f, 15.0f, false}, pool, &err) == STATUS_OK);
    struct camera camera = {.width = 8, .height = 6, .fx = 40.0f, .fy = 40.0f, .cx = 4.0f, .cy = 3.0f};
    vec3 lower, upper;
    mesh_bounds(&room.mesh, &lower, &upper);
    vec3 up = {0.0f, upper.y + 1.0f, 0.0f}; /* above the ceiling, looking up */
    camera.world_from_camera = (struct rigid){{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, up};
    camera.camera_from_world = rigid_inverse(&camera.world_from_camera);
    float *depth = outlines_depth(room.world.accel, &camera, pool);
    float direction = rigid_direction(&camera.world_from_camera, (vec3){0.0f, 0.0f, 1.0f}).y;
    for (int i = 0; i < 48; i++)
        CHECK(direction > 0.0f ? isinf(depth[i]) : fabsf(depth[i] - 1.0f) < 1e-3f);
    mem_free(depth);
    room_release(&room);
    parallel_free(pool);
}

int main(void) {
    test_share();
    test_depth();
    return check_result();
}
