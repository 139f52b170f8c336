/* relight.h -- renders the room of a finished job in another light, from other places, with other things in it.
 *
 * A render is a list of pictures, numbered from 0: each view under each sun. It needs the outputs' folder of a
 * reconstruction alone, and the files that settings name. Each picture's files are complete under their final names or
 * absent; views.jsonl has a line for each picture that is done, and is what lets a render go on where it was broken
 * off. When all pictures are there, views.json lists them with their cameras. */
#ifndef UNBAKE_RELIGHT_RELIGHT_H
#define UNBAKE_RELIGHT_RELIGHT_H

#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/sha256.h"
#include "server/relight/relight_job.h"

/* STATUS_INPUT for settings that do not fit this room (a segment that is not there; nothing that shines). */
enum status relight_run(const struct relight_job *job, const struct relight_watch *watch, struct parallel *pool,
                        struct error *err);

/* How many pictures the settings mean, and how many pixels all of them have together: without reading the room. */
enum status relight_count(const struct relight_job *job, uint64_t *pictures, uint64_t *pixels, struct error *err);

/* What a render is, before it begins. */
struct relight_plan {
    uint64_t pictures;
    double paths;                 /* pixels times samples, of all of them; a guess where noise or time limit them */
    char digest[SHA256_HEX_SIZE]; /* with which views.jsonl records its pictures */
};
enum status relight_look(const struct relight_job *job, struct relight_plan *plan, struct error *err);

#endif
