/* hidden_lamps.h -- which segments that no photograph shows are lamps, by the evidence of what they light.
 *
 * Each is tried as a further source of the joint fit, all others being as they are. The likeliest is taken if, fitted
 * with all others, it raises the posterior by more than a lamp among so many candidates needs (Occam's factor); then
 * the next one is sought. */
#ifndef UNBAKE_LIGHT_HIDDEN_LAMPS_H
#define UNBAKE_LIGHT_HIDDEN_LAMPS_H

#include "server/capture/unseen_space.h"
#include "server/light/light_model.h"

/* Whether there are segments that may be hidden lamps. */
bool hidden_lamps_any(const struct light_model *m);

/* Adds hidden lamps to a model that was surveyed. */
void hidden_lamps_find(struct light_model *m);

/* Seeks them also where a scan has no surface: among the parts of the border of what photographs do not show. Those
 * that are lamps: part[LIGHT_MAX], their number is the result. */
size_t hidden_lamps_find_parts(struct light_model *m, const struct unseen_space *space, uint32_t part[LIGHT_MAX]);

#endif
