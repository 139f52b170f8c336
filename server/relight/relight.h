/* relight.h -- renders the room of a finished job in another light, from other places, with other objects in it.
 *
 * A render is a list of pictures, numbered from 0: each view under each sun. It needs the outputs' folder of a
 * reconstruction alone, and the files that settings name. Each picture's files are complete under their final names or
 * absent; views.jsonl has a line for each picture that is done, and is what lets a render go on where it was broken
 * off. When all pictures are there, views.json lists them with their cameras. */
#ifndef UNBAKE_RELIGHT_RELIGHT_H
#define UNBAKE_RELIGHT_RELIGHT_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/relight_job.h"

/* STATUS_INPUT for settings that do not fit this room (a segment that is not there; nothing that shines). */
enum status relight_run(const struct relight_job *job, const struct relight_watch *watch, struct parallel *pool,
                        struct error *err);

#endif
