/* reconstruct.h -- a whole reconstruction, stage by stage, as the worker runs it.
 *
 * A later attempt needs only a list of named arrays (struct state_array): textures, moments, counters. The worker saves
 * and restores them; this side never sees SQL. Everything else (atlas, acceleration structure, visibility) is rebuilt
 * from the scene. Same scene, settings and seed give the same bytes, for any number of threads and any history of stops
 * and resumes. */
#ifndef UNBAKE_RECONSTRUCT_RECONSTRUCT_H
#define UNBAKE_RECONSTRUCT_RECONSTRUCT_H

#include "common/error.h"
#include "common/parallel.h"
#include "common/settings.h"
#include "server/scene/scene.h"
#include "server/state/reconstruction.h"

/* Runs all stages up to `report`. Solves unknown exposures in `scene`, flips triangles that photographs see from
 * behind, estimates missing normals. STATUS_CANCELLED when stopped (a checkpoint was saved). Whatever it returns, *r
 * must be released. */
enum status reconstruct_run(struct scene *scene, const struct settings *settings, struct parallel *pool,
                            const struct reconstruct_hooks *hooks, struct reconstruction *r, struct error *err);
void reconstruct_release(struct reconstruction *r);

#endif
