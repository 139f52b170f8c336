/* adam.c -- see adam.h. */
#include "server/refine/adam.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

void adam_init(struct adam *a, size_t count, int width, float beta1, float beta2) {
    *a = (struct adam){.count = count, .width = width, .beta1 = beta1, .beta2 = beta2};
    a->record = mem_calloc_large(count, (1 + 2 * (size_t)width) * sizeof *a->record);
}

void adam_release(struct adam *a) {
    mem_free(a->record);
    *a = (struct adam){0};
}

void adam_reset(struct adam *a, size_t first, size_t count) {
    memset(adam_record(a, first), 0, count * (1 + 2 * (size_t)a->width) * sizeof *a->record);
}

void adam_touch(struct adam *a, size_t entry, const float *gradient, float *step) {
    float *record = adam_record(a, entry), *mean = record + 1, *square = mean + a->width;
    float touches = record[0] += 1.0f;
    float correct1 = 1.0f / (1.0f - powf(a->beta1, touches));
    float correct2 = 1.0f / (1.0f - powf(a->beta2, touches));
    for (int i = 0; i < a->width; i++) {
        float g = gradient[i];
        mean[i] += (1.0f - a->beta1) * (g - mean[i]);
        square[i] += (1.0f - a->beta2) * (g * g - square[i]);
        float size = sqrtf(square[i] * correct2);
        step[i] = size > 0.0f ? -mean[i] * correct1 / size : 0.0f;
    }
}
