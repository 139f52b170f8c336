/* strength_search.h -- the strength of one light at which a loss is least, all other lights being as they are.
 *
 * A robust loss has several minima along a strength, so it is tried over many octaves; then ever nearer to the best. */
#ifndef UNBAKE_LIGHT_STRENGTH_SEARCH_H
#define UNBAKE_LIGHT_STRENGTH_SEARCH_H

#include <stddef.h>

#define STRENGTHS 20 /* tried at once, an octave apart */

/* Fills loss[count] at each of strength[count], STRENGTHS at most. */
typedef void strength_losses(void *user, const double *strength, size_t count, double *loss);

/* By how much the loss falls from none of that light to the best strength, *best; 0 and 0 where no strength helps.
 * known: all other light of the points that it reaches; response: their light by it at strength 1. */
double strength_search(double known, double response, strength_losses *losses, void *user, double *best);

#endif
