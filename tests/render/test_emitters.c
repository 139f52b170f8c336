/* emitters.h: a lamp is found, and of a speck in mixed pixels a single look that is too bright tells nothing. A room in
 * which nothing shines is said to be none. */
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define SPECK 5
#define SPECK_M 0.05f
#define BRIGHTER 8.0f

static const vec3 speck_corner = {2.0f, 0.3f, 1.5f};

/* The room, of which both walls across z are one object, with a speck above its floor that is no pixel wide. */
static void make_speckled_room(struct mesh *m) {
    vec3 x = {4, 0, 0}, y = {0, 3, 0};
    start_room(m, OBJECTS + 1);
    add_quad(m, 4, (vec3){0, 0, 0}, x, y);
    add_quad(m, 4, (vec3){0, 0, 3}, y, x);
    add_lamp(m);
    add_quad(m, SPECK, speck_corner, (vec3){0, 0, SPECK_M}, (vec3){SPECK_M, 0, 0});
}

/* The four pixels that a look at the speck reads; false where the photograph does not show it. */
static bool brighten_speck(struct photograph *photo, float factor) {
    vec3 middle = vec3_add(speck_corner, (vec3){0.5f * SPECK_M, 0, 0.5f * SPECK_M});
    float x, y, depth_m;
    if (photo->is_test || photo->camera.world_from_camera.translation.y < middle.y + 0.2f ||
        !camera_project(&photo->camera, middle, &x, &y, &depth_m) || x < 1 || y < 1 || x > WIDTH - 1 || y > HEIGHT - 1)
        return false;
    for (size_t k = 0; k < 4; k++) {
        size_t column = (size_t)(x - 0.5f) + k % 2, row = (size_t)(y - 0.5f) + k / 2;
        uint16_t *pixel = photo->pixel[row * WIDTH + column];
        for (size_t c = 0; c < 3; c++)
            pixel[c] = image_half_from_float(factor * image_float_from_half(pixel[c]));
    }
    return true;
}

static void check_emitters(struct scene *scene, size_t frame) {
    struct reconstruction r;
    shell_solve(scene, 2, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        CHECK_THAT(r.is_emitter[s] == (r.segments.id[s] == LAMP), "segment %zu, frame %zu", s, frame);
        CHECK_THAT(r.evidence[s].is_seen == (r.segments.id[s] != SPECK), "segment %zu, frame %zu", s, frame);
    }
    CHECK(cJSON_IsTrue(cJSON_GetObjectItem(r.report, "lit")));
    reconstruct_release(&r);
}

/* Its only lamp is told to be none. */
static void test_unlit(struct scene *scene) {
    struct reconstruction r;
    shell_solve_with("{" SHELL_COARSE_TEXTURE "," SHELL_LITTLE ",\"emitters.6\":\"off\"}", scene, 0, &r);
    CHECK(cJSON_IsFalse(cJSON_GetObjectItem(r.report, "lit")));
    reconstruct_release(&r);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    size_t tried = 0;
    make_speckled_room(&scene.mesh);
    photograph_mesh(&scene, lamp_radiance, NULL, look_anywhere, pool);
    for (size_t f = 0; f < scene.photograph_count && (!IS_BRIEF || tried < 1); f++) {
        if (!brighten_speck(&scene.photograph[f], BRIGHTER))
            continue;
        tried++;
        check_emitters(&scene, f);
        brighten_speck(&scene.photograph[f], 1.0f / BRIGHTER);
    }
    CHECK(tried > 0);
    test_unlit(&scene);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
