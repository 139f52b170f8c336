/* photo_faults.h -- pixels of linear photographs that say nothing or less than they seem to, and what is told of them.
 *
 * A number that is none is no observation. One at the end of half precision, in which photographs are kept, is a lower
 * bound: surfaces that all photographs show so become lamps. A few are told; where they are many, or so much that a
 * photograph says nothing, something is wrong with what wrote it. */
#ifndef UNBAKE_INGEST_PHOTO_FAULTS_H
#define UNBAKE_INGEST_PHOTO_FAULTS_H

#include <stdbool.h>

#include "common/image.h"
#include "server/ingest/findings.h"

/* Of one photograph, in pixels. */
struct photo_faults {
    const char *file;            /* borrowed; NULL: not read */
    size_t pixel_count, outside; /* that an EXR's data window has and leaves out; the latter are NaN and no fault */
    size_t not_finite;           /* a channel is no number, or infinite where that is no bound */
    size_t bounds;               /* a channel is at or above the largest number of half precision */
    size_t beside;               /* the same, connected with pixels that are not finite: not used */
    double light, negative;      /* sums of what is stored, and of what is cut off below 0 */
    bool is_linear;
};

/* Before its pixels are counted. */
void photo_faults_begin(struct photo_faults *faults, const char *file, const struct image *image,
                        const struct image_info *info);

/* STATUS_INPUT where most of a photograph says nothing. */
enum status photo_faults_judge(const struct photo_faults *faults, struct error *err);

/* Tells what was found in `count` photographs. */
void photo_faults_warn(const struct photo_faults *faults, size_t count, struct findings *f);

#endif
