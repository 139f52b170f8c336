/* prepare.h -- the first stage: from a scene to a surface with texels, calibrated photographs and distant light. */
#ifndef UNBAKE_RECONSTRUCT_PREPARE_H
#define UNBAKE_RECONSTRUCT_PREPARE_H

#include "common/error.h"
#include "server/capture/views.h"
#include "server/state/pace.h"
#include "server/state/reconstruction.h"

/* Holds photographs out, turns and denoises the mesh of r->scene and estimates its normals, calibrates exposures and
 * poses; makes segments, atlas, world, noise and environment of *r, which have no content yet, and *views. All are to
 * be released whatever it returns. STATUS_INPUT where the scene is not one that can be reconstructed. */
enum status prepare_run(struct reconstruction *r, struct views *views, const struct pace *pace, struct error *err);

/* Makes again what is made of mesh and segments, after triangles were added at their ends; the last `coarse` triangles
 * get few texels. */
enum status prepare_again(struct reconstruction *r, struct views *views, size_t coarse, struct error *err);

/* Adds figures of mesh, segments and atlas to the report's "prepare", which prepare_run has made: once nothing is added
 * to them any more. */
void prepare_report_surface(const struct reconstruction *r);

/* Lights the world by r->environment, after its map changed. */
void prepare_environment(struct reconstruction *r);

#endif
