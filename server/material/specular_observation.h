/* specular_observation.h -- observations of sample points of a segment, and the radiance that each candidate material
 * would reflect there.
 *
 * A photograph is averaged over a patch around a texel, which reduces its noise to what is stated; base colour may vary
 * over the patch, but is the same in all photographs. The diffuse lobe and the highlight of every candidate are
 * gathered at the same places of the patch, since it may be curved. */
#ifndef UNBAKE_MATERIAL_SPECULAR_OBSERVATION_H
#define UNBAKE_MATERIAL_SPECULAR_OBSERVATION_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/gather/highlight.h"
#include "server/gather/probes.h"
#include "server/gather/sun.h"
#include "server/scene/by_segment.h"
#include "server/scene/surface.h"

#define SPECULAR_VIEWS 10 /* observations of a point, at most; bounds time and memory; +25 %: no change */
/* Points of a segment, at most; bounds memory and the share of one segment. */
#define SPECULAR_MAX_POINTS 1024 /* +25 %: no change */
#define SPECULAR_MIN_PATCH 8.0f  /* least side of a patch, texels; +25 %: +0.08 dB, roughness -0.29 */

/* Roughness and specular of the candidates. */
extern const struct highlight_levels specular_levels;

/* A sample point of a segment, and what photographs show there: means over a square patch. */
struct specular_sample {
    uint32_t texel;
    vec3 position; /* of the middle of its patch, m */
    float patch;   /* side of the patch, texels */
    uint32_t count;
    struct {
        uint32_t train; /* index into views.train */
        rgb observed;
        rgb deviation; /* standard, of `observed` by the photograph's noise */
    } view[SPECULAR_VIEWS];
};

/* What each candidate reflects towards the photographs of a sample. */
struct specular_prediction {
    rgb unit_diffuse[HIGHLIGHT_ROUGHNESSES]; /* by the diffuse lobe of base colour 1 */
    struct highlight highlight;
};

/* What the observer reads. Borrowed. */
struct specular_input {
    struct surface surface;
    const struct fused *fused;
    const struct views *views;
    const struct noise *noise; /* of the views' photographs */
    const struct probes *probes;
    const struct light_field *field; /* light from all surfaces */
    const struct sun *sun;
};

struct specular_observer {
    struct specular_input in;
    struct texels_by_segment texels;
    double root_sum;          /* sum over the segments of the square root of their texel count */
    struct incident *scratch; /* [threads]; owned */
};

void specular_observer_init(struct specular_observer *l, const struct specular_input *input, int threads);
void specular_observer_release(struct specular_observer *l);

/* What a point must fulfil. */
struct specular_criteria {
    float patch;  /* side of its patch, texels */
    int edge;     /* greatest edge class of its pixels (views.h) */
    size_t least; /* least number of observations */
};

/* Side of the widest patch of which the segment has room for many, texels. */
float specular_widest_patch(const struct specular_observer *l, size_t segment);

/* Points wanted of a segment. */
size_t specular_points_wanted(const struct specular_observer *l, size_t segment);

/* Texels of a segment that are tried at most, for as many points as are wanted. */
size_t specular_tries(const struct specular_observer *l, size_t segment);

/* Observes the texel tried as number `attempt`; false where it does not fulfil the criteria. */
bool specular_observe(const struct specular_observer *l, size_t segment, size_t attempt,
                      struct specular_criteria criteria, struct specular_sample *sample);

/* Fills prediction[sample->count]. */
void specular_predict(const struct specular_observer *l, const struct specular_sample *sample, int thread,
                      struct specular_prediction *prediction);

#endif
