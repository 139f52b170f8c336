/* score.h -- errors of recovered materials against ground truth, as seen by test cameras.
 *
 * Per-pixel measures over parameter pictures (channels base_color.R G B, roughness, specular, emission.R G B; truth
 * also object_id, -1 for background), summed over views:
 *
 *   base colour  10 log10(1 / mean squared error) over channels and pixels without an emitter or background sample,
 *                values clamped to [0, 1]: over pixels all of whose samples are seen by a training view (seen.h; the
 *                headline figure), over all pixels, and over those of roughness and specular below. Also the ratio of
 *                the means, recovered to true, over the seen pixels: light and albedo are ambiguous up to a factor
 *   roughness,   the same over seen pixels whose 3 x 3 neighbourhood is one object of the truth
 *   specular
 *   emission     intersection over union of the emitting pixels; mean over pixels and channels of
 *                (log(1 + a) - log(1 + b))^2 */
#ifndef UNBAKE_EVALUATE_SCORE_H
#define UNBAKE_EVALUATE_SCORE_H

#include <stddef.h>
#include <stdint.h>

#include "common/image.h"

/* Flags of a pixel, by its samples. */
enum {
    SCORE_PLAIN = 1, /* no sample hits an emitter or misses the room */
    SCORE_SEEN = 2   /* every sample hits surface that a training view sees */
};

/* A sum of squared errors and its number of terms. */
struct score_sum {
    double sum;
    size_t count;
};

struct score {
    struct score_sum base_color_seen, base_color_all, base_color_inside, roughness, specular, emission_log;
    double base_color_found, base_color_truth; /* sums over the terms of base_color_seen */
    size_t emission_both, emission_either;     /* pixels */
    size_t pixels, plain_pixels, seen_pixels;  /* seen: plain and seen */
};

/* Adds a view. Pictures are of one size; flags[height * width] as above. */
void score_add(struct score *score, const struct image *found, const struct image *truth, const uint8_t *flags);

double score_mean(struct score_sum sum);                  /* NaN when empty */
double score_share(size_t part, size_t whole);            /* NaN of nothing */
double score_base_color_ratio(const struct score *score); /* found by truth; NaN when the truth is black or empty */
double score_psnr_db(struct score_sum sum);               /* infinite without error, NaN when empty */
double score_emission_iou(const struct score *score);     /* 1 when neither emits anywhere */

#endif
