/* reading_apply.h -- applies a scene's reading (common/reading.h) to what the readers have read. */
#ifndef UNBAKE_INGEST_READING_APPLY_H
#define UNBAKE_INGEST_READING_APPLY_H

#include "common/reading.h"
#include "server/ingest/frames.h"
#include "server/scene/mesh.h"

/* Axes, lens, shift and exposures. Exposures that only the photographs' EXIF tells are read later and not seen here. */
void reading_apply_frames(const struct reading *reading, struct frames *t);
/* Axes and scale. */
void reading_apply_mesh(const struct reading *reading, struct mesh *mesh);

/* The camera-to-world motion, with our axes, of a pose that was read as `told` and means `meant`; in the file's
 * coordinates, since the inverse of a pose depends on the origin. */
struct exact_pose reading_reinterpret(const struct exact_pose *world_from_camera, enum matrix_axes told,
                                      enum matrix_axes meant);

#endif
