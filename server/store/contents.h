/* contents.h -- lists the files beside the database that a copy of it refers to: for backups. */
#ifndef UNBAKE_STORE_CONTENTS_H
#define UNBAKE_STORE_CONTENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct contents_scene {
    char id[65];
    bool is_ready; /* its archive must be there */
};

struct contents_job {
    int64_t id;
    int attempt;
    bool is_running, is_terminal;
    size_t first, count; /* its outputs: [first, first + count) */
};

struct contents_output {
    char *name;  /* owned */
    int attempt; /* in whose folder it lies */
    uint64_t bytes;
    char sha256[65]; /* as the worker announced it */
};

struct contents {
    struct contents_scene *scenes;   /* [scene_count]; owned, and so below */
    struct contents_job *jobs;       /* [job_count] */
    struct contents_output *outputs; /* [output_count], job by job */
    size_t scene_count, job_count, output_count;
};

/* Reads the database file, which nobody else may have open. Release *c in any case. */
enum status contents_read(struct contents *c, const char *path, struct error *err);
void contents_release(struct contents *c);

#endif
