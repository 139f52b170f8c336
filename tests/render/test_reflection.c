/* reflection.h: a white glossy board under a window shows more than white paint would, by the window's highlight, and
 * is no lamp; a dim lamp in its place is one. */
#include "server/light/decision/reflection.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define WALLS 4
#define BOARD 5
#define DIM 0.35f /* radiance of the dim lamp over the window's */

/* The room, all its walls but four of one object; in the wall at z = 0 a window that emits, and a board under it. */
static void make_mesh_with_board(struct mesh *m) {
    vec3 x = {4, 0, 0};
    start_room(m, OBJECTS + 4);
    add_quad(m, WALLS, (vec3){0, 0, 3}, (vec3){0, 3, 0}, x);
    add_quad(m, WALLS, (vec3){0, 0, 0}, x, (vec3){0, 1, 0});
    add_quad(m, WALLS, (vec3){0, 2.5f, 0}, x, (vec3){0, 0.5f, 0});
    add_quad(m, WALLS, (vec3){0, 1, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, WALLS, (vec3){3, 1, 0}, (vec3){1, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, LAMP, (vec3){1, 1, 0}, (vec3){2, 0, 0}, (vec3){0, 1.5f, 0});
    add_quad(m, BOARD, (vec3){1, 0.8f, 0.2f}, (vec3){0, 0, 1}, (vec3){2, 0, 0});
}

/* Across the room from the window, not much above the board. */
static vec3 far_from_window(int frame) {
    vec3 anywhere = spread(frame, 0.0f);
    return (vec3){0.8f + 0.6f * anywhere.x, 1.1f + 0.2f * anywhere.y, 2.2f + 0.2f * anywhere.z};
}

/* At the board, or about the room. */
static vec3 look_at_board(int frame) { return frame % 2 ? look_anywhere(frame) : (vec3){2.0f, 1.0f, 0.5f}; }

static rgb bright_window(vec3 place) {
    (void)place;
    return rgb_gray(1.0f / DIM);
}

static void check_board(bool emits, struct parallel *pool) {
    struct scene scene = {0};
    struct reconstruction r;
    make_mesh_with_board(&scene.mesh);
    lamp_picture = emits ? bright_window : NULL;
    other_lamp = emits ? BOARD : LAMP;
    photograph_mesh(&scene, rgb_scale(lamp_radiance, emits ? DIM : 1.0f), NULL, look_at_board, pool);
    shell_solve_with(SHELL_FINE, &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        const struct emitter_evidence *e = &r.evidence[s];
        bool is_lamp = r.segments.id[s] == LAMP || (emits && r.segments.id[s] == BOARD);
        CHECK_THAT(r.is_emitter[s] == is_lamp, "object %d: %g by reflection, %g beyond white", (int)r.segments.id[s],
                   (double)e->reflection, (double)e->emitted_share);
        if (r.segments.id[s] == BOARD)
            CHECK_THAT(e->emitted_share > 0.26f, "%g: the test is too easy", (double)e->emitted_share);
    }
    reconstruct_release(&r);
    scene_release(&scene);
}

/* In a room whose median is .2, light of .01 is not modelled: what shows 1.7 times white's .006 in a dark corner may
 * reflect, what shows as much where white shows .6 may not, nor what shows 10 where white would show .0001. */
static void test_dark(void) {
    const double dark = (double)DARK_DEVIATION * 0.2;
    const struct {
        double radiance, lambert;
        bool emits;
    } place[] = {{0.0103, 0.0061, false}, {1.03, 0.61, true}, {10.0, 1e-4, true}};
    for (size_t i = 0; i < sizeof place / sizeof *place; i++) {
        double deviation = reflection_light_deviation(place[i].lambert, 0.0, FILL_DEVIATION, dark);
        double beyond = log(place[i].radiance / (ALBEDO_WHITE * place[i].lambert)) / deviation;
        CHECK_THAT((beyond > (double)REFLECTION_DEVIATIONS) == place[i].emits, "place %zu: %g deviations", i, beyond);
    }
    CHECK_NEAR(reflection_light_deviation(1.0, 0.5, 0.7, 0.0), hypot(ALBEDO_WHITE_DEVIATION, 0.35), 1e-9);
}

/* A saturated lamp that shows .25 at least, where white paint shows .2: by what it lights it has some radiance, give or
 * take a factor of 18, and may be none; with a factor of 1.3 it is one. So is one that is known as little and shows
 * four times as much as white paint. */
static void test_saturated_lamp(void) {
    const struct {
        float observed, radiance, deviation;
        bool emits;
    } lamp[] = {{0.25f, 0.62f, 2.9f, false}, {0.25f, 0.62f, 0.25f, true}, {0.8f, 1.0f, 2.9f, true}};
    for (size_t i = 0; i < sizeof lamp / sizeof *lamp; i++) {
        struct emitter_evidence e = {.observed = rgb_gray(lamp[i].observed),
                                     .radiance = rgb_gray(lamp[i].radiance),
                                     .lambert = rgb_gray(0.2f),
                                     .is_unbounded = true,
                                     .deviation = lamp[i].deviation};
        e.reflection = (float)reflection_probability(&e, ALBEDO_WHITE, 0.2);
        CHECK_THAT(reflection_is_unlikely(&e) == lamp[i].emits, "lamp %zu: %g", i, (double)e.reflection);
    }
}

int main(void) {
    test_dark();
    test_saturated_lamp();
    struct parallel *pool = parallel_new(0);
    for (int i = 0; i < BOARD; i++)
        wall_color[i] = rgb_scale(wall_color[i], 0.3f);
    wall_color[BOARD] = rgb_gray(0.9f);
    wall_roughness[BOARD] = 0.2f;
    wall_specular[BOARD] = 0.5f;
    camera_place = far_from_window;
    check_board(false, pool);
    check_board(true, pool);
    parallel_free(pool);
    return check_result();
}
