/* sky_doubt.h: a white sill under a sky that is brighter above than any photograph shows is no lamp, however white it
 * would have to be by what they show. */
#include "server/light/decision/sky_doubt.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define SKY_WIDTH 64
#define SKY_HEIGHT 32
#define BRIGHT_ROWS 9 /* from 50 degrees on */
#define SILL 5

static void make_sky(struct image *sky) {
    image_init_rgb(sky, SKY_WIDTH, SKY_HEIGHT);
    for (size_t i = 0; i < 3 * SKY_WIDTH * SKY_HEIGHT; i++)
        sky->pixel[i] = i < 3 * SKY_WIDTH * BRIGHT_ROWS ? 2.5f : 1.0f;
}

/* The room with a window, all other walls of one object, and a sill outside. */
static void make_mesh_with_sill(struct mesh *m) {
    vec3 x = {4, 0, 0};
    start_room(m, OBJECTS + 4);
    add_quad(m, 4, (vec3){0, 0, 3}, (vec3){0, 3, 0}, x);
    add_quad(m, 4, (vec3){0, 0, 0}, x, (vec3){0, 1.0f, 0});
    add_quad(m, 4, (vec3){0, 2.0f, 0}, x, (vec3){0, 1.0f, 0});
    add_quad(m, 4, (vec3){0, 1.0f, 0}, (vec3){0.5f, 0, 0}, (vec3){0, 1.0f, 0});
    add_quad(m, 4, (vec3){3.5f, 1.0f, 0}, (vec3){0.5f, 0, 0}, (vec3){0, 1.0f, 0});
    add_quad(m, SILL, (vec3){0.5f, 1.0f, -0.8f}, (vec3){0, 0, 0.8f}, (vec3){3, 0, 0});
    add_lamp(m);
}

/* Down at the window, or about the room. */
static vec3 look_at_sill(int frame) {
    vec3 anywhere = look_anywhere(frame);
    return frame % 2 ? anywhere : (vec3){0.5f + 0.7f * anywhere.x, 0.5f, -0.5f};
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    struct image sky;
    struct reconstruction r;
    wall_color[SILL] = rgb_gray(0.9f);
    make_mesh_with_sill(&scene.mesh);
    make_sky(&sky);
    photograph_mesh(&scene, lamp_radiance, &sky, look_at_sill, pool);
    shell_solve_with(SHELL_FINE, &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        const struct emitter_evidence *e = &r.evidence[s];
        CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "object %d shows %g of which %g is beyond white",
                   (int)r.segments.id[s], (double)rgb_mean(e->radiance), (double)e->emitted_share);
        if (r.segments.id[s] != SILL)
            continue;
        CHECK_THAT(e->emitted_share > 0.3f, "%g: the test is too easy", (double)e->emitted_share);
        CHECK_THAT(e->sky_lambert > 0.3f * rgb_mean(e->lambert), "%g", (double)e->sky_lambert);
    }
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
