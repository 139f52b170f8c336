/* sun.h, sun_find.h: a sun that shines through a window onto the floor, and that no photograph shows, is found where
 * it is and as strong as it is, its patch is gone from the floor's base colour and it is in the environment's map;
 * a lamp, a dim screen and a sky without a sun are none. In the long form (UNBAKE_LONG) by several numbers of threads.
 * sun_clipped.h: one in whose light all photographs saturate is found as well, its strength about. */
#include "server/light/sun/sun_clipped.h"
#include "server/reconstruct/reconstruct.h"
#include "server/scene/latlong.h"
#include "server/state/evidence.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define SKY_WIDTH 256
#define SKY_HEIGHT 128
#define SUN_ROW 23 /* 57 degrees above, towards -z: column 0 */
#define SUN_RADIANCE 30000.0f

static void make_sky(struct image *sky, float sun) {
    image_init_rgb(sky, SKY_WIDTH, SKY_HEIGHT);
    for (size_t i = 0; i < 3 * SKY_WIDTH * SKY_HEIGHT; i++)
        sky->pixel[i] = 0.5f;
    for (size_t c = 0; c < 3; c++)
        sky->pixel[3 * SUN_ROW * SKY_WIDTH + c] = sun;
}

static float sun_theta(void) { return (float)latlong_polar(SKY_HEIGHT, SUN_ROW); }

/* Of a surface that faces it. */
static float sun_irradiance(void) { return SUN_RADIANCE * (float)latlong_pixel_angle(SKY_WIDTH, SKY_HEIGHT, SUN_ROW); }

/* Mean base colour of the floor's texels that the sun lights. */
static rgb color_of_patch(const struct reconstruction *r) {
    rgb sum = rgb_gray(0.0f);
    float count = 0.0f;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        struct surface_point at;
        if (r->segments.id[reconstruction_segment(r, texel)] != FLOOR ||
            !surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at) ||
            sun_visibility(&r->sun, r->world.accel, &at, 0) < 1.0f)
            continue;
        const float *c = r->materials.base_color.texel[texel];
        sum = rgb_add(sum, rgb_make(c[0], c[1], c[2]));
        count += 1.0f;
    }
    CHECK(count > 20.0f);
    return rgb_scale(sum, 1.0f / count);
}

/* What of the map's light comes from within a few degrees of the sun. */
static float irradiance_in_map(const struct environment *e, vec3 direction) {
    float sum = 0.0f;
    for (size_t row = 0; row < e->map.height; row++) {
        for (size_t column = 0; column < e->map.width; column++) {
            vec3 d = environment_direction(e, column, row);
            float angle = (float)latlong_pixel_angle(e->map.width, e->map.height, (uint32_t)row);
            if (vec3_dot(d, direction) > 0.995f)
                sum += angle * e->map.pixel[3 * (row * e->map.width + column)];
        }
    }
    return sum;
}

static double mirrored_share(const struct reconstruction *r) {
    const cJSON *solve = cJSON_GetObjectItem(r->report, "solve");
    return cJSON_GetNumberValue(cJSON_GetObjectItem(solve, "mirrored_sun_share_of_light"));
}

static void test_sun(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    make_sky(&sky, SUN_RADIANCE);
    photograph_samples = 64; /* noise matters to how bright the sun is found to be, not to whether it is there */
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 0.2f), &sky, look_anywhere, pool);
    photograph_samples = 16;
    vec3 truth = {0.0f, cosf(sun_theta()), -sinf(sun_theta())};
    const int threads[] = {1, 3};
    struct sun found[2] = {{0}};
    for (int i = !IS_LONG; i < 2; i++) {
        struct reconstruction r;
        shell_solve(&scene, threads[i], &r);
        found[i] = r.sun;
        float expected = sun_irradiance();
        CHECK(r.sun.is_there);
        CHECK_THAT(vec3_dot(r.sun.direction, truth) > cosf(0.03f), "%g %g %g", (double)r.sun.direction.x,
                   (double)r.sun.direction.y, (double)r.sun.direction.z);
        CHECK_NEAR(r.sun.irradiance.r, expected, 0.15f * expected);
        CHECK_NEAR(r.sun.irradiance.b, expected, 0.15f * expected);
        CHECK_NEAR(irradiance_in_map(&r.environment, r.sun.direction), r.sun.irradiance.r, 0.03f * r.sun.irradiance.r);
        rgb patch = color_of_patch(&r);
        CHECK_NEAR(patch.r, wall_color[FLOOR].r, 0.15f * wall_color[FLOOR].r);
        CHECK_NEAR(patch.b, wall_color[FLOOR].b, 0.15f * wall_color[FLOOR].b);
        CHECK(mirrored_share(&r) == 0.0);
        for (size_t s = 0; s < r.segments.count; s++)
            CHECK_THAT(!r.is_emitter[s] || r.segments.id[s] == LAMP, "segment %zu", s);
        reconstruct_release(&r);
    }
    CHECK(!IS_LONG || memcmp(&found[0], &found[1], sizeof found[0]) == 0);
    image_release(&sky);
    scene_release(&scene);
}

