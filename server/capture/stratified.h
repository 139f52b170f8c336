/* stratified.h -- stratified sampling without replacement: which texels an iteration works on.
 *
 * The valid texels, in the order of inverse_uv.h (neighbours on the surface are neighbours in the list), are cut into
 * as many strata as an iteration takes texels; each iteration takes one texel of each stratum, by a random permutation
 * of the stratum that is redrawn every epoch. So an iteration covers the surface evenly and an epoch visits every texel
 * once. */
#ifndef UNBAKE_CAPTURE_STRATIFIED_H
#define UNBAKE_CAPTURE_STRATIFIED_H

#include <stddef.h>
#include <stdint.h>

#define STRATIFIED_NONE SIZE_MAX

struct stratified {
    size_t item_count;    /* valid texels */
    size_t stratum_count; /* texels an iteration */
    size_t epoch_length;  /* iterations until every texel was visited */
    uint64_t seed;
};

void stratified_init(struct stratified *c, size_t item_count, size_t per_iteration, uint64_t seed);

/* The item in [0, item_count) that `iteration` takes from `stratum`, or STRATIFIED_NONE where this
 * stratum is shorter than the epoch and done. */
size_t stratified_item(const struct stratified *c, uint64_t iteration, size_t stratum);

/* A random permutation of [0, count): the place of `index`. Multiply-and-shift rounds over the
 * next power of two with cycle walking, as in Kensler 2013 (Correlated Multi-Jittered Sampling). */
uint32_t stratified_permute(uint32_t index, uint32_t count, uint32_t key);

/* A step whose multiples modulo `count` visit all of [0, count) once and are spread evenly over any prefix: the first
 * number from count / golden ratio on that is coprime with count. */
size_t stratified_even_step(size_t count);

#endif
