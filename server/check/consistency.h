/* consistency.h -- how well photographs agree about the surface under a hypothesis about their poses.
 *
 * Rays through pixels of a photograph meet the mesh; where other photographs see the same point, their local contrast
 * (thumbnail.h) is compared. The score is
 *
 *     sum over points of mean over the others of a b  /  sum over points of a^2,
 *
 * a, b the values of the point in its own and in another photograph; points that no other photograph sees count as 0.
 * It is about 0 for poses that are not those of the photographs, and above .2 for those that are.
 *
 * Its distribution for wrong poses is measured: the same points and projections, with the pictures of other cameras,
 * turned and displaced (a permutation test). The score's distance from their mean in their standard deviations is `z`.
 * Two hypotheses are compared photograph by photograph. */
#ifndef UNBAKE_CHECK_CONSISTENCY_H
#define UNBAKE_CHECK_CONSISTENCY_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/check/hypothesis.h"
#include "server/check/thumbnail.h"
#include "server/render/accel.h"

#define CONSISTENCY_PHOTOGRAPHS 40 /* taken into account at most; +25 %: no verdict, correlations -0.01 to +0.02 */
#define CONSISTENCY_POINTS 640     /* of each at most; +25 %: 1 verdict of 96 */

struct consistency; /* opaque */

/* How much is looked at. */
struct consistency_effort {
    size_t photographs, points, draws;
};

struct photo_agreement {
    double score, z;
    double correlation;               /* of the values, at points that two or more photographs see */
    double hit_share;                 /* of rays that meet the mesh */
    double back_share;                /* of those, that meet a triangle from behind */
    double shared_share;              /* of rays whose point another photograph sees */
    double inside_share;              /* of cameras within the mesh's bounds, grown by a tenth */
    double null_mean, null_deviation; /* of the score for wrong poses */
    size_t photograph_count;
    double part[CONSISTENCY_PHOTOGRAPHS];   /* the numerator's of each photograph */
    double weight[CONSISTENCY_PHOTOGRAPHS]; /* the denominator's; 0: has no pose */
};

/* Borrows scene, acceleration structure and pool. */
struct consistency *consistency_new(const struct scene *scene, const struct accel *accel, struct parallel *pool);
void consistency_free(struct consistency *c);

/* The same for any number of threads; different `seed`s look at different points. */
void consistency_measure(const struct consistency *c, const struct hypothesis *h,
                         const struct consistency_effort *effort, uint64_t seed, struct photo_agreement *result);

/* By how many standard deviations of the score for wrong poses `better` agrees better than `other`, measured with the
 * same effort and seed. 0 where the photographs do not confirm it one by one (a paired test at three standard errors):
 * a few of them must not decide. Negative: it agrees less. */
double consistency_compare(const struct photo_agreement *better, const struct photo_agreement *other);

/* The score that three of four photographs exceed, over the score of all. */
double consistency_evenness(const struct photo_agreement *a);

/* Mean of thumbnail.detail. */
double consistency_detail(const struct consistency *c);
const struct thumbnail *consistency_thumbnail(const struct consistency *c, size_t photograph);

#endif
