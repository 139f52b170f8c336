/* hidden_lamps.h: a lamp that no photograph shows is found by what it lights, and is as bright as it is; where the lamp
 * was photographed, be it thinner than a pixel, nothing else is taken for one. The same for any number of threads. */
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

/* Steeply enough that neither the lamp nor the ceiling is seen. */
static vec3 look_down(int frame) {
    vec3 from = spread(frame, 0.4f);
    float angle = 2.4f * (float)frame;
    return (vec3){from.x + cosf(angle), from.y - 1.0f, from.z + sinf(angle)};
}

static void test_hidden(struct parallel *pool) {
    struct scene scene = {0};
    make_mesh(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_down, pool);
    const int threads[] = {1, 3};
    rgb found[2];
    for (int i = IS_BRIEF; i < 2; i++) {
        struct reconstruction r;
        shell_solve(&scene, threads[i], &r);
        for (size_t s = 0; s < r.segments.count; s++) {
            bool is_lamp = r.segments.id[s] == LAMP;
            CHECK_THAT(r.evidence[s].is_hidden == is_lamp && r.is_emitter[s] == is_lamp, "segment %zu", s);
            if (is_lamp)
                found[i] = r.materials.emission[s];
        }
        CHECK_RGB(found[i], lamp_radiance, 0.2f);
        /* What the white ceiling sends down nobody can know. */
        rgb color = shell_mean_color(&r, FLOOR);
        CHECK_NEAR(color.r, wall_color[FLOOR].r, 0.2f * wall_color[FLOOR].r);
        CHECK_NEAR(color.b, wall_color[FLOOR].b, 0.2f * wall_color[FLOOR].b);
        reconstruct_release(&r);
    }
    CHECK(IS_BRIEF || memcmp(&found[0], &found[1], sizeof found[0]) == 0);
    scene_release(&scene);
}

static vec3 look_up(int frame) { return (vec3){2.0f + 0.1f * (float)(frame % 5), 2.9f, 1.5f}; }

/* Nothing of the floor is seen, but the lamp is. */
static void test_none_hidden(struct parallel *pool) {
    struct scene scene = {0};
    make_mesh(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_up, pool);
    struct reconstruction r;
    shell_solve(&scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(!r.evidence[s].is_hidden && r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
    reconstruct_release(&r);
    scene_release(&scene);
}

/* A strip of a twentieth of a metre, less than a pixel of most photographs: all that shows it shows the ceiling,
 * too. */
static void test_thin(struct parallel *pool) {
    struct scene scene = {0};
    make_mesh(&scene.mesh);
    for (size_t i = 0; i < 4; i++) {
        vec3 *corner = &scene.mesh.position[4 * LAMP + i];
        *corner = (vec3){corner->x > 2.0f ? 3.5f : 0.5f, corner->y, corner->z > 1.5f ? 1.525f : 1.475f};
    }
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 6.0f), NULL, look_anywhere, pool);
    struct reconstruction r;
    shell_solve(&scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        bool is_lamp = r.segments.id[s] == LAMP;
        CHECK_THAT(r.is_emitter[s] == is_lamp && !r.evidence[s].is_hidden, "segment %zu", s);
        CHECK(!is_lamp || r.evidence[s].only_mixed);
    }
    reconstruct_release(&r);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    photograph_samples = 32;
    test_hidden(pool);
    if (!IS_BRIEF) {
        test_none_hidden(pool);
        test_thin(pool);
    }
    parallel_free(pool);
    return check_result();
}
