/* order.h -- job.json: what the daemon tells a worker to do; written by server/job/orders.c.
 *
 *   {"kind":"reconstruct","scene":"DATA/scenes/ID/files","scene_id":"…","reading":{…},"settings":{…},
 *    "name":"my room","job_id":17,"attempt":2,"thread_count":4,"memory_bytes":0,"sandbox":true,
 *    "checkpoint_interval_sec":60,"photograph_memory_bytes":0,"memory_step":0,"keep_free_bytes":671088640,
 *    "disk_bytes":0,"parts":false}
 *   {"kind":"render","outputs":"DATA/jobs/9/attempt-1/out","files":"DATA/jobs/17/files","settings":{…},"name":"…",
 *    "job_id":17,"attempt":1,"thread_count":4,"memory_bytes":0,"sandbox":true,"memory_step":0,"disk_bytes":0}
 *      and, where it may find that it is better done in parts, "split":{"parts":0,"paths":1e9}: in how many, or of how
 *      much each; or, of a part, "part":{"first":100,"count":50,"done":7}: its pictures, of which so many are done
 *   {"kind":"evaluate", as a render's, without files and with "scene" as a reconstruction's}
 *   {"kind":"check","scene_id":"…","reading":{…},"thread_count":4,"memory_bytes":0,"photograph_memory_bytes":0,
 *    "keep_free_bytes":671088640,"sandbox":true}
 *   {"kind":"deliver","url":"https://…","secret":"…","body":"…","message_id":"msg_7",
 *    "allow_private":false,"sandbox":true}
 *
 * A check's folder is the scene's: it reads DIR/archive and leaves DIR/files/. "scene", "outputs" and "files" are set
 * by the executor (server/job/run.h), which knows where they lie. */
#ifndef UNBAKE_WORKER_ORDER_H
#define UNBAKE_WORKER_ORDER_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/json.h"

struct denoiser; /* relight/denoise.h */

struct order {
    cJSON *json; /* the file; owns the strings */
    const char *dir;
    const char *kind, *scene_id;
    int thread_count;
    uint64_t memory_bytes;            /* 0: no limit */
    uint64_t photograph_memory_bytes; /* of it for pixels of photographs; 0: pixel_memory.h says */
    int memory_step;                  /* how often it has run out of memory */
    uint64_t keep_free_bytes;         /* space of the disk that pixels leave free */
    uint64_t disk_bytes;              /* that it may take of the disk; 0: what is free */
    bool sandbox;
    const cJSON *reading; /* how to read the scene (common/reading.h); NULL: as its files say */
    /* kinds "render" and "evaluate" */
    const char *outputs; /* folder with the outputs of a reconstruction */
    const char *files;   /* folder of files that settings name */
    bool may_split;
    int split_parts;                             /* 0: by split_paths */
    double split_paths;                          /* pixels times samples of a part; 0: it is not split of itself */
    uint64_t first_view, view_count, views_done; /* of a part; view_count 0: of none */
    struct denoiser *denoiser;                   /* opened before the sandbox; NULL: none; the worker's */
    /* kinds "reconstruct" and "evaluate" */
    const char *scene; /* folder of the unpacked bundle */
    /* all kinds of jobs */
    const char *name;      /* of the job, for the report's title; may be "" */
    const char *reduced;   /* what was reduced after running out of memory; may be "" */
    const cJSON *settings; /* object */
    int64_t job_id;
    int attempt;
    double checkpoint_interval_sec;
    bool parts; /* checkpoints leave parts for another machine (checkpoint_parts.h) */
    /* kind "deliver" */
    const char *url, *secret, *body, *message_id;
    bool allow_private;
};

/* Reads DIR/job.json; `dir` is borrowed. STATUS_INTERNAL if it is malformed: the daemon wrote it. *order needs
 * order_release in any case. */
enum status order_read(struct order *order, const char *dir, struct error *err);
void order_release(struct order *order);

#endif
