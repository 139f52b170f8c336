/* bound_color.h in closed form: where half of a segment is measured, a bound below its colour tells that colour, and
 * one far above that the texel is unlike it; where nothing is measured, the mean of what paint may be. Channels that
 * are not bounded, and segments without bounds, keep every bit. */
#include <math.h>
#include <string.h>

#include "common/image.h"
#include "server/material/bound_color.h"
#include "tests/unit/plane_rig.h"

#define MEASURED 0.5f
#define WHITE 0.85
#define BLACK 0.02
#define UNLIKE 0.1
#define LIGHT_DEVIATION 0.1

static struct measurement of(float value, uint8_t bounds) {
    uint16_t half = image_half_from_float(value);
    return (struct measurement){.weight = 1.0f, .value = {half, half, half}, .bounds = bounds};
}

/* Mean and variance above `bound` of what the header says, by many small steps; `like`: how likely the first is. */
static void expect(double bound, double like, double *mean, double *variance) {
    const int steps = 100000;
    const double of = (double)MEASURED, deviation = LIGHT_DEVIATION * of;
    double sum = 0.0, first = 0.0, second = 0.0;
    for (int i = 0; i < steps; i++) {
        double x = bound + (WHITE - bound) * (i + 0.5) / steps, off = (x - of) / deviation;
        double density =
            like * exp(-0.5 * off * off) / (deviation * sqrt(2.0 * M_PI)) + (1.0 - like) / (x * log(WHITE / BLACK));
        sum += density;
        first += density * x;
        second += density * x * x;
    }
    *mean = first / sum;
    *variance = second / sum - *mean * *mean;
}

/* Texels of one segment, of which `bounded` have a bound of their green: what these are taken for. */
static void check(struct plane_rig *rig, double bound, size_t measured_count, size_t bounded) {
    static struct measurement measured[PLANE_TEXELS], before[PLANE_TEXELS];
    const struct surface surface = reconstruction_surface(&rig->r);
    memset(measured, 0, sizeof measured);
    for (size_t i = 0; i < measured_count + bounded; i++)
        measured[rig->r.inverse.valid[i]] = i < measured_count ? of(MEASURED, 0) : of((float)bound, 2);
    memcpy(before, measured, sizeof before);
    bound_color_settle(&surface, measured);
    double like = (1.0 - UNLIKE) * (double)measured_count / (double)(measured_count + bounded), mean, variance;
    expect(bound, like, &mean, &variance);
    for (size_t i = 0; i < measured_count + bounded; i++) {
        const struct measurement *m = &measured[rig->r.inverse.valid[i]], *b = &before[rig->r.inverse.valid[i]];
        if (b->bounds == 0) {
            CHECK(memcmp(m, b, sizeof *m) == 0);
            continue;
        }
        rgb value = measurement_value(m);
        CHECK(m->value[0] == b->value[0] && m->value[2] == b->value[2] && m->weight == b->weight);
        CHECK_NEAR((double)value.g, mean, 2e-3);
        CHECK_NEAR((double)image_float_from_half(m->mixing), variance, 2e-2 * variance);
    }
    if (bounded > 0)
        printf("bound %.2f, %zu measured: %.3f +- %.3f\n", bound, measured_count, mean, sqrt(variance));
}

int main(void) {
    struct plane_rig rig;
    plane_rig_init(&rig, 0, 1);
    check(&rig, 0.3, 200, 200);
    check(&rig, 0.45, 200, 200);
    check(&rig, 0.75, 200, 200);
    check(&rig, 0.3, 2, 398);
    check(&rig, 0.1, 0, 400);
    check(&rig, 0.6, 0, 400);
    check(&rig, 0.3, 400, 0);
    plane_rig_release(&rig);
    return check_result();
}
