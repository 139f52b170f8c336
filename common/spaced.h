/* spaced.h -- evenly spaced choices from a list. */
#ifndef UNBAKE_COMMON_SPACED_H
#define UNBAKE_COMMON_SPACED_H

#include <stdbool.h>
#include <stddef.h>

/* The place of the i-th of `wanted` evenly spaced items of `count`, 1 <= wanted; i == wanted gives count, so
 * consecutive places also bound `wanted` parts of the list whose sizes differ by at most one. i * count must fit
 * size_t. */
static inline size_t spaced(size_t i, size_t count, size_t wanted) { return i * count / wanted; }

/* The same of the items of a list that count, `all` of them, which are met one after another. */
struct spacing {
    size_t all, wanted; /* wanted: at most all */
    size_t met, taken;  /* by now */
};

/* Whether the item that is met next is chosen. */
static inline bool spacing_takes(struct spacing *s) {
    bool takes = s->taken < s->wanted && s->met == spaced(s->taken, s->all, s->wanted);
    s->met++;
    s->taken += takes;
    return takes;
}

#endif
