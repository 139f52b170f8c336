/* virtual_objects.h -- makes the objects that a render's settings put into a room: lamps, and meshes of files. */
#ifndef UNBAKE_RELIGHT_VIRTUAL_OBJECTS_H
#define UNBAKE_RELIGHT_VIRTUAL_OBJECTS_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/compass.h"
#include "server/relight/relight_job.h"
#include "server/relight/virtual_object.h"

/* Lamps first, then meshes, each by number. `offset` is that of the room's mesh. Use virtual_objects_release in any
 * case. */
enum status virtual_objects_read(const struct relight_job *job, const struct compass *compass, const double offset[3],
                                 struct parallel *pool, struct virtual_objects *objects, struct error *err);
void virtual_objects_release(struct virtual_objects *objects);

/* Luminous flux (lm) of a spot of area 1 m2 and luminance 1 cd/m2 along its axis. */
double virtual_objects_spot_flux(struct emission_cone cone);

#endif
