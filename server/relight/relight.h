/* relight.h -- renders the room of a finished job in another light, from other places, with other things in it.
 *
 * A render is a list of pictures, numbered from 0: each view under each sun. It needs the outputs' folder of a
 * reconstruction alone, and the files that settings name. Each picture's files are complete under their final names or
 * absent; views.jsonl has a line for each picture that is done, and is what lets a render go on where it was broken
 * off. When all pictures are there, views.json lists them with their cameras. */
#ifndef UNBAKE_RELIGHT_RELIGHT_H
#define UNBAKE_RELIGHT_RELIGHT_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "common/render_settings.h"

struct denoiser; /* denoise.h */

struct relight_job {
    const char *outputs;             /* folder of a reconstruction's outputs */
    const char *files;               /* folder of the files that settings name; NULL: they are paths */
    const cJSON *settings;           /* that render_settings_check found good */
    const char *out;                 /* an existing folder */
    uint64_t first_view, view_count; /* a part: which of the pictures; view_count 0: all from the first */
    const struct denoiser *denoiser; /* for denoise=true; NULL: there is none, which is STATUS_UNAVAILABLE then */
};

/* Callbacks; each may be NULL. They are called by the thread that called relight_run. */
struct relight_watch {
    void *user;
    bool (*should_stop)(void *user);                         /* then STATUS_CANCELLED */
    void (*progress)(void *user, double done, double total); /* pictures */
    void (*file)(void *user, const char *name);              /* a file is complete, in `out` */
    void (*preview)(void *user, const char *name);           /* the same of a PNG that will become better */
    void (*message)(void *user, const char *text);           /* something that the user should know */
};

/* STATUS_INPUT for settings that do not fit this room (a segment that is not there; nothing that shines). */
enum status relight_run(const struct relight_job *job, const struct relight_watch *watch, struct parallel *pool,
                        struct error *err);

/* How many pictures the settings mean, and how many pixels all of them have together: without reading the room. */
enum status relight_count(const struct relight_job *job, uint64_t *pictures, uint64_t *pixels, struct error *err);

#endif
