/* changing_light.h: a black wall that shows a picture in half of the photographs, dimmer than white paint would be, is
 * found to emit, and where; one that mirrors the lamp is not, nor one on which the same is painted, not even where half
 * of the photographs saturate far below it. */
#include "server/state/evidence.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define SCREEN 2     /* the wall at x = 0 */
#define NEAR_M 0.4f  /* the picture leaves so much of the wall free all around */
#define PICTURE 0.3f /* radiance; white paint there would show .32 */
#define CLIP 0.0625f /* exact as a half */

enum paint { STILL, CHANGING, GLOSSY, CLIPPED };

/* Three of five photographs show the wall, the others anything: a wall that none shows may be a lamp. */
static vec3 look_at_screen(int frame) {
    if (frame % 5 > 2)
        return look_anywhere(frame);
    vec3 at = spread(frame * 7 + 3, 0.5f);
    return (vec3){0.0f, at.y, at.z};
}

/* How far a place of the wall lies within the picture, metres. */
static float depth_in_picture(float y, float z) {
    return fminf(fminf(y - NEAR_M, 3.0f - NEAR_M - y), fminf(z - NEAR_M, 3.0f - NEAR_M - z));
}

static void add_picture(struct photograph *photo) {
    vec3 from = camera_origin(&photo->camera), d;
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        float x = (float)(i % WIDTH) + 0.5f, y = (float)(i / WIDTH) + 0.5f;
        if (!camera_direction(&photo->camera, x, y, &d) || !(d.x < 0.0f))
            continue;
        float far = -from.x / d.x;
        for (int c = 0; c < 3 && depth_in_picture(from.y + far * d.y, from.z + far * d.z) > 0.0f; c++)
            photo->pixel[i][c] = image_half_from_float(PICTURE + image_float_from_half(photo->pixel[i][c]));
    }
}

static void make_room(struct scene *scene, bool is_glossy, struct parallel *pool) {
    *scene = (struct scene){0};
    make_mesh(&scene->mesh);
    wall_color[SCREEN] = rgb_gray(0.03f);
    wall_roughness[SCREEN] = is_glossy ? 0.2f : 1.0f;
    wall_specular[SCREEN] = is_glossy ? 1.0f : 0.0f;
    photograph_mesh(scene, lamp_radiance, NULL, look_at_screen, pool);
}

/* Puts paint on the photographs of the room, whose pixels are `plain`. */
static void paint_screen(struct scene *scene, uint16_t (*const plain[FRAMES])[3], enum paint paint) {
    for (size_t f = 0; f < FRAMES; f++)
        memcpy(scene->photograph[f].pixel, plain[f], WIDTH * HEIGHT * sizeof *plain[f]);
    for (size_t f = 0; f < scene->photograph_count; f++) {
        if (paint == STILL || paint == CLIPPED || (paint == CHANGING && f % 4 != 0))
            add_picture(&scene->photograph[f]);
        if (paint == CLIPPED && f % 2 != 0)
            saturate_photograph(&scene->photograph[f], CLIP);
    }
}

/* What the wall emits in the mean, in the picture and beside it. */
static void check_picture(const struct reconstruction *r) {
    double sum[2] = {0.0, 0.0}, count[2] = {0.0, 0.0};
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], s = reconstruction_segment(r, texel);
        struct surface_point at;
        if (r->segments.id[s] != SCREEN || !surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
            continue;
        float depth_m = depth_in_picture(at.position.y, at.position.z);
        if (fabsf(depth_m) < 0.15f)
            continue;
        sum[depth_m > 0.0f] += (double)rgb_mean(materials_emission_of_texel(&r->materials, s, texel));
        count[depth_m > 0.0f] += 1.0;
    }
    double inside = sum[1] / count[1], beside = sum[0] / count[0];
    printf("emits %.3f, beside the picture %.4f\n", inside, beside);
    CHECK(inside > 0.2 * (double)PICTURE && beside < 0.1 * inside);
}

static void test(struct scene *scene, enum paint paint, int threads) {
    struct reconstruction r;
    shell_solve_with(paint == CHANGING ? SHELL_SMALL : SHELL_COARSE, scene, threads, &r);
    for (size_t s = 0; s < r.segments.count; s++) {
        int64_t id = r.segments.id[s];
        bool changes = id == SCREEN && paint == CHANGING;
        if (id == SCREEN)
            printf("paint %d: changes %.2f, shown %.3f, arrived %.3f\n", paint, (double)r.evidence[s].changing_share,
                   (double)rgb_mean(r.evidence[s].radiance), (double)rgb_mean(r.evidence[s].lambert));
        CHECK_THAT(r.is_emitter[s] == (id == LAMP || changes), "paint %d, segment %zu", paint, s);
        CHECK_THAT((r.evidence[s].changing_share > 0.0f) == changes, "paint %d, segment %zu", paint, s);
    }
    if (paint == CHANGING)
        check_picture(&r);
    reconstruct_release(&r);
}

/* Paints that change no light are put on one set of photographs. The one that saturates is the last. */
static void test_diffuse(struct parallel *pool) {
    const enum paint paint[] = {CHANGING, STILL, CLIPPED};
    struct scene scene;
    uint16_t(*plain[FRAMES])[3];
    make_room(&scene, false, pool);
    for (size_t f = 0; f < FRAMES; f++) {
        plain[f] = mem_array(WIDTH * HEIGHT, sizeof *plain[f]);
        memcpy(plain[f], scene.photograph[f].pixel, WIDTH * HEIGHT * sizeof *plain[f]);
    }
    for (int i = 0; i < (IS_BRIEF ? 1 : 3); i++) {
        paint_screen(&scene, plain, paint[i]);
        test(&scene, paint[i], i == 0 ? 2 : 0);
    }
    for (size_t f = 0; f < FRAMES; f++)
        mem_free(plain[f]);
    scene_release(&scene);
}

static void test_glossy(struct parallel *pool) {
    struct scene scene;
    make_room(&scene, true, pool);
    test(&scene, GLOSSY, 0);
    scene_release(&scene);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_diffuse(pool);
    if (!IS_BRIEF)
        test_glossy(pool);
    parallel_free(pool);
    return check_result();
}
