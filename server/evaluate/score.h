/* score.h -- how near recovered materials are to the true ones, as seen by test cameras.
 *
 * Pixel measures over pictures of parameters (channels base_color.R G B, roughness, specular,
 * emission.R G B; truth also object_id, -1 where nothing is), summed over views:
 *
 *   base colour  10 log10(1 / mean squared error) over channels and pixels in which no sample
 *                meets an emitter or nothing, values clamped to [0, 1]; once over pixels all of
 *                whose samples land on surface that a training view sees (seen.h; the
 *                headline), once over all
 *   roughness,   the same over seen pixels whose 3 x 3 neighbourhood is one object of the truth
 *   specular
 *   emission     intersection over union of the pixels that emit; mean over pixels and channels
 *                of (log(1 + a) - log(1 + b))^2 */
#ifndef UNBAKE_EVALUATE_SCORE_H
#define UNBAKE_EVALUATE_SCORE_H

#include <stddef.h>
#include <stdint.h>

#include "common/image.h"

/* What a pixel's samples met. */
enum {
    SCORE_PLAIN = 1, /* neither an emitter nor nothing */
    SCORE_SEEN = 2   /* only surface that some training view sees */
};

/* A sum of squared errors and what it was taken over. */
struct score_sum {
    double sum;
    size_t count;
};

struct score {
    struct score_sum base_color_seen, base_color_all, roughness, specular, emission_log;
    size_t emission_both, emission_either; /* pixels */
    size_t pixels, plain_pixels, seen_pixels; /* seen: plain and seen */
};

/* Adds a view. Pictures are of one size; flags[height * width] as above. */
void score_add(struct score *score, const struct image *found, const struct image *truth,
               const uint8_t *flags);

double score_mean(struct score_sum sum);    /* NaN for nothing */
double score_psnr_db(struct score_sum sum); /* infinite without error, NaN for nothing */
double score_emission_iou(const struct score *score); /* 1 when neither emits anywhere */

#endif
