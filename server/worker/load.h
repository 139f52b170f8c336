/* load.h -- the scene of a reconstruction: read as the order says, without what its settings leave out. */
#ifndef UNBAKE_WORKER_LOAD_H
#define UNBAKE_WORKER_LOAD_H

#include "common/parallel.h"
#include "common/settings.h"
#include "common/spill.h"
#include "server/scene/scene.h"
#include "server/worker/order.h"
#include "server/worker/progress.h"

/* Pixels go to `spill`. What there is to say of the scene goes to the job's log. *scene needs scene_release in any
 * case. */
enum status load_scene(const struct order *order, struct progress *progress, struct spill *spill,
                       const struct settings *settings, struct parallel *pool, struct scene *scene, struct error *err);

#endif