/* At one exposure the lamp, the sky and what the sun lights saturate. Where these patches lie tells where the sun is,
 * and what they send on how strong it is. */
static void test_clipped(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    make_sky(&sky, SUN_RADIANCE);
    photograph_samples = 64; /* as in test_sun */
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 0.2f), &sky, look_anywhere, pool);
    photograph_samples = 16;
    for (size_t f = 0; f < scene.photograph_count; f++)
        saturate_photograph(&scene.photograph[f], 0.375f); /* exact as a half */
    struct reconstruction r;
    shell_solve(&scene, 0, &r);
    float expected = sun_irradiance(), found = rgb_mean(r.sun.irradiance);
    rgb floor = shell_mean_color(&r, FLOOR);
    printf("a sun at one exposure: %.3g of %.3g, floor %.3f of %.3f\n", (double)found, (double)expected,
           (double)rgb_mean(floor), (double)rgb_mean(wall_color[FLOOR]));
    CHECK(r.sun.is_there && r.sun.is_clipped);
    CHECK_THAT(vec3_dot(r.sun.direction, (vec3){0.0f, cosf(sun_theta()), -sinf(sun_theta())}) > cosf(0.05f), "%g %g %g",
               (double)r.sun.direction.x, (double)r.sun.direction.y, (double)r.sun.direction.z);
    CHECK_THAT(found > 0.7f * expected && found < 1.4f * expected, "%g of %g", (double)found, (double)expected);
    CHECK_NEAR(rgb_mean(floor), rgb_mean(wall_color[FLOOR]), 0.25f * rgb_mean(wall_color[FLOOR]));
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

/* A bright sky saturates, too, and so do walls and what lies in patches with the edges of the window: it is no sun, and
 * they are no lamps. */
static void test_overcast(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    image_init_rgb(&sky, SKY_WIDTH, SKY_HEIGHT);
    for (size_t i = 0; i < 3 * SKY_WIDTH * SKY_HEIGHT; i++)
        sky.pixel[i] = 8.0f;
    photograph_mesh(&scene, rgb_gray(0.0f), &sky, look_anywhere, pool);
    for (size_t f = 0; f < scene.photograph_count; f++)
        saturate_photograph(&scene.photograph[f], 0.75f);
    struct reconstruction r;
    shell_solve(&scene, 0, &r);
    CHECK(!r.sun.is_there);
    size_t saturated = 0;
    for (size_t s = 0; s < r.segments.count; s++) {
        const struct emitter_evidence *e = &r.evidence[s];
        saturated += e->is_seen && e->saturated[0] && e->saturated[1] && e->saturated[2];
        CHECK_THAT(!e->is_unbounded && !e->is_hidden && !r.is_emitter[s], "segment %zu", s);
    }
    CHECK(saturated > 0);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

/* Nobody looks at the window or out of it. */
static vec3 look_away(int frame) {
    vec3 at = spread(frame * 7 + 3, 0.0f);
    return (vec3){at.x, 0.3f * at.y, 3.0f};
}

/* Not even the sky is known then: where the sun is, and that it is in the map, is all that can be asked. */
static void test_without_sky(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    make_sky(&sky, SUN_RADIANCE);
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 0.2f), &sky, look_away, pool);
    struct reconstruction r;
    shell_solve_with(SHELL_COARSE, &scene, 0, &r);
    CHECK(r.sun.is_there && r.environment.map.pixel != NULL);
    CHECK(vec3_dot(r.sun.direction, (vec3){0.0f, cosf(sun_theta()), -sinf(sun_theta())}) > cosf(0.05f));
    CHECK_NEAR(irradiance_in_map(&r.environment, r.sun.direction), r.sun.irradiance.r, 0.03f * r.sun.irradiance.r);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

