/* noise_floor.c -- see noise_floor.h. */
#include "server/evaluate/noise_floor.h"

#include <math.h>
#include <unistd.h>

/* Variance of a photograph of 256 samples over that of a flat render. The sample count of the flat renders is not
 * published; in smooth areas (smooth_areas.h) photographs of the two test rooms have 4.1 to 4.5 times their variance,
 * so it was at least 1,024. */
#define VARIANCE_RATIO 4.0
#define RELATIVE_FLOOR 0.01 /* times the squared median, in the denominator of MSRE */

static const char *const shown[3] = {"R", "G", "B"}, *const error_of[3] = {"err.R", "err.G", "err.B"};

double noise_floor_of(const struct image *photograph, const struct image *flat, double median_radiance) {
    double sum = 0.0, count = 0.0;
    for (int c = 0; c < 3; c++) {
        int value_at = image_channel(flat, shown[c]), error_at = image_channel(flat, error_of[c]);
        for (size_t i = 0; i < (size_t)flat->width * flat->height; i++) {
            const float *pixel = flat->pixel + i * flat->channel_count;
            double radiance = (double)photograph->pixel[3 * i + (size_t)c], value = (double)pixel[value_at];
            if (!isfinite(radiance))
                continue;
            count += 1.0;
            if (!(value > 0.0))
                continue; /* black in both: no noise */
            double deviation = (double)pixel[error_at] / value * radiance;
            sum += VARIANCE_RATIO * deviation * deviation /
                   (radiance * radiance + RELATIVE_FLOOR * median_radiance * median_radiance);
        }
    }
    return sum / count;
}

static enum status check(const struct image *flat, const struct image *photograph, const char *path,
                         struct error *err) {
    for (int c = 0; c < 3; c++)
        if (image_channel(flat, shown[c]) < 0 || image_channel(flat, error_of[c]) < 0)
            return error_set(err, STATUS_INPUT, "%s: has no channel %s or %s", path, shown[c], error_of[c]);
    if (flat->width != photograph->width || flat->height != photograph->height)
        return error_set(err, STATUS_INPUT, "%s: is not of its photograph's size", path);
    return STATUS_OK;
}

enum status noise_floor_add(struct noise_floor *sum, const char *path, const struct image *photograph, double msre,
                            double median_radiance, struct error *err) {
    struct image flat = {0};
    if (access(path, F_OK) != 0)
        return STATUS_OK;
    enum status status = image_read(path, &flat, NULL, err);
    if (status == STATUS_OK)
        status = check(&flat, photograph, path, err);
    if (status == STATUS_OK) {
        sum->floor += noise_floor_of(photograph, &flat, median_radiance);
        sum->msre += msre;
        sum->count++;
    }
    image_release(&flat);
    return status;
}
