/* survey.h -- points all over the surface, and rays from them that read observed radiance: incident light before
 * materials are known. */
#ifndef UNBAKE_LIGHT_SURVEY_H
#define UNBAKE_LIGHT_SURVEY_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/gather/incident.h"
#include "server/state/reconstruction.h"

/* Rays of a point by which light is estimated. */
#define SURVEY_RAYS 512
/* Keeps the random numbers of points apart from others of the texel. */
#define SURVEY_KEY 29
/* The texels around one, each way as far as this part of the atlas's width, give its observed radiance. */
#define SURVEY_AROUND 640
/* Light added everywhere, which keeps logarithms finite, as a part of the median. */
#define SURVEY_DARK 0.01f

struct survey {
    struct reconstruction *r; /* borrowed */
    bool has_lights;          /* it made some of bright segments */
    uint16_t (*radiance)[3];  /* [height][width] half precision: outgoing radiance; owned, as all below */
    struct light_field field;
    size_t count;
    uint32_t *texel;          /* [count] evenly spread, observed, of no lamp */
    struct incident *scratch; /* [threads] */
};

/* Outgoing radiance is that of `field`; with NULL it is fused radiance, and for unobserved texels the mean of their
 * segment, or of the room. Segments of without[segment_count] (NULL: none; borrowed) send out nothing, but polished
 * surfaces mirror them. All other segments that outshine the room by `views` (NULL: none) are lights of
 * the world until survey_release, since small lamps must be sampled; then all emission is 0. At most `points`
 * points. */
void survey_init(struct survey *s, struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const bool *without, size_t points);
void survey_release(struct survey *s);

#endif
