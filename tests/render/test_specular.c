/* specular_fit.h: a small room with a polished floor, a satin wall, an eggshell one and matt ones, photographed by our
 * own path tracer, and what the solve stage tells of each; then with photographs that hardly tell. */
#include "common/rng.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define CEILING 1
#define EGGSHELL 3
#define SATIN 4

#define LITTLE "\"iterations\":1,\"report_samples\":1,\"gather_samples\":256"

/* Returns the mean base colour of the ceiling. */
static rgb solve(const char *json, struct scene *scene, float roughness[OBJECTS], float specular[OBJECTS]) {
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    for (size_t i = 0; i < OBJECTS; i++) {
        roughness[i] = r.materials.roughness[i];
        specular[i] = r.materials.specular[i];
        printf("object %zu: %.3f %.3f, true %.3f %.3f\n", i, (double)roughness[i], (double)specular[i],
               (double)wall_roughness[i], (double)wall_specular[i]);
    }
    rgb ceiling = shell_mean_color(&r, CEILING);
    const cJSON *solved = cJSON_GetObjectItem(r.report, "solve");
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(solved, "measured_one_texel_in")) == 1.0);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    return ceiling;
}

static void test_told(struct scene *scene) {
    float roughness[OBJECTS], specular[OBJECTS];
    rgb ceiling = solve("{\"texture_size\":160," LITTLE "}", scene, roughness, specular);
    /* Were what the floor and the satin wall mirror sent evenly to all sides it would be .777. */
    CHECK_NEAR(rgb_mean(ceiling), rgb_mean(wall_color[CEILING]), 0.012);
    for (size_t i = 0; i < LAMP; i++) {
        if (i == EGGSHELL) /* of so wide a highlight two of eight photographs tell: it may be missed */
            continue;
        CHECK_NEAR(roughness[i], wall_roughness[i], 0.06);
        CHECK_NEAR(specular[i], wall_specular[i], 0.1);
    }
    CHECK(roughness[EGGSHELL] > 0.68f && specular[EGGSHELL] < 0.6f);
}

/* Every pixel is off by up to NOISE of itself: of the floor it is not sure any more, and takes it for something in
 * between, glossier than the ceiling. */
#define NOISE 0.42f

static void test_hardly_told(struct scene *scene) {
    float roughness[OBJECTS], specular[OBJECTS];
    for (size_t f = 0; f < scene->photograph_count; f++) {
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            float factor = 1.0f + NOISE * (2.0f * rng_to_float((uint32_t)rng_key(7, f, i)) - 1.0f);
            for (size_t c = 0; c < 3; c++) {
                uint16_t *pixel = &scene->photograph[f].pixel[i][c];
                *pixel = image_half_from_float(factor * image_float_from_half(*pixel));
            }
        }
    }
    solve("{\"texture_size\":128," LITTLE "}", scene, roughness, specular);
    CHECK(roughness[FLOOR] > 0.2f && roughness[FLOOR] < 0.75f && specular[FLOOR] > 0.2f && specular[FLOOR] < 0.45f);
    CHECK(roughness[CEILING] > roughness[FLOOR] && specular[CEILING] < specular[FLOOR]);
}

int main(void) {
    photograph_samples = 64; /* noise matters to what is asked here */
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    wall_roughness[FLOOR] = 0.15f;
    wall_roughness[SATIN] = 0.3f;
    wall_roughness[EGGSHELL] = 0.8f;
    wall_specular[EGGSHELL] = 0.6f;
    wall_color[EGGSHELL] = rgb_gray(0.1f); /* a lighter one cannot be told from matt here */
    wall_specular[FLOOR] = wall_specular[SATIN] = 0.5f;
    /* Whiter than anything is: so a white wall looks where less light is found to arrive than does. */
    wall_color[SATIN] = (rgb){1.05f, 1.05f, 1.0f};
    make_mesh(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    test_told(&scene);
    test_hardly_told(&scene);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
