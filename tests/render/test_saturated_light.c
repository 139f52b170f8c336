/* light_estimate.h: a lamp at which every photograph saturates is as bright as what it lights tells, and so are sky and
 * ground; where some photograph measured them, what they light is not asked. A bar before a white sky that some
 * photographs show as white is no lamp. Of lamps that are alike none is brighter than the others. The same for any
 * number of threads. In the long form (UNBAKE_LONG) also under a ground as bright as the sky, and a lamp by several
 * numbers of threads. */
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define CEILING 1
#define CLIP 1.5f
#define SKY_RADIANCE 8.0f

/* As a camera with so much room above its exposure has them. */
static void saturate(struct scene *scene, float clip) {
    for (size_t f = 0; f < scene->photograph_count; f++)
        saturate_photograph(&scene->photograph[f], clip);
}

static void check_floor(const struct reconstruction *r, float tolerance) {
    rgb color = shell_mean_color(r, FLOOR);
    CHECK_NEAR(color.r, wall_color[FLOOR].r, tolerance * wall_color[FLOOR].r);
    CHECK_NEAR(color.b, wall_color[FLOOR].b, tolerance * wall_color[FLOOR].b);
}

static void test_lamp(struct scene *scene) {
    saturate(scene, CLIP);
    const int threads[] = {1, 3};
    rgb found[2];
    for (int i = !IS_LONG; i < 2; i++) {
        struct reconstruction r;
        shell_solve_with(SHELL_COARSE, scene, threads[i], &r);
        for (size_t s = 0; s < r.segments.count; s++) {
            bool is_lamp = r.segments.id[s] == LAMP;
            CHECK_THAT(r.evidence[s].is_unbounded == is_lamp && r.is_emitter[s] == is_lamp && !r.evidence[s].is_hidden,
                       "segment %zu", s);
            if (is_lamp)
                found[i] = r.materials.emission[s];
        }
        CHECK_RGB(found[i], lamp_radiance, 0.15f);
        check_floor(&r, 0.1f);
        reconstruct_release(&r);
    }
    CHECK(!IS_LONG || memcmp(&found[0], &found[1], sizeof found[0]) == 0);
}

/* What dark, polished wood shows is white highlight for a good part, and makes the lamp bluer than it is until that is
 * known. */
static void test_polished_wood(struct parallel *pool) {
    struct scene scene = {0};
    struct reconstruction r;
    const int wood[] = {FLOOR, 2, 4};
    rgb paint[OBJECTS];
    memcpy(paint, wall_color, sizeof paint);
    for (size_t i = 0; i < 3; i++) {
        wall_color[wood[i]] = rgb_make(0.12f, 0.06f, 0.03f);
        wall_roughness[wood[i]] = 0.3f;
        wall_specular[wood[i]] = 1.0f;
    }
    make_scene(&scene, pool);
    memcpy(wall_color, paint, sizeof paint);
    for (size_t i = 0; i < 3; i++)
        wall_roughness[wood[i]] = 1.0f, wall_specular[wood[i]] = 0.0f;
    saturate(&scene, CLIP);
    shell_solve(&scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
        rgb found = r.materials.emission[s];
        if (r.is_emitter[s])
            printf("on polished wood: %.2f %.2f %.2f\n", (double)found.r, (double)found.g, (double)found.b);
        if (r.is_emitter[s])
            CHECK_RGB(found, lamp_radiance, 0.15f);
    }
    /* The lamp is mirrored up to it; some of that light is not found, and it comes out 4 to 5 % too light. */
    CHECK_RGB(shell_mean_color(&r, CEILING), wall_color[CEILING], 0.05f);
    reconstruct_release(&r);
    scene_release(&scene);
}

static vec3 look_at_window(int frame) { return (vec3){1.0f + 2.0f * fmodf((float)frame * 0.618f, 1.0f), 2.0f, 0.0f}; }

/* Mean of the map where photographs look out, above the horizon or below. */
static float seen_sky(const struct environment *e, size_t half) {
    float sum = 0.0f, count = 0.0f;
    for (size_t i = 0; i < (size_t)e->map.width * e->map.height; i++) {
        vec3 direction = environment_direction(e, i % e->map.width, i / e->map.width);
        if (e->confidence.pixel[2 * i] == 0.0f || environment_half(direction) != half)
            continue;
        sum += e->map.pixel[3 * i];
        count += 1.0f;
    }
    return sum / count;
}

/* The sky is fitted again in solve, which is not done again. By other threads than `whole`, which had one. */
static void check_resumes(struct scene *scene, const struct reconstruction *whole) {
    struct shell shell = {.polls_until_stop = 1, .spares_solve = true};
    struct settings s = shell_settings(SHELL_SMALL);
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 3, &shell, &r) == STATUS_CANCELLED && shell.has_checkpoint);
    reconstruct_release(&r);
    shell.polls_until_stop = -1;
    CHECK(shell_run(scene, &s, 2, &shell, &r) == STATUS_OK);
    size_t bytes = 3 * sizeof(float) * r.environment.map.width * r.environment.map.height;
    CHECK(memcmp(r.environment.map.pixel, whole->environment.map.pixel, bytes) == 0);
    CHECK(memcmp(r.materials.base_color.texel, whole->materials.base_color.texel,
                 sizeof *r.materials.base_color.texel * r.atlas.width * r.atlas.height) == 0);
    CHECK(r.light.deviation > 0.0f && r.light.deviation == whole->light.deviation);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

