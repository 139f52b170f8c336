/* divide.h -- base colour in closed form: what a texel sends out over what arrives there.
 *
 * For each photograph of a texel, (shown - gloss) / white is its base colour; the robust mean over the
 * photographs is taken, weighted as in fuse.h and less where the highlight is a large part of what
 * is shown. Of more than MEASURED_LOOKS photographs the best are taken, by their weights before highlights are known. Then the noise of the photographs is taken out (denoise.h). Texels that no photograph
 * measured get what is beside them, or what is to be expected of them (color_prior.h). */
#ifndef UNBAKE_MATERIAL_DIVIDE_H
#define UNBAKE_MATERIAL_DIVIDE_H

#include <stdbool.h>
#include <stdint.h>

#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/gather/incident.h"
#include "server/gather/irradiance.h"
#include "server/gather/probes.h"
#include "server/material/denoise.h"
#include "server/state/reconstruction.h"

struct divide {
    struct reconstruction *r;         /* borrowed, as all below; r->materials.base_color is written */
    const struct views *views;
    const struct probes *probes;
    const struct light_field *field;  /* for highlights */
    const struct noise *noise;
    bool denoises;                    /* else base colour is as measured */
    size_t highlight_samples;         /* directions for one highlight (divide_highlight_samples) */
    uint32_t stride;                  /* one texel is measured for its chart in every stride x stride */
    float *typical;                   /* [segment_count] base colour, by the last divide_finish; .5 before */
    struct incident *scratch;         /* [threads] */
    struct measured *measured;        /* [height][width] what the photographs tell of each texel */
};

/* How many directions are enough for the highlights of texels of which a pixel covers so many. */
size_t divide_highlight_samples(double texels_a_pixel);

/* Measures so many valid texels. Emitters, whose own light hides it, get a neutral base colour. */
void divide_texels(struct divide *d, const uint32_t *texel, size_t count);

/* *matt: what all texels that were measured show towards their normals without their highlights; of all others count is
 * 0. Its spread is NULL. To be released by the caller. */
void divide_matt(const struct divide *d, struct fused *matt);

/* What a white diffuse surface at the texel sends towards its normal; false where it is not valid. */
bool divide_white(const struct divide *d, uint32_t texel, rgb *white);

/* The same for all texels that were measured, to white, [height][width]; 0 where it is too dark to divide by. */
void divide_white_all(const struct divide *d, uint16_t (*white)[3]);

/* What texels send out, half precision: in the mean over viewers; and, as a light_field has it, without what polished
 * segments mirror, and the lobes by which they do. */
struct divide_sent {
    uint16_t (*all)[3], (*unmirrored)[3]; /* [height][width] */
    struct incident_lobe *lobe;           /* [segment_count] */
};

/* After all texels: writes r->materials.base_color, and to `sent` what texels of all but emitters send out. */
void divide_finish(struct divide *d, const struct divide_sent *sent);

#endif
