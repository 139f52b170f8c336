/* tracks.h -- places of strong texture, and which photographs see them: what tells whether
 * photographs lie where their poses say, and how sharp they are.
 *
 * Each photograph contributes the places of strongest texture from a grid of cells over its
 * picture, away from depth edges; a place is a point of the surface, and some other photographs
 * that see it from no more than a few times as far or near. */
#ifndef UNBAKE_CAPTURE_TRACKS_H
#define UNBAKE_CAPTURE_TRACKS_H

#include "common/parallel.h"
#include "server/capture/pyramid.h"
#include "server/capture/views.h"

#define TRACK_OTHERS 10 /* at most, of each track */

struct track {
    float x, y;                   /* its place in the photograph */
    vec3 point;
    vec3 right, down;             /* along the surface, to where the next pixels look */
    uint32_t other[TRACK_OTHERS]; /* index into views.train */
    uint8_t other_count;          /* at least 2 */
};

struct tracks {
    const struct views *views; /* borrowed */
    struct pyramid *pyramid;   /* [train_count]; owned */
    size_t pyramid_pixels;     /* that level 0 of one may have */
    size_t capacity;           /* tracks a photograph, at most */
    size_t *count;             /* [train_count]; owned */
    struct track *track;       /* [train_count][capacity]; owned */
};

/* Does with bounded memory and time what it can: the more photographs, the fewer tracks and the
 * smaller a pyramid for each. The same for any number of threads. */
void tracks_make(struct tracks *t, const struct views *views, struct parallel *pool);
/* The pyramid of a photograph that contributes no tracks, for looking at those of others. To be released by the caller. */
void tracks_pyramid(const struct tracks *t, const struct photograph *photo, struct pyramid *pyramid);
void tracks_release(struct tracks *t);

#endif
