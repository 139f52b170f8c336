/* fireflies.h, in a whole reconstruction: pixels that shine by chance, in each photograph at other places, leave no
 * spots, and without its noise taken out no more error than without them. So do patches of some photographs that are no
 * numbers or at the end of half precision (photo_faults.h). */
#include "common/image_ceiling.h"
#include "server/ingest/photo_pixels.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define STEP 9      /* pixels from a firefly to the next, in a row and of rows */
#define TIMES 30.0f /* as bright as it should be */
#define SPOT 0.25f  /* so far off a texel's colour is seen */

static void add_fireflies(struct scene *scene) {
    for (size_t f = 0; f < scene->photograph_count; f++) {
        for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
            uint16_t *pixel = scene->photograph[f].pixel[i];
            bool is_spark = (i % WIDTH + 4 * f) % STEP == 0 && (i / WIDTH + f) % STEP == 0;
            for (int c = 0; c < 3 && is_spark; c++)
                pixel[c] = image_half_from_float(TIMES * image_float_from_half(pixel[c]));
        }
    }
}

#define EVERY 4 /* of the photographs one is faulty */
#define PATCH 6 /* pixels */

/* As a file has them whose writer failed at three places: of numbers that are none, of the largest half, of both. */
static float faulty(size_t x, size_t y, float value) {
    size_t patch = x / (2 * PATCH);
    if (y < HEIGHT / 2 || y >= HEIGHT / 2 + PATCH || x % (2 * PATCH) >= PATCH || patch > 2)
        return value;
    bool is_nan = patch == 0 || (patch == 2 && x % 3 == 0);
    return is_nan ? NAN : IMAGE_HALF_LARGEST;
}

static void add_faults(struct scene *scene) {
    const struct image_info info = {.encoding = IMAGE_LINEAR, .bits = 16};
    for (size_t f = 0; f < scene->photograph_count; f += EVERY) {
        struct photograph *photo = &scene->photograph[f];
        struct photo_faults faults;
        struct image image;
        image_init_rgb(&image, WIDTH, HEIGHT);
        for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * 3; i++)
            image.pixel[i] = faulty(i / 3 % WIDTH, i / 3 / WIDTH, image_float_from_half(photo->pixel[i / 3][i % 3]));
        photo_faults_begin(&faults, photo->name, &image, &info);
        photo_pixels_from_linear(&image, &info, photo, &faults);
        CHECK(faults.bounds == PATCH * PATCH && faults.beside == PATCH * PATCH * 2 / 3);
        CHECK(faults.not_finite == PATCH * PATCH * 4 / 3);
        image_release(&image);
    }
}

/* How far texels of the walls are off. */
struct off {
    double error; /* root of the mean square */
    size_t spots;
};

static struct off reconstruct(struct scene *scene, const char *photographs) {
    struct settings s = shell_settings("{\"texture_size\":96,\"report_samples\":1,\"gather_samples\":64,"
                                       "\"denoise\":false,\"iterations\":8}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    struct off off = {0.0, 0};
    double count = 0.0;
    for (size_t i = 0; i < r.inverse.valid_count; i++) {
        uint32_t texel = r.inverse.valid[i], wall = reconstruction_segment(&r, texel);
        const float *color = r.materials.base_color.texel[texel];
        if (wall == LAMP || !(r.fused.count[texel] > 0.0f))
            continue;
        float by = color[1] - wall_color[wall].g;
        off.error += (double)(by * by);
        off.spots += fabsf(by) > SPOT;
        count += 1.0;
    }
    off.error = sqrt(off.error / count);
    printf("%s: error %.4f, %zu spots of %.0f texels\n", photographs, off.error, off.spots, count);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    return off;
}

static void check_no_worse(struct off with, struct off without) {
    CHECK(with.spots <= without.spots + 5);
    CHECK(with.error < 1.15 * without.error);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene;
    make_scene(&scene, pool);
    struct off without = reconstruct(&scene, "without fireflies");
    add_faults(&scene);
    check_no_worse(reconstruct(&scene, "with faults"), without);
    scene_release(&scene);
    make_scene(&scene, pool);
    add_fireflies(&scene);
    check_no_worse(reconstruct(&scene, "with fireflies"), without);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
