/* survey.h -- points all over the surface, and rays from them that read what photographs show: what is known of
 * the light before anything is known of materials. */
#ifndef UNBAKE_LIGHT_SURVEY_H
#define UNBAKE_LIGHT_SURVEY_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/gather/incident.h"
#include "server/state/reconstruction.h"

struct survey {
    struct reconstruction *r;   /* borrowed */
    uint16_t (*radiance)[3];    /* [height][width] half precision: what texels send out; owned, as all below */
    struct light_field field;
    size_t count;
    uint32_t *texel;            /* [count] evenly spread, shown by photographs, of no lamp */
    struct incident *scratch;   /* [threads] */
};

/* `field` has what all texels send out, and what they mirror; NULL: what was fused, and of texels that no photograph
 * shows the mean of their segment, or of the room. What was seen must be fused. Until survey_release whatever
 * outshines the room is a light of the world: small lamps must be looked for. Segments of without[segment_count] (NULL:
 * none; borrowed) send out nothing, but what polished surfaces mirror of them is known. At most `points` points. */
void survey_init(struct survey *s, struct reconstruction *r, const struct views *views,
                 const struct light_field *field, const bool *without, size_t points);
void survey_release(struct survey *s);

#endif
