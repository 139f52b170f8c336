/* fireflies.h, in a whole reconstruction: pixels that shine by chance, in each photograph at other places, leave no
 * spots, and without its noise taken out no more error than without them. */
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

/* How far texels of the walls are off. */
struct off {
    double error; /* root of the mean square */
    size_t spots;
};

static struct off reconstruct(struct scene *scene, const char *photographs) {
    struct settings s = shell_settings("{\"texture_size\":128,\"report_samples\":1,\"gather_samples\":64,"
                                       "\"denoise\":false,\"iterations\":20}");
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
    printf("%s fireflies: error %.4f, %zu spots of %.0f texels\n", photographs, off.error, off.spots, count);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    return off;
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene;
    make_scene(&scene, pool);
    struct off without = reconstruct(&scene, "without");
    add_fireflies(&scene);
    struct off with = reconstruct(&scene, "with");
    CHECK(with.spots <= without.spots + 5);
    CHECK(with.error < 1.15 * without.error);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
