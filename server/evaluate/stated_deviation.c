/* stated_deviation.c -- see stated_deviation.h. */
#include "server/evaluate/stated_deviation.h"

#include <math.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/evaluate/pair_picture.h"
#include "server/evaluate/score.h"
#include "server/render/film.h"

enum status stated_deviation_load(const char *outputs, const struct recovered *recovered, struct texture *deviation,
                                  struct error *err) {
    struct image image = {0};
    char *path = file_join(outputs, OUTPUT_CONFIDENCE);
    const struct texture *color = &recovered->materials.base_color;
    *deviation = (struct texture){0};
    enum status status = file_is_in(outputs, OUTPUT_CONFIDENCE) ? image_read(path, &image, NULL, err) : STATUS_OK;
    if (status == STATUS_OK && image.pixel && image_channel(&image, "R") == 0 && image.channel_count == 3 &&
        image.width == color->width && image.height == color->height) {
        texture_init(deviation, &recovered->inverse, rgb_gray(0.0f));
        for (size_t i = 0; i < (size_t)image.width * image.height; i++)
            memcpy(deviation->texel[i], image.pixel + 3 * i, 3 * sizeof(float));
    }
    image_release(&image);
    mem_free(path);
    return status;
}

/* It takes the place of base colour for the while. */
void stated_deviation_render(struct recovered *recovered, const struct texture *deviation, const struct camera *camera,
                             uint32_t samples, uint64_t seed, struct parallel *pool, struct image *image) {
    struct texture *shown = &recovered->materials.base_color, kept = *shown;
    *shown = *deviation;
    film_render_first_hits(&recovered->world, camera, samples, seed, pool, image);
    *shown = kept;
}

void deviation_coverage_add(struct deviation_coverage *coverage, const struct image *found,
                            const struct image *deviation, const struct image *truth, const uint8_t *flags) {
    struct rgb_columns fc = pair_picture_columns(found, "base_color."), tc = pair_picture_columns(truth, "base_color."),
                       dc = pair_picture_columns(deviation, "base_color.");
    for (size_t i = 0; i < (size_t)truth->width * truth->height; i++) {
        const float *f = found->pixel + i * found->channel_count, *t = truth->pixel + i * truth->channel_count,
                    *d = deviation->pixel + i * deviation->channel_count;
        for (int c = 0; c < 3 && (flags[i] & SCORE_SEEN); c++) {
            float error = fabsf(clampf(f[fc.at[c]], 0.0f, 1.0f) - clampf(t[tc.at[c]], 0.0f, 1.0f));
            coverage->count++;
            coverage->within_one += error <= d[dc.at[c]];
            coverage->within_two += error <= 2.0f * d[dc.at[c]];
        }
    }
}
