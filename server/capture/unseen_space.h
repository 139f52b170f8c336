/* unseen_space.h -- where what no photograph shows begins: the border of the space that cameras look into.
 *
 * A scan has no surface behind a cornice, under a cupboard or above a lintel, since no camera sees it. Space is cut
 * into cubes; one is seen if some training camera sees into it past the mesh. A face between a seen cube and an unseen
 * one with no mesh between them is part of the border: light may come from there (hole filling by space carving,
 * Curless and Levoy 1996, has surface there). The faces stand a quarter of a cube deeper than that, so that no camera
 * sees them. */
#ifndef UNBAKE_CAPTURE_UNSEEN_SPACE_H
#define UNBAKE_CAPTURE_UNSEEN_SPACE_H

#include "server/capture/views.h"

/* A square of side_m. */
struct unseen_face {
    vec3 middle, normal; /* unit, along an axis, towards what is seen */
};

/* Connected faces of one normal, within a metre. */
struct unseen_part {
    size_t first, end; /* of the faces */
};

struct unseen_space {
    float side_m; /* of a cube */
    size_t face_count, part_count;
    struct unseen_face *face; /* [face_count] part by part; owned */
    struct unseen_part *part; /* [part_count]; owned */
};

/* Poses must be known. The same for any number of threads. */
void unseen_space_find(struct unseen_space *u, const struct views *views, struct parallel *pool);
void unseen_space_release(struct unseen_space *u);

/* Corners of a face, counter-clockwise as seen. */
void unseen_space_corners(const struct unseen_space *u, const struct unseen_face *face, vec3 corner[4]);

#endif
