/* adam.h -- sparse Adam (Kingma & Ba 2015, Algorithm 1).
 *
 * An entry is `width` numbers that always have a gradient together (the channels of a texel). Moments decay, and bias
 * correction counts, per update of the entry and not per iteration: an entry without a gradient costs nothing. */
#ifndef UNBAKE_REFINE_ADAM_H
#define UNBAKE_REFINE_ADAM_H

#include <stddef.h>

struct adam {
    size_t count; /* entries */
    int width;    /* numbers an entry, at most 4 */
    float beta1, beta2;
    /* [count][1 + 2 * width] owned: number of updates (up to 2^24), first moment in gradient units, second in gradient
     * units squared. Interleaved: a random access costs one cache miss instead of three. */
    float *record;
};

static inline float *adam_record(const struct adam *a, size_t entry) {
    return a->record + entry * (1 + 2 * (size_t)a->width);
}
static inline float adam_touches(const struct adam *a, size_t entry) { return adam_record(a, entry)[0]; }
static inline size_t adam_bytes(const struct adam *a) {
    return a->count * (1 + 2 * (size_t)a->width) * sizeof *a->record;
}

void adam_init(struct adam *a, size_t count, int width, float beta1, float beta2);
void adam_release(struct adam *a);
/* Resets `count` entries from `first` on. */
void adam_reset(struct adam *a, size_t first, size_t count);

/* Takes the finite gradient[width] of one entry into its moments and writes the step for rate 1:
 * step[width] = -mean / sqrt(square), corrected for bias, about 1 in size. Entries are
 * independent: different ones may be touched at the same time. */
void adam_touch(struct adam *a, size_t entry, const float *gradient, float *step);

#endif
