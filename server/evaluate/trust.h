/* trust.h -- how true the stated uncertainty of base colour is, and how plain what is plain came out; both over pixels
 * that show seen surface (SCORE_SEEN of score.h). */
#ifndef UNBAKE_EVALUATE_TRUST_H
#define UNBAKE_EVALUATE_TRUST_H

#include <stddef.h>
#include <stdint.h>

#include "common/image.h"

struct trust {
    /* Errors of channels that are at most one, two of the deviations that confidence.exr states for them; a normal
     * distribution has 68 and 95 % of them there. */
    size_t within_one, within_two, judged;
    /* Where 5 x 5 pixels of the truth show one object of about one base colour: squares of what the recovered one's
     * error differs by from its mean over them, over channels; pixels where that is more than TRUST_SPECK in a
     * channel. */
    double plain_squares;
    size_t plain_pixels, specks;
};

#define TRUST_SPECK 0.03f /* reflectance; on a wall of .7 about two steps of 8-bit sRGB a per cent, plainly visible */

/* Adds a view. Pictures of one size with the channels base_color.R G B; truth also object_id. deviation: of found's
 * base colour under the same names; NULL where the outputs state none. */
void trust_add(struct trust *trust, const struct image *found, const struct image *deviation, const struct image *truth,
               const uint8_t *flags);

double trust_share(size_t part, size_t whole);           /* NaN of nothing */
double trust_plain_deviation(const struct trust *trust); /* of base colour; NaN where nothing is plain */

#endif