/* Sky and ground of these radiances, through a window. */
static void test_sky(struct parallel *pool, float above, float below) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    image_init_rgb(&sky, 64, 32);
    for (size_t i = 0; i < 3 * 64 * 32; i++)
        sky.pixel[i] = i < 3 * 64 * 16 ? above : below;
    photograph_samples = 64; /* noise matters to what is asked here */
    photograph_mesh(&scene, rgb_gray(0.0f), &sky, look_anywhere, pool);
    photograph_samples = 32;
    saturate(&scene, CLIP);
    struct reconstruction r;
    shell_solve(&scene, 1, &r);
    CHECK(!r.sun.is_there); /* what saturates does so by the sky */
    float sky_found = seen_sky(&r.environment, 0), ground_found = seen_sky(&r.environment, 1);
    printf("sky of %g, ground of %g: %.2f, %.2f\n", (double)above, (double)below, (double)sky_found,
           (double)ground_found);
    CHECK_NEAR(sky_found, above, 0.15f * above);
    CHECK_NEAR(ground_found, below, 0.3f * below);
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(!r.is_emitter[s], "segment %zu", s);
    check_floor(&r, 0.15f); /* the sky beside what is seen is a guess as well */
    if (above != below)
        check_resumes(&scene, &r);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

/* Two lamps side by side light the room much alike; one that is twice as bright would explain it as well. */
static void test_pair(struct parallel *pool) {
    struct scene scene = {0};
    const int64_t lamp[2] = {LAMP, 5};
    start_room(&scene.mesh, OBJECTS + 1);
    add_quad(&scene.mesh, 4, (vec3){0, 0, 0}, (vec3){4, 0, 0}, (vec3){0, 3, 0});
    add_quad(&scene.mesh, 4, (vec3){0, 0, 3}, (vec3){0, 3, 0}, (vec3){4, 0, 0});
    for (int i = 0; i < 2; i++)
        add_quad(&scene.mesh, lamp[i], (vec3){1.5f + 0.5f * (float)i, 2.9f, 1.0f}, (vec3){0.45f, 0, 0},
                 (vec3){0, 0, 1});
    other_lamp = 5;
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    other_lamp = LAMP;
    saturate(&scene, CLIP);
    struct reconstruction r;
    shell_solve_with(SHELL_SETTINGS("80"), &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        bool is_lamp = r.segments.id[s] == lamp[0] || r.segments.id[s] == lamp[1];
        CHECK_THAT(r.is_emitter[s] == is_lamp, "segment %zu", s);
        rgb found = r.materials.emission[s];
        if (is_lamp)
            printf("one of a pair: %.2f %.2f %.2f\n", (double)found.r, (double)found.g, (double)found.b);
        if (is_lamp)
            CHECK_RGB(found, lamp_radiance, 0.2f);
    }
    reconstruct_release(&r);
    scene_release(&scene);
}

/* A third of the photographs is exposed for the lamp. */
static void test_measured(struct scene *scene) {
    struct scene others = {.photograph = scene->photograph, .photograph_count = 2 * FRAMES / 3};
    saturate(&others, CLIP);
    struct reconstruction r;
    shell_solve_with(SHELL_COARSE, scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(!r.evidence[s].is_unbounded && r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
    CHECK(r.light.source_count == 0);
    reconstruct_release(&r);
}

/* A third of the photographs is exposed for the room, in the others the sky outshines the bar: none shows that it is
 * not the bar which shines. */
static void test_bar(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    for (size_t i = 4 * (size_t)(OBJECTS + 2); i < scene.mesh.vertex_count; i++) {
        vec3 *p = &scene.mesh.position[i];
        *p = (vec3){1.9f + 0.2f * (p->x - 1.5f), 1.25f + 1.5f * (p->z - 1.0f), -0.02f};
    }
    image_init_rgb(&sky, 64, 32);
    for (size_t i = 0; i < 3 * 64 * 32; i++)
        sky.pixel[i] = SKY_RADIANCE;
    wall_color[LAMP] = rgb_gray(0.8f);
    photograph_samples = 16;
    photograph_mesh(&scene, rgb_gray(0.0f), &sky, look_at_window, pool);
    struct scene dark = {.photograph = scene.photograph, .photograph_count = 2 * FRAMES / 3};
    struct scene bright = {.photograph = scene.photograph + 2 * FRAMES / 3,
                           .photograph_count = FRAMES - 2 * FRAMES / 3};
    saturate(&dark, CLIP);
    saturate(&bright, 0.0625f);
    struct reconstruction r;
    shell_solve_with(SHELL_COARSE, &scene, 0, &r);
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(!r.evidence[s].is_unbounded && !r.is_emitter[s], "segment %zu", s);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    make_scene(&scene, pool);
    if (!IS_BRIEF)
        test_measured(&scene);
    test_lamp(&scene);
    scene_release(&scene);
    if (!IS_BRIEF) {
        test_polished_wood(pool);
        if (IS_LONG)
            test_sky(pool, SKY_RADIANCE, SKY_RADIANCE);
        test_sky(pool, SKY_RADIANCE, 3.0f);
        test_pair(pool);
        test_bar(pool);
    }
    parallel_free(pool);
    return check_result();
}
