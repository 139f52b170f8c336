/* emission.c -- see emission.h. */
#include "server/refine/emission.h"

#include <math.h>

#include "common/mem.h"

/* Time constants of 10 and 100 iterations; a run has about a thousand. */
#define BETA1 0.9f  /* to .925: 0 dB */
#define BETA2 0.99f /* to .9925: 0 dB */

/* Keep the logarithm finite: e^-20 is 2e-9, no light in any room's units, e^20 is 5e8. */
#define LOG_RADIANCE_MIN (-20.0f) /* +25 %: no change */
#define LOG_RADIANCE_MAX 20.0f    /* +25 %: no change */

/* Factor of an emitter's base colour steps: it reflects a few hundredths of what it sends, so an error of its radiance
 * would move its base colour twenty times as far. */
#define EMITTER_SLOWDOWN 0.05f /* +25 %: 0 dB */

static float log_radiance(float radiance) {
    return radiance > 0.0f ? fmaxf(logf(radiance), LOG_RADIANCE_MIN) : LOG_RADIANCE_MIN;
}

void emission_init(struct emission *e, struct materials *materials) {
    size_t count = materials->segment_count;
    *e = (struct emission){.materials = materials};
    adam_init(&e->adam, count, 3, BETA1, BETA2);
    e->log_radiance = mem_array(count, sizeof *e->log_radiance);
    for (size_t s = 0; s < count; s++)
        emission_set(e, s, materials->emission[s]);
}

void emission_release(struct emission *e) {
    adam_release(&e->adam);
    mem_free(e->log_radiance);
    *e = (struct emission){0};
}

void emission_set(struct emission *e, size_t segment, rgb radiance) {
    e->materials->emission[segment] = radiance;
    e->log_radiance[segment][0] = log_radiance(radiance.r);
    e->log_radiance[segment][1] = log_radiance(radiance.g);
    e->log_radiance[segment][2] = log_radiance(radiance.b);
    adam_reset(&e->adam, segment, 1);
}

void emission_fix(struct emission *e, const bool *is_emitter) {
    e->is_emitter = is_emitter;
    for (size_t s = 0; s < e->materials->segment_count; s++) {
        if (!is_emitter[s])
            e->materials->emission[s] = rgb_gray(0.0f);
    }
}

void emission_step(struct emission *e, const double (*d_radiance)[3], float rate) {
    for (size_t s = 0; s < e->materials->segment_count; s++) {
        rgb *radiance = &e->materials->emission[s];
        if (rgb_is_black(*radiance))
            continue;
        const float value[3] = {radiance->r, radiance->g, radiance->b};
        float d_log[3], step[3], moved[3]; /* d loss / d log e = e d loss / d e */
        for (int c = 0; c < 3; c++)
            d_log[c] = value[c] * (float)d_radiance[s][c];
        if (d_log[0] == 0.0f && d_log[1] == 0.0f && d_log[2] == 0.0f)
            continue;
        adam_touch(&e->adam, s, d_log, step);
        for (int c = 0; c < 3; c++) {
            float *log = &e->log_radiance[s][c];
            *log = clampf(*log + rate * step[c], LOG_RADIANCE_MIN, LOG_RADIANCE_MAX);
            moved[c] = expf(*log);
        }
        *radiance = rgb_make(moved[0], moved[1], moved[2]);
    }
}

float emission_slowdown(const struct emission *e, size_t segment) {
    return e->is_emitter && e->is_emitter[segment] ? EMITTER_SLOWDOWN : 1.0f;
}
