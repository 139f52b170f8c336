/* holes.h -- closes the holes that a scan left in a room, before anything is lit by it.
 *
 * Scanners lose what is beyond their range, dark, glossy or hidden. What photographs show through such a hole would be
 * taken for distant light, and light the room. Where the room's own planes go on through it (room_planes.h), each cell
 * of them (hole_grid.h) is looked at by all photographs (hole_observations.h); connected cells become surface where the
 * photographs agree that there is one, and stay open where they show a window, a door or another room (hole_regions.h,
 * hole_evidence.h). So do, on a scan, those that no photograph shows but that lie within a plane (hidden_holes.h).
 *
 * Limits. Holes that are narrower than a cell, or that lie off the widest planes, stay open: what comes in through them
 * is found by server/light/openings.h. Where photographs cannot tell a plain wall from distant light, it is closed only
 * if radiance goes on across its rim: an opening that is closed by mistake takes away light that is then looked for
 * elsewhere, a hole that stays open adds light that is measured, if at the wrong distance. */
#ifndef UNBAKE_HOLES_HOLES_H
#define UNBAKE_HOLES_HOLES_H

#include "common/json.h"
#include "server/capture/views.h"

struct holes_wanted {
    bool fills_all;     /* also what is an opening by the evidence */
    bool fills_hidden;  /* also what no photograph shows */
    const vec3 *within; /* [2] corners, the lower first, of a box outside of which nothing is filled; NULL: none */
};

struct holes_found {
    size_t filled, kept; /* regions */
    double filled_m2, kept_m2;
    size_t triangles; /* that were added */
    cJSON *list;      /* an object for each region of more than a few cells; the caller's (cJSON_Delete), or NULL */
};

/* Fills holes of scene->mesh, whose triangles `segments` divides and `views` see: the mesh, whose arrays may be moved,
 * and the segments grow. Poses and exposures must be known. When triangles were added, what was made of the mesh must
 * be made again. The same for any number of threads. */
void holes_fill(struct scene *scene, struct segments *segments, const struct views *views,
                const struct holes_wanted *wanted, struct parallel *pool, struct holes_found *found);

#endif
