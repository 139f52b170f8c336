/* hidden_lamps.h: a lamp that no photograph shows is found by what it lights, and is as bright as it is, also where
 * most of its light leaves a gap by way of surfaces that none shows; where the lamp was photographed, be it thinner
 * than a pixel, nothing else is taken for one. The same for any number of threads. */
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
        shell_solve_with(SHELL_COARSE, &scene, threads[i], &r);
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
    shell_solve_with(SHELL_COARSE, &scene, 0, &r);
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

#define PANEL 1 /* of one object with the ceiling */
#define GAP 0.06f

static rgb four_times(vec3 place) { return (void)place, rgb_gray(4.0f); }

static void add_panel(struct mesh *m, vec3 a, vec3 b) {
    vec3 d = vec3_sub(b, a), x = {d.x, 0, 0}, y = {0, d.y, 0}, z = {0, 0, d.z};
    add_quad(m, PANEL, a, y, x);
    add_quad(m, PANEL, vec3_add(a, z), x, y);
    add_quad(m, PANEL, a, z, y);
    add_quad(m, PANEL, vec3_add(a, x), y, z);
    add_quad(m, PANEL, a, x, z);
    add_quad(m, PANEL, vec3_add(a, y), z, x);
}

/* Strips behind a panel that stands before a wall, which they face: without what wall and panel reflect of it in the
 * gap they come out four times too bright. */
static void test_gap(struct parallel *pool) {
    struct scene scene = {0};
    struct mesh *m = &scene.mesh;
    start_room(m, OBJECTS + 8);
    for (size_t i = 0; i < m->triangle_count; i++)
        m->object_id[i] = m->object_id[i] == 3 ? 2 : m->object_id[i];
    add_quad(m, 4, (vec3){0, 0, 0}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    add_quad(m, 5, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){4, 0, 0});
    add_panel(m, (vec3){1, 1, GAP}, (vec3){3, 2.2f, 1.5f * GAP});
    add_quad(m, LAMP, (vec3){1.04f, 1.05f, GAP - 0.005f}, (vec3){0, 1.1f, 0}, (vec3){0.05f, 0, 0});
    add_quad(m, LAMP, (vec3){2.91f, 1.05f, GAP - 0.005f}, (vec3){0, 1.1f, 0}, (vec3){0.05f, 0, 0});
    add_quad(m, 3, (vec3){1.8f, 2.9f, 1.3f}, (vec3){0.4f, 0, 0}, (vec3){0, 0, 0.4f});
    other_lamp = 3, lamp_picture = four_times;
    wall_color[4] = wall_color[PANEL] = rgb_gray(0.83f), wall_color[2] = rgb_gray(0.55f);
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    struct settings settings = shell_settings(SHELL_SMALL);
    struct shell shell = {.polls_until_stop = 1}; /* light is estimated before */
    struct reconstruction r;
    CHECK(shell_run(&scene, &settings, 0, &shell, &r) == STATUS_CANCELLED);
    for (size_t s = 0; s < r.segments.count; s++) {
        bool is_lamp = r.segments.id[s] == LAMP;
        float factor = rgb_mean(r.evidence[s].radiance) / (4.0f * rgb_mean(lamp_radiance));
        CHECK_THAT(r.evidence[s].is_hidden == is_lamp, "segment %zu", s);
        if (is_lamp) {
            printf("in a gap: %.2f of the true radiance\n", (double)factor);
            CHECK_THAT(factor > 0.6f && factor < 1.6f, "%g of the true radiance", (double)factor);
        }
    }
    reconstruct_release(&r);
    settings_release(&settings);
    shell_release(&shell);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_hidden(pool);
    if (!IS_BRIEF) {
        test_none_hidden(pool);
        test_thin(pool);
        test_gap(pool);
    }
    parallel_free(pool);
    return check_result();
}
