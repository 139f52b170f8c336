/* photograph_reduce.c -- see photograph_reduce.h. */
#include "server/scene/photograph_reduce.h"

#include <math.h>

#include "common/image.h"

uint32_t camera_step_to(const struct camera *camera, double most) {
    double width = (double)camera->width, height = (double)camera->height;
    if (most <= 0.0)
        return 1;
    return (uint32_t)fmin(fmax(ceil(sqrt(width * height / most)), 1.0), fmin(width, height));
}

uint32_t camera_step(const struct camera *camera) { return camera_step_to(camera, REDUCED_MAX_PIXELS); }

struct camera camera_reduced(const struct camera *camera, uint32_t step) {
    struct camera reduced = *camera;
    float share = 1.0f / (float)step;
    reduced.width = camera->width / step;
    reduced.height = camera->height / step;
    reduced.fx *= share;
    reduced.fy *= share;
    reduced.cx *= share;
    reduced.cy *= share;
    return reduced;
}

/* Sums of the pixels of one block, as photograph.h reads them. */
struct pixel_block {
    float sum[3];
    uint32_t saturated[3]; /* of how many pixels */
    bool is_usable;
};

static struct pixel_block sum_block(const struct photograph *photo, uint32_t step, size_t x0, size_t y0) {
    struct pixel_block block = {.is_usable = true};
    for (size_t y = y0; y < y0 + step; y++) {
        for (size_t x = x0; x < x0 + step; x++) {
            size_t at = y * photo->camera.width + x;
            block.is_usable &= !photo->mask || photo->mask[at] != 0;
            for (int c = 0; c < 3; c++) {
                bool is_saturated = false;
                block.sum[c] += photograph_value(photo, at, c, &is_saturated);
                block.saturated[c] += is_saturated;
            }
        }
    }
    return block;
}

static void put_pixel(const struct pixel_block *block, uint32_t step, size_t at, struct photograph *out) {
    uint32_t count = step * step;
    bool is_usable = block->is_usable;
    out->saturated[at] = 0;
    for (int c = 0; c < 3; c++) {
        out->pixel[at][c] = image_half_from_float(block->sum[c] / (float)count);
        out->saturated[at] |= (uint8_t)((block->saturated[c] == count) << c);
        is_usable &= isfinite(block->sum[c]) && (block->saturated[c] == 0 || block->saturated[c] == count);
    }
    out->mask[at] = is_usable;
}

void photograph_reduce(const struct photograph *photo, uint32_t step, struct spill *spill, struct photograph *out) {
    *out = *photo;
    out->camera = camera_reduced(&photo->camera, step);
    size_t width = out->camera.width, height = out->camera.height;
    out->spill = spill;
    out->name = out->color_space = NULL;
    out->firefly = NULL;
    out->clipped = NULL;
    out->black = 0.0f; /* what is stored as 0 is read as less, before the mean is taken */
    out->pixel = spill_take(spill, width * height, sizeof *out->pixel);
    out->saturated = spill_take(spill, width * height, sizeof *out->saturated);
    out->mask = spill_take(spill, width * height, sizeof *out->mask);
    for (size_t y = 0; y < height; y++) {
        photograph_use(out, y * width, width);
        for (size_t row = 0; row < step; row++)
            photograph_use(photo, (y * step + row) * photo->camera.width, photo->camera.width);
        for (size_t x = 0; x < width; x++) {
            struct pixel_block block = sum_block(photo, step, x * step, y * step);
            put_pixel(&block, step, y * width + x, out);
        }
    }
}
