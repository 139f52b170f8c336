/* light_estimate.h: more walls than can be tried at once saturate, each larger than the lamp. Of all that people say is
 * a lamp, and which is far brighter than what it shows, the radiance is found all the same, and no wall shines. */
#include "server/light/light_lamp.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define CLIP 0.046875f /* exact as a half */
#define FIRST_PART 100
#define SETTINGS "{" SHELL_COARSE_TEXTURE "," SHELL_LITTLE ",\"emitters.2\":\"on\"}" /* the lamp */
#define DIM 0.2f

/* Of the walls: parts of one that saturates in other channels do not look alike. */
static const rgb paint[OBJECTS - 2] = {
    {0.5f, 0.5f, DIM}, {0.5f, DIM, 0.5f}, {DIM, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}};

/* A wall of two sides u and v in six parts, each of another size: parts that look alike are tried as one lamp. */
static void add_parts(struct mesh *m, int64_t object, vec3 corner, vec3 u, vec3 v) {
    const float along_u[4] = {0.0f, 0.28f + 0.011f * (float)object, 0.62f - 0.013f * (float)object, 1.0f};
    const float along_v[3] = {0.0f, 0.44f + 0.006f * (float)object, 1.0f};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 2; k++) {
            vec3 at = vec3_mad(vec3_mad(corner, along_u[i], u), along_v[k], v);
            add_quad(m, object, at, vec3_scale(u, along_u[i + 1] - along_u[i]),
                     vec3_scale(v, along_v[k + 1] - along_v[k]));
        }
    }
}

static void make_parted_room(struct mesh *m) {
    const vec3 x = {4, 0, 0}, y = {0, 3, 0}, z = {0, 0, 3};
    start_room(m, 32);
    m->vertex_count = 8, m->triangle_count = 4; /* floor and ceiling */
    add_parts(m, 2, (vec3){0, 0, 0}, y, z);
    add_parts(m, 3, (vec3){4, 0, 0}, z, y);
    add_parts(m, 4, (vec3){0, 0, 0}, x, y);
    add_parts(m, 5, (vec3){0, 0, 3}, y, x);
    add_lamp(m);
}

/* From now on each part is an object. */
static void part_walls(struct mesh *m) {
    for (size_t t = 0; t < m->triangle_count; t++) {
        bool is_wall = m->object_id[t] > 1 && m->object_id[t] != LAMP;
        m->object_id[t] = is_wall ? FIRST_PART + (int64_t)t / 2 : m->object_id[t];
    }
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    struct reconstruction r;
    size_t saturated = 0;
    make_parted_room(&scene.mesh);
    for (int i = 0; i < OBJECTS; i++)
        wall_color[i] = i < 2 ? rgb_gray(0.05f) : paint[i - 2];
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    for (size_t f = 0; f < scene.photograph_count; f++)
        saturate_photograph(&scene.photograph[f], CLIP);
    part_walls(&scene.mesh);
    shell_solve_with(SETTINGS, &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        bool is_lamp = r.segments.id[s] == LAMP;
        saturated += r.evidence[s].is_seen && evidence_saturates(&r.evidence[s]);
        CHECK_THAT(r.is_emitter[s] == is_lamp, "object %d", (int)r.segments.id[s]);
        if (is_lamp)
            CHECK_THAT(r.materials.emission[s].r > 0.5f * lamp_radiance.r, "%g", (double)r.materials.emission[s].r);
    }
    CHECK_THAT(saturated > LIGHT_MAX + 1, "%zu saturate: the test is too easy", saturated);
    reconstruct_release(&r);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
