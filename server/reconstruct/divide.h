/* divide.h -- base colour in closed form: what a texel sends out over what arrives there.
 *
 * For each photograph of a texel, (shown - gloss) / white is its base colour; the robust mean over the
 * photographs is taken, weighted as in fuse.h and less where the highlight is a large part of what
 * is shown. Texels that no photograph measured get the mean of their segment. */
#ifndef UNBAKE_RECONSTRUCT_DIVIDE_H
#define UNBAKE_RECONSTRUCT_DIVIDE_H

#include <stdbool.h>
#include <stdint.h>

#include "server/reconstruct/incident.h"
#include "server/reconstruct/probes.h"
#include "server/reconstruct/reconstruct.h"
#include "server/reconstruct/views.h"

struct divide {
    struct reconstruction *r;         /* borrowed, as all below; r->materials.base_color is written */
    const struct views *views;
    const struct probes *probes;
    const struct light_field *field;
    struct incident *scratch;         /* [threads] */
    bool *known;                      /* [height][width] whether a photograph measured the texel */
};

/* The valid texels [first, first + count), by their place in inverse.valid. Emitters, whose own light
 * hides it, get a neutral base colour. */
void divide_texels(struct divide *d, size_t first, size_t count);

/* What a white diffuse surface at the texel sends towards its normal; false where it is not valid. */
bool divide_white(const struct divide *d, uint32_t texel, rgb *white);

/* After all texels: fills the unknown ones, and writes what they send out to radiance. */
void divide_fill(struct divide *d, uint16_t (*radiance)[3]);

#endif
