/* divide_outgoing.h -- the radiance that texels send out with the base colour found, which the next gathering starts
 * from. */
#ifndef UNBAKE_MATERIAL_DIVIDE_OUTGOING_H
#define UNBAKE_MATERIAL_DIVIDE_OUTGOING_H

#include "server/material/divide.h"

/* Outgoing radiance of texels, half precision: the mean over directions, and the same without the specular part of
 * polished segments, whose lobes follow it in a light_field. */
struct divide_outgoing {
    uint16_t (*total)[3], (*unmirrored)[3]; /* [height][width] */
    struct incident_lobe *lobe;             /* [segment_count] specular 0: not polished */
};

/* After divide_finish: fills `outgoing` for all texels but those of emitters. */
void divide_outgoing_find(const struct divide *d, const struct divide_outgoing *outgoing);

#endif
