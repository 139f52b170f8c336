/* adam.c -- see adam.h. */
#include "server/reconstruct/adam.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

void adam_init(struct adam *a, size_t count, int width, float beta1, float beta2) {
    size_t numbers = count * (size_t)width;
    *a = (struct adam){.count = count, .width = width, .beta1 = beta1, .beta2 = beta2};
    a->mean = mem_calloc_large(numbers, sizeof *a->mean);
    a->square = mem_calloc_large(numbers, sizeof *a->square);
    a->touch_count = mem_calloc_large(count, sizeof *a->touch_count);
}

void adam_release(struct adam *a) {
    mem_free(a->mean);
    mem_free(a->square);
    mem_free(a->touch_count);
    *a = (struct adam){0};
}

void adam_reset(struct adam *a, size_t count) {
    memset(a->mean, 0, count * (size_t)a->width * sizeof *a->mean);
    memset(a->square, 0, count * (size_t)a->width * sizeof *a->square);
    memset(a->touch_count, 0, count * sizeof *a->touch_count);
}

void adam_touch(struct adam *a, size_t entry, const float *gradient, float *step) {
    float *mean = a->mean + entry * (size_t)a->width;
    float *square = a->square + entry * (size_t)a->width;
    if (a->touch_count[entry] < UINT16_MAX)
        a->touch_count[entry]++;
    float touches = (float)a->touch_count[entry];
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
