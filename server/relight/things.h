/* things.h -- geometry that is put into a room: lamps, and meshes of files. */
#ifndef UNBAKE_RELIGHT_THINGS_H
#define UNBAKE_RELIGHT_THINGS_H

#include <stddef.h>

#include "server/relight/compass.h"
#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/relight_job.h"
#include "server/relight/thing.h"

/* Lamps first, each family by number. `offset` is that of the room's mesh. */
enum status things_read(const struct relight_job *job, const struct compass *compass, const double offset[3],
                        struct parallel *pool, struct things *things, struct error *err);
void things_release(struct things *things);

/* Luminous flux (lm) of a spot of area 1 m2 and luminance 1 cd/m2 along its axis. */
double things_spot_flux(struct emission_cone cone);

#endif
