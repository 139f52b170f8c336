/* mesh_object.h -- a virtual object from a mesh file, with the materials that the file has. */
#ifndef UNBAKE_RELIGHT_MESH_OBJECT_H
#define UNBAKE_RELIGHT_MESH_OBJECT_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/compass.h"
#include "server/relight/relight_job.h"
#include "server/relight/virtual_object.h"

/* Makes the object that the settings insert.N mean. What of the file is not rendered becomes notes of `objects`. */
enum status mesh_object_make(const struct relight_job *job, uint32_t number, const struct compass *compass,
                             const double offset[3], struct parallel *pool, struct virtual_object *object,
                             struct virtual_objects *objects, struct error *err);

#endif
