/* markov_field.h -- Gaussian Markov random fields over cells that have neighbours (Rue and Held 2005): values that are
 * near 0, near those of the neighbours, and near what was observed.
 *
 * Cells that are connected are a part. The normal equations of a part are a band matrix once its cells are numbered by
 * their distance from one at its rim (Cuthill and McKee 1969), and are solved exactly by its Cholesky factor: for the
 * cells of a chart of w x h in w h min(w, h)^2 operations, where conjugate gradients need a thousand rounds and more,
 * since the prior is wide. Parts are solved apart from each other, each by one thread. */
#ifndef UNBAKE_REFINE_MARKOV_FIELD_H
#define UNBAKE_REFINE_MARKOV_FIELD_H

#include <stddef.h>
#include <stdint.h>

#define MARKOV_NONE UINT32_MAX /* no neighbour */

struct markov_field {
    size_t count;                   /* cells */
    const uint32_t (*neighbour)[4]; /* [count] cells, or MARKOV_NONE; of each other; borrowed */
    size_t part_count;
    uint32_t *first; /* [part_count + 1] first entry of a part in `cell`; owned, as all below */
    uint32_t *cell;  /* [count] the cells, part by part */
    uint32_t *place; /* [count] of each cell within its part */
    uint32_t *band;  /* [part_count] greatest difference of the places of two neighbours */
};

/* Inverse variances: of a value, of the difference of two neighbours, and of what was observed at each cell. */
struct markov_precision {
    double prior, smoothness;
    const double *observed; /* [count] 0: nothing was observed */
};

void markov_field_init(struct markov_field *f, size_t count, const uint32_t (*neighbour)[4]);
void markov_field_release(struct markov_field *f);

/* Replaces value[count], what was observed, by the field's mean given that, for the cells of one part. The prior is
 * greater than 0. Parts may be solved at the same time. */
void markov_field_solve(const struct markov_field *f, size_t part, const struct markov_precision *precision,
                        double *value);

#endif
