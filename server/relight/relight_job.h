/* relight_job.h -- what a render is given, and whom it tells how far it is. */
#ifndef UNBAKE_RELIGHT_RELIGHT_JOB_H
#define UNBAKE_RELIGHT_RELIGHT_JOB_H

#include <stdbool.h>
#include <stdint.h>

#include "common/render_settings.h"

struct denoiser; /* denoise.h */

struct relight_job {
    const char *outputs;             /* folder of a reconstruction's outputs */
    const char *files;               /* folder of the files that settings name; NULL: they are paths */
    const cJSON *settings;           /* that render_settings_check found good */
    const char *out;                 /* folder; made where it is not there, once the inputs are read */
    uint64_t first_view, view_count; /* a part: which of the pictures; view_count 0: all from the first */
    const struct denoiser *denoiser; /* for denoise=true; NULL: there is none, which is STATUS_UNAVAILABLE then */
};

/* Callbacks; each may be NULL. They are called by the thread that called relight_run. */
struct relight_watch {
    void *user;
    bool (*should_stop)(void *user);                         /* then STATUS_CANCELLED */
    void (*progress)(void *user, double done, double total); /* pictures */
    /* A file is complete, in `out`; sha256: its hash in hex, NULL where it is not known. */
    void (*file)(void *user, const char *name, const char *sha256);
    /* The same of a picture that was there already: the file is as the record says. */
    void (*kept)(void *user, const char *name, const char *sha256);
    void (*preview)(void *user, const char *name); /* the same of a PNG that will become better */
    void (*message)(void *user, const char *text); /* something that the user should know */
};

#endif
