/* survey.h -- points all over the surface, and rays from them that read observed radiance: incident light before
 * materials are known. */
#ifndef UNBAKE_LIGHT_SURVEY_H
#define UNBAKE_LIGHT_SURVEY_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/gather/irradiance.h"
#include "server/state/reconstruction.h"

/* Rays of a point by which light is estimated. */
#define SURVEY_RAYS 512
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
 * points, of which no more than a lower bound is observed, and of lamps such, only `with_bounds`. */
void survey_init(struct survey *s, struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const bool *without, bool with_bounds, size_t points);
void survey_release(struct survey *s);

/* Light at a texel's place `at`, by `rays` rays from a little inside of its triangle: a texel whose centre lies beside
 * it stands for a point of its edge, from where rays pass between two walls. In scratch[thread] is what the rays found.
 * False where there is no place. Thread-safe for different threads. */
bool survey_gather(const struct survey *s, uint32_t texel, size_t rays, int thread, struct surface_point *at,
                   struct irradiance *light);

/* What a surface of albedo 1 would send of it towards its normal. */
rgb survey_lambert(const struct surface_point *at, const struct irradiance *light);

/* Mean radiance of `fused` around a texel; black where it has none. */
rgb survey_observed(const struct survey *s, const struct fused *fused, uint32_t texel);

#endif
