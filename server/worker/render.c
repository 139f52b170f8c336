/* render.c -- a render inside a worker: what the engine (relight/relight.h) finishes is announced, a request to stop is
 * passed on.
 *
 * 1. What is finished is the checkpoint: an attempt begins with the views that earlier ones have finished in its out/
 *    (data/attempt_folder.h), and the engine keeps those that are whole. A crash costs one view.
 * 2. A view is announced when it is whole under its final name. Those that the engine has kept are announced at the end:
 *    an attempt that died between a view's end and its announcement has told nobody of it. So is the engine's record of
 *    what is done, which grows until then.
 * 3. The preview of the picture that is being rendered has one name, and is replaced by that of the next.
 * 4. Where the user's share of the disk is used up the work stops, and goes on when there is more. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "common/protocol.h"
#include "server/data/layout.h"
#include "server/relight/denoise.h"
#include "server/relight/relight.h"
#include "server/worker/announce.h"
#include "server/worker/requests.h"
#include "server/worker/tasks.h"

#define STAGE "render"
#define PREVIEWS "preview" /* folder of out/ */
#define PREVIEW PREVIEWS "/render.png"
#define PROGRESS_INTERVAL_SEC 0.25
#define MIB 1048576.0

struct render_run {
    const struct order *order;
    struct progress *progress;
    struct requests requests;
    char *out_dir;
    char **told; /* [told_count] names of the outputs that were announced; owned */
    size_t told_count;
    uint64_t bytes;                  /* of them */
    double begun_sec, next_progress; /* as clock_sec */
    double done_before;              /* when the first view began: what was kept costs no time; negative: not yet */
    enum status status;              /* of the announcements */
    struct error error;
};

/* --- called by the engine -------------------------------------------------------------------- */

static bool over_share(const struct render_run *run) {
    return run->order->disk_bytes > 0 && run->bytes > run->order->disk_bytes;
}

static void announce(struct render_run *run, const char *type, const char *name) {
    uint64_t bytes = 0;
    char *path = file_join(run->out_dir, name);
    if (run->status == STATUS_OK)
        run->status = announce_file(run->progress, type, path, name, announce_content_type(name), &bytes, &run->error);
    mem_free(path);
    if (run->status != STATUS_OK || strcmp(type, EVENT_OUTPUT) != 0)
        return;
    run->bytes += bytes;
    run->told = mem_realloc_array(run->told, run->told_count + 1, sizeof *run->told);
    run->told[run->told_count++] = mem_strdup(name);
}

static bool should_stop(void *user) {
    struct render_run *run = user;
    return requests_look(&run->requests) || run->status != STATUS_OK || over_share(run);
}

static void tell_progress(void *user, double done, double total) {
    struct render_run *run = user;
    double now = clock_sec(), eta = -1.0;
    if (run->done_before < 0.0)
        run->done_before = done;
    if (now < run->next_progress && done < total)
        return;
    run->next_progress = now + PROGRESS_INTERVAL_SEC;
    if (done > run->done_before)
        eta = (now - run->begun_sec) * (total - done) / (done - run->done_before);
    progress_step(run->progress, STAGE, done, total, eta);
}

static void tell_file(void *user, const char *name) {
    struct render_run *run = user;
    announce(run, EVENT_OUTPUT, name);
}

static void tell_preview(void *user, const char *name) {
    struct render_run *run = user;
    char *from = file_join(run->out_dir, name), *to = file_join(run->out_dir, PREVIEW);
    if (rename(from, to) == 0)
        announce(run, EVENT_PREVIEW, PREVIEW);
    mem_free(to);
    mem_free(from);
}

static void tell_message(void *user, const char *text) {
    const struct render_run *run = user;
    progress_log(run->progress, "info", text);
}

/* --- what was kept --------------------------------------------------------------------------- */

static int by_name(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

/* Announces the files below `folder` of out/ ("": out/ itself) that are not among told[sorted_count], which is sorted. */
static enum status tell_kept(struct render_run *run, const char *folder, size_t sorted_count, struct error *err) {
    char *path = *folder ? file_join(run->out_dir, folder) : mem_strdup(run->out_dir), **names = NULL;
    size_t count = 0;
    enum status status = file_list(path, &names, &count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct stat info;
        char *name = *folder ? file_join(folder, names[i]) : mem_strdup(names[i]), *full = file_join(path, names[i]);
        bool is_there = lstat(full, &info) == 0;
        if (is_there && S_ISDIR(info.st_mode) && strcmp(name, PREVIEWS) != 0)
            status = tell_kept(run, name, sorted_count, err);
        else if (is_there && S_ISREG(info.st_mode) &&
                 !bsearch(&name, run->told, sorted_count, sizeof *run->told, by_name))
            tell_file(run, name);
        mem_free(full);
        mem_free(name);
    }
    file_free_names(names, count);
    mem_free(path);
    return status;
}

/* --- the whole ------------------------------------------------------------------------------- */

static enum status render(struct render_run *run, struct parallel *pool, struct error *err) {
    const struct order *order = run->order;
    const struct relight_job job = {.outputs = order->outputs,
                                    .files = order->files,
                                    .settings = order->settings,
                                    .out = run->out_dir,
                                    .denoiser = order->denoiser};
    const struct relight_watch watch = {.user = run,
                                        .should_stop = should_stop,
                                        .progress = tell_progress,
                                        .file = tell_file,
                                        .preview = tell_preview,
                                        .message = tell_message};
    enum status status = relight_run(&job, &watch, pool, err);
    size_t sorted_count = run->told_count;
    if (sorted_count > 0)
        qsort(run->told, sorted_count, sizeof *run->told, by_name);
    if (status == STATUS_OK)
        status = tell_kept(run, "", sorted_count, err);
    if (run->status != STATUS_OK) {
        if (err)
            *err = run->error;
        return run->status;
    }
    if (status == STATUS_CANCELLED && over_share(run) && !run->requests.stop)
        return error_set(err, STATUS_NO_SPACE, "your share of the disk is used up: %.1f MiB of pictures are done",
                         (double)run->bytes / MIB);
    return status;
}

enum status task_render(const struct order *order, struct progress *progress, struct error *err) {
    struct render_run run = {.order = order, .progress = progress, .begun_sec = clock_sec(), .done_before = -1.0};
    requests_init(&run.requests, progress->fd); /* before the pool's threads */
    run.out_dir = layout_out(order->dir);
    struct parallel *pool = parallel_new(order->thread_count);
    progress_stage(progress, STAGE);
    enum status status = file_make_dirs(run.out_dir, err);
    if (status == STATUS_OK)
        status = render(&run, pool, err);
    parallel_free(pool);
    for (size_t i = 0; i < run.told_count; i++)
        mem_free(run.told[i]);
    mem_free(run.told);
    mem_free(run.out_dir);
    return status;
}
