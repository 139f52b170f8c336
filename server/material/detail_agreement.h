/* detail_agreement.h -- the part of each texel's residual on which photographs agree; the rest is noise. */
#ifndef UNBAKE_MATERIAL_DETAIL_AGREEMENT_H
#define UNBAKE_MATERIAL_DETAIL_AGREEMENT_H

#include "server/material/detail_state.h"

/* Fills weight_sum and signal_share, which are 0 before, and chooses sum_scale. Changes the sums. */
void detail_agreement_find(struct detail *d);

#endif
