/* measurement.h -- a value measured from the photographs of a texel, with its weight and a sample of its noise. */
#ifndef UNBAKE_MATERIAL_MEASUREMENT_H
#define UNBAKE_MATERIAL_MEASUREMENT_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/capture/robust.h"
#include "server/scene/rgb_half.h"

/* Half precision except for the weight, since there may be many millions. Variances are summed over the channels. */
struct measurement {
    float weight; /* inverse variance, up to a factor of the capture; 0: not measured */
    uint16_t value[3];
    uint16_t noise[3]; /* a sample of the value's noise */
    uint16_t mixing;   /* variance by light of other surfaces, and of what is bounded; correlated between neighbours */
    uint8_t bounds;    /* bit c: of channel c `value` is a lower bound, or since bound_color_settle what that tells */
};

static inline rgb measurement_value(const struct measurement *m) { return rgb_from_half(m->value); }

/* Observations of one texel, one a photograph, of at most this many photographs: those of the greatest weights
 * (top_k.h). The limit bounds the time of highlights, and memory to 3 KiB a thread. In redkitchen 18 % of the observed
 * triangles have more; keeping the best instead of the first gains .09 dB of its held-out views. */
#define MEASUREMENT_OBSERVATIONS 48 /* +25 %: no change */
struct measurement_observations {
    size_t count;
    struct robust_sample observation[MEASUREMENT_OBSERVATIONS];
};

/* Robust mean (robust_weigh with `scale`) of count > 0 observations. `common_noise` is a sample of the relative error
 * that all of them share, by channel. Lowers the observations' weights and sorts them. */
struct measurement measurement_mean(struct measurement_observations *observations, float scale, rgb common_noise);

#endif
