/* luminance_unit.c -- see luminance_unit.h. */
#include "server/capture/luminance_unit.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"

#define LEVEL (118.0f / 255.0f) /* of sRGB, which the standard output sensitivity is about */
#define LEVEL_EXPOSURE 10.0     /* lx s times ISO, that give it */
#define LENS 0.65               /* q */
#define SETTINGS_ISO 100.0      /* of photograph.settings_exposure 1 */
#define PHOTOGRAPHS_MIN 3       /* fewer do not tell how far they scatter */
#define CONVENTIONS_FACTOR 1.5  /* between them, and what a camera's tone curve does to them */

/* cd/m2 of pixel value 1 at settings_exposure 1. */
static double luminance_of_white(void) {
    return LEVEL_EXPOSURE / (LENS * SETTINGS_ISO * (double)image_srgb_to_linear(LEVEL));
}

static bool tells(const struct photograph *p) {
    return !p->is_test && !p->is_hdr && p->settings_exposure > 0.0f && rgb_luminance(p->gain) > 0.0f;
}

struct luminance_unit luminance_unit_find(const struct scene *scene) {
    struct luminance_unit unit = {0};
    double *of = mem_array(scene->photograph_count + 1, sizeof *of); /* logarithms */
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *p = &scene->photograph[i];
        if (tells(p))
            of[unit.photographs++] = log(luminance_of_white() * (double)p->exposure * (double)rgb_luminance(p->gain) /
                                         (double)p->settings_exposure);
    }
    if (unit.photographs >= PHOTOGRAPHS_MIN) {
        double middle = quantile_double(of, unit.photographs, 0.5);
        for (size_t i = 0; i < unit.photographs; i++)
            of[i] = fabs(of[i] - middle);
        double sigma = QUANTILE_DEVIATIONS_PER_MAD * quantile_double(of, unit.photographs, 0.5);
        unit.cd_per_m2 = exp(middle);
        unit.within_factor = exp(hypot(log(CONVENTIONS_FACTOR), sigma));
    }
    mem_free(of);
    return unit;
}
