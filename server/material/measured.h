/* measured.h -- what the photographs of a texel tell together: a value, how sure it is, and a draw of its noise. */
#ifndef UNBAKE_MATERIAL_MEASURED_H
#define UNBAKE_MATERIAL_MEASURED_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/capture/robust.h"
#include "server/scene/rgb_half.h"

/* Half precision but for the weight, since there may be many millions. The variance is that of the sum over the
 * channels. */
struct measured {
    float weight;           /* inverse variance, up to a factor of the capture; 0: nothing was measured */
    uint16_t value[3];
    uint16_t noise[3];      /* a draw of its noise */
    uint16_t mixing;        /* variance by light of other surfaces; neighbours share it */
};

static inline rgb measured_value(const struct measured *m) {
    return rgb_from_half(m->value);
}

/* What is gathered of one texel: a look a photograph, of no more photographs than this, those of the greatest weights
 * (best.h) among all of the capture. It bounds the time that highlights take, and memory: 3 KiB a thread, however many
 * photographs there are. In redkitchen 18 % of the seen triangles have more; the best of them in place of the first are
 * worth .09 dB of its held-out views. */
#define MEASURED_LOOKS 48
struct measured_looks {
    size_t count;
    struct robust_sample look[MEASURED_LOOKS];
};

/* Their mean, weighed by robust_weigh with `scale`; there must be some. `common_noise` is a draw of the relative error that
 * all of them share, by channel. Lowers and sorts the looks' weights. */
struct measured measured_mean(struct measured_looks *looks, float scale, rgb common_noise);

#endif
