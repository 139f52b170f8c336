/* insert.h -- a mesh of a file that is put into a room, with the materials that the file has. */
#ifndef UNBAKE_RELIGHT_INSERT_H
#define UNBAKE_RELIGHT_INSERT_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/compass.h"
#include "server/relight/relight_job.h"
#include "server/relight/thing.h"

/* insert.N of the job. What of the file is left out becomes notes of `things`. */
enum status insert_make(const struct relight_job *job, uint32_t number, const struct compass *compass,
                        const double offset[3], struct parallel *pool, struct thing *thing, struct things *things,
                        struct error *err);

#endif
