/* applied_transform.h -- undoes what ns-process-data did to the poses of a capture.
 *
 * nerfstudio turns the world before it writes transforms.json and says so in applied_transform (and applied_scale):
 * stored = scale * transform (world of the capture). A mesh that the capture's own tool made is in that world still. */
#ifndef UNBAKE_INGEST_APPLIED_TRANSFORM_H
#define UNBAKE_INGEST_APPLIED_TRANSFORM_H

#include "server/ingest/findings.h"
#include "server/ingest/frames.h"

/* Takes the frames' poses back to the world of the capture and warns, with the reason. Poses stay as they are, with a
 * problem in `name`, when the transform mirrors space or is singular. */
void applied_transform_undo(struct frames *t, const char *name, const char *reason, struct findings *f);

/* Decides for the mesh of that path by who writes such a name; NULL: none. Undoes it for meshes that photogrammetry or
 * a scanner wrote; otherwise leaves the poses and says what would turn the mesh, where something was applied. `given`:
 * what the reading says (frames_choose_coordinates), or NULL. */
void applied_transform_settle(struct frames *t, const char *name, const char *mesh, const char *given,
                              struct findings *f);

#endif
