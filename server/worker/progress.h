/* progress.h -- the lines that a worker writes to its pipe, one JSON object each.
 *
 *   {"type":"stage","stage":"refine"}
 *   {"type":"progress","stage":"refine","done":120,"total":1000,"eta_sec":33.5}
 *   {"type":"metric","series":"loss","step":120,"value":0.0123}
 *   {"type":"preview","name":"preview/base_color.png", ...as output}
 *   {"type":"output","name":"base_color.exr","bytes":123,"sha256":"…","content_type":"image/x-exr"}
 *   {"type":"log","level":"info","message":"…"}
 *   {"type":"checkpoint","iteration":120,"bytes":…,"seconds":…}
 *   {"type":"part","number":7,"first":3,"bytes":…}   of a checkpoint, for another machine: only a node is told
 *   {"type":"record","name":"views.jsonl","sha256":"…"}   of what is done, which has grown: only a node is told
 *   {"type":"plan","pictures":500,"parts":8,"digest":"…"}   a render that is better done in parts (store/parts.h); it
 *   ends
 *   {"type":"space","bytes":…}   what it takes of the disk besides the files in its folder
 *   {"type":"problem","file":"images/003.png","reason":"…","hint":"…"}   (scene checks)
 *   {"type":"scene","facts":{"triangle_count":…,"frame_count":…,…}}  (scene checks: what is known by now, at last all
 *   of it) {"type":"end","status":"ok|input|no-space|…","message":"…","hint":"…"}
 *
 * A line is at most PROGRESS_LINE_MAX bytes. Signals go the other way: SIGTERM checkpoint and
 * stop (exit PROGRESS_EXIT_STOPPED); SIGUSR1 write a preview now; SIGKILL cancel. An output or preview
 * is announced only after its file is complete under its final name in JOBDIR/out/. */
#ifndef UNBAKE_WORKER_PROGRESS_H
#define UNBAKE_WORKER_PROGRESS_H

#include "common/error.h"
#include "common/json.h"

#define PROGRESS_LINE_MAX 65536 /* bytes of a line */
#define PROGRESS_FD 3           /* the worker's end of the pipe */

/* Exit statuses of a worker. */
enum progress_exit {
    PROGRESS_EXIT_OK = 0,
    PROGRESS_EXIT_FAILED = 1,    /* its "end" line says why */
    PROGRESS_EXIT_INPUT = 65,    /* the input is at fault: a retry would not help */
    PROGRESS_EXIT_MEMORY = 71,   /* MEM_EXIT_STATUS */
    PROGRESS_EXIT_NO_SPACE = 74, /* the disk is full: pause the job */
    PROGRESS_EXIT_STOPPED = 85   /* asked to stop; a checkpoint was saved */
};

/* The worker's side. Errors are ignored: a daemon that is gone is noticed elsewhere. */
struct progress {
    int fd;           /* -1: no pipe */
    char remark[512]; /* a remark for the user on a success; "": none */
};
void progress_stage(struct progress *p, const char *stage);
void progress_step(struct progress *p, const char *stage, double done, double total, double eta_sec);
void progress_metric(struct progress *p, const char *series, long step, double value);
void progress_file(struct progress *p, const char *type, const char *name, uint64_t bytes, const char *sha256,
                   const char *content_type);
void progress_log(struct progress *p, const char *level, const char *message);
void progress_checkpoint(struct progress *p, long iteration, uint64_t bytes, double seconds);
void progress_part(struct progress *p, int number, int first, uint64_t bytes);
/* "record" */
void progress_record(struct progress *p, const char *name, const char *sha256);
void progress_plan(struct progress *p, uint64_t pictures, int parts, const char *digest);
void progress_space(struct progress *p, uint64_t bytes);
/* hint may be NULL. */
void progress_problem(struct progress *p, const char *file, const char *reason, const char *hint);
void progress_scene(struct progress *p, cJSON *facts); /* takes facts */
/* After a success the message is the remark. */
void progress_end(struct progress *p, enum status status, const char *message, const char *hint);

#endif