/* The shade of a dark, polished floor is the lighter, and the bluer, for what it mirrors: by what it shows the sun is
 * yellow, blue less than red by .15. */
static void test_polished_floor(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    const rgb matt = wall_color[FLOOR];
    make_mesh_with_window(&scene.mesh);
    make_sky(&sky, SUN_RADIANCE);
    wall_color[FLOOR] = rgb_make(0.16f, 0.08f, 0.04f);
    wall_roughness[FLOOR] = 0.2f;
    wall_specular[FLOOR] = 1.0f;
    photograph_samples = 64; /* as in test_sun */
    photograph_mesh(&scene, rgb_scale(lamp_radiance, 0.2f), &sky, look_anywhere, pool);
    photograph_samples = 16;
    struct reconstruction r;
    shell_solve_with(SHELL_FINE, &scene, 0, &r);
    float expected = sun_irradiance();
    printf("sun on a polished floor: %.3g %.3g %.3g of %.3g\n", (double)r.sun.irradiance.r, (double)r.sun.irradiance.g,
           (double)r.sun.irradiance.b, (double)expected);
    CHECK(r.sun.is_there);
    CHECK_NEAR(r.sun.irradiance.r, expected, 0.15f * expected);
    CHECK_NEAR(r.sun.irradiance.b, r.sun.irradiance.r, 0.1f * expected);
    double mirrored = mirrored_share(&r);
    CHECK_THAT(mirrored > 0.002 && mirrored < 0.05, "%g", mirrored);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
    wall_color[FLOOR] = matt;
    wall_roughness[FLOOR] = 1.0f;
    wall_specular[FLOOR] = 0.0f;
}

/* Has all photographs saturate where at least `least` of the suns in these directions reach. */
static void saturate_where_lit(struct reconstruction *r, const vec3 *direction, int count, int least) {
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        struct surface_point at;
        int lit = 0;
        if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
            continue;
        for (int k = 0; k < count; k++) {
            const struct sun sun = {.direction = direction[k]};
            lit += sun_visibility(&sun, r->world.accel, &at, 1) > 0.0f;
        }
        r->fused.count[texel] = 1.0f;
        r->fused.is_bound[texel] = lit >= least;
    }
}

/* A bright part of the sky, 40 degrees wide, of which half makes saturate what it reaches: patches have edges that suit
 * a direction in it, but others as well. */
static void check_bright_sky(struct reconstruction *r, struct parallel *pool) {
    vec3 direction[9];
    for (int k = 0; k < 9; k++)
        direction[k] = vec3_normalize((vec3){0.4f * (float)(k % 3 - 1), 0.7f + 0.4f * (float)(k / 3 - 1), -1.0f});
    r->pool = pool;
    saturate_where_lit(r, direction, 9, 5);
    sun_clipped_find(r);
    CHECK(!r->sun.is_there);
    r->pool = NULL;
}

static void test_no_sun(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    make_sky(&sky, 0.5f);
    photograph_mesh(&scene, lamp_radiance, &sky, look_anywhere, pool);
    struct reconstruction r;
    shell_solve_with(SHELL_COARSE, &scene, 0, &r);
    CHECK(!r.sun.is_there);
    check_bright_sky(&r, pool);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

/* A screen, too dim to be a light before it is known what emits (emitters.h), hangs opposite the window: a sun through
 * the window could light nothing but it. */
static void test_dim_screen(struct parallel *pool) {
    struct scene scene = {0};
    struct image sky;
    make_mesh_with_window(&scene.mesh);
    for (size_t i = 4 * (size_t)(OBJECTS + 2); i < scene.mesh.vertex_count; i++) {
        vec3 *p = &scene.mesh.position[i];
        *p = (vec3){0.8f + 2.4f * (p->z - 1.0f), 0.2f + 2.6f * (p->x - 1.5f), 2.95f};
    }
    make_sky(&sky, 0.5f);
    photograph_mesh(&scene, rgb_gray(0.15f), &sky, look_away, pool);
    struct reconstruction r;
    shell_solve_with(SHELL_COARSE, &scene, 0, &r);
    CHECK(!r.sun.is_there);
    for (size_t s = 0; s < r.segments.count; s++)
        CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu", s);
    reconstruct_release(&r);
    image_release(&sky);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_sun(pool);
    test_clipped(pool);
    test_overcast(pool);
    test_without_sky(pool);
    test_polished_floor(pool);
    test_no_sun(pool);
    test_dim_screen(pool);
    parallel_free(pool);
    return check_result();
}
