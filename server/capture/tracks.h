/* tracks.h -- places of strong texture and the photographs that see them, from which pose errors and blur are measured.
 *
 * Each photograph contributes the strongest gradients of a grid of cells over its picture, away from depth edges. A
 * track is a point of the surface and some other photographs that see it from a similar distance. */
#ifndef UNBAKE_CAPTURE_TRACKS_H
#define UNBAKE_CAPTURE_TRACKS_H

#include "common/parallel.h"
#include "server/capture/pyramid.h"
#include "server/capture/views.h"

/* Photographs a track besides its own, at most: time and memory are proportional. */
#define TRACK_OTHERS 10 /* +25 %: no change */
/* Between normal and view, for a photograph to be used: 78 degrees, where a pixel is five times as long on the surface
 * as across. */
#define TRACK_MIN_COSINE 0.2f /* +25 %: no change */

struct track {
    float x, y; /* position in its own photograph, pixels */
    vec3 point;
    vec3 right, down;             /* offsets along the surface to the next pixels, metres */
    uint32_t other[TRACK_OTHERS]; /* index into views.train */
    uint8_t other_count;          /* at least 2 */
};

struct tracks {
    const struct views *views; /* borrowed */
    struct pyramid *pyramid;   /* [train_count]; owned */
    size_t pyramid_pixels;     /* of level 0, at most */
    size_t capacity;           /* tracks a photograph, at most */
    size_t *count;             /* [train_count]; owned */
    struct track *track;       /* [train_count][capacity]; owned */
};

/* Memory and time are bounded: the more photographs, the fewer tracks and the smaller a pyramid of each. The same for
 * any number of threads. */
void tracks_make(struct tracks *t, const struct views *views, struct parallel *pool);
/* The pyramid of a photograph that contributes no tracks. To be released by the caller. */
void tracks_pyramid(const struct tracks *t, const struct photograph *photo, struct pyramid *pyramid);
void tracks_release(struct tracks *t);

#endif
