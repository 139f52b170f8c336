/* fireflies.c -- see fireflies.h. */
#include "server/capture/fireflies.h"

#include <math.h>

#include "common/image.h"

/* To the brightest of the eight neighbours: a lens spreads light by about a Gaussian of .9 pixels
 * (calibrate_blur.c), so a neighbour of any real point of light has .54 of it. */
#define MIN_RATIO 2.0f /* +25 %: -0.01 dB, roughness +0.88, specular +0.71 */
/* Standard deviations of noise above that neighbour: one normal value in 30,000 is, ten in .3 megapixels. */
#define NOISE_DEVIATIONS 4.0f /* +25 %: 0 dB */

struct fireflies_job {
    const struct noise *noise;
    struct photograph *photo;
    uint32_t train;
};

/* The stored value of a pixel, mean of the channels. */
static float value_at(const struct photograph *photo, size_t at) {
    const uint16_t *pixel = photo->pixel[at];
    return (image_float_from_half(pixel[0]) + image_float_from_half(pixel[1]) + image_float_from_half(pixel[2])) / 3.0f;
}

/* Whether a pixel of that value is more than MIN_RATIO times as bright as each of the eight neighbours; in *brightest,
 * the brightest of them. Most pixels are known not to be by the first neighbour. */
static bool outshines(const struct photograph *photo, long x0, long y0, float value, float *brightest) {
    long width = (long)photo->camera.width, height = (long)photo->camera.height;
    *brightest = 0.0f;
    for (long y = y0 > 0 ? y0 - 1 : 0; y <= y0 + 1 && y < height; y++) {
        for (long x = x0 > 0 ? x0 - 1 : 0; x <= x0 + 1 && x < width; x++) {
            if (x != x0 || y != y0)
                *brightest = fmaxf(*brightest, value_at(photo, (size_t)(y * width + x)));
            if (!(value > MIN_RATIO * *brightest))
                return false;
        }
    }
    return true;
}

/* Standard deviation of a pixel whose true value is `value`; of 8 bits at least that of black. */
static float deviation_of(const struct fireflies_job *job, long x, long y, float value) {
    const struct photograph *photo = job->photo;
    float of_value = noise_deviation_of_value(job->noise, job->train, &photo->camera, (float)x, (float)y, value);
    return photo->is_hdr ? of_value : fmaxf(of_value, noise_deviation_of_black(job->noise));
}

static bool is_firefly(const struct fireflies_job *job, long x, long y) {
    float value = value_at(job->photo, (size_t)(y * (long)job->photo->camera.width + x)), neighbour;
    return outshines(job->photo, x, y, value, &neighbour) &&
           value - neighbour > NOISE_DEVIATIONS * deviation_of(job, x, y, neighbour);
}

static void mark_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct fireflies_job *job = user;
    uint32_t width = job->photo->camera.width;
    for (size_t y = row > 0 ? row - 1 : 0; y <= row + 1 && y < job->photo->camera.height; y++)
        photograph_use(job->photo, y * width, width);
    for (uint32_t x = 0; x < width; x++)
        job->photo->firefly[row * width + x] = is_firefly(job, (long)x, (long)row);
}

void fireflies_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool) {
    for (uint32_t t = 0; t < views->train_count; t++) {
        struct photograph *photo = &scene->photograph[views->train[t]];
        struct fireflies_job job = {noise, photo, t};
        if (!photo->firefly)
            photo->firefly =
                spill_take(photo->spill, (size_t)photo->camera.width * photo->camera.height, sizeof *photo->firefly);
        parallel_for(pool, photo->camera.height, mark_row, &job);
    }
}
