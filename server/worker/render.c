/* render.c -- a render inside a worker: what the engine (relight/relight.h) finishes is announced, a request to stop is
 * passed on.
 *
 * 1. What is finished is the checkpoint: an attempt begins with the views that earlier ones have finished in its out/
 *    (data/attempt_folder.h), and the engine keeps those that are whole. A crash costs one view.
 * 2. A view is announced when it is whole under its final name. Those that the engine has kept are announced at the
 *    end: an attempt that died between a view's end and its announcement has told nobody of it. So is the engine's
 *    record of what is done, which grows until then.
 * 3. The preview of the picture that is being rendered has one name, and is replaced by that of the next.
 * 4. A render that is large enough may end before its first picture by saying in which parts it is better done; a part
 *    renders its own pictures, after those that are done, and says how many of all of its own there are. For another
 *    machine the record is told of as it grows, so that what is done counts there even if the rest is lost.
 * 5. Where the user's share of the disk is used up the work stops, and goes on when there is more. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/parallel.h"
#include "common/protocol.h"
#include "common/sha256.h"
#include "server/data/layout.h"
#include "server/relight/relight.h"
#include "server/relight/relight_plan.h"
#include "server/store/parts.h"
#include "server/worker/announce.h"
#include "server/worker/requests.h"
#include "server/worker/tasks.h"

#define STAGE "render"
#define PREVIEWS "preview" /* folder of out/ */
#define PREVIEW PREVIEWS "/render.png"
#define PROGRESS_INTERVAL_SEC 0.25 /* between two reports of progress, at least */
#define RECORD_INTERVAL_SEC 2.0    /* between two words of the record: a part's has some 100 lines */
#define MIB 1048576.0              /* bytes */

/* A file of an earlier attempt whose hash the engine has just found to be right: it is not read again. */
struct kept_file {
    char *name; /* owned */
    char sha256[SHA256_HEX_SIZE];
};

struct render_run {
    const struct order *order;
    struct progress *progress;
    struct requests requests;
    char *out_dir;
    char **told; /* [told_count] names of the outputs that were announced; owned */
    size_t told_count;
    struct kept_file *kept; /* [kept_count] those that are announced at the end; owned */
    size_t kept_count;
    uint64_t bytes;                  /* of them */
    double begun_sec, next_progress; /* as clock_sec */
    double next_record;
    double done_before; /* when the first view began: what was kept costs no time; negative: not yet */
    enum status status; /* of the announcements */
    struct error error;
};

/* --- called by the engine -------------------------------------------------------------------- */

static bool over_share(const struct render_run *run) {
    return run->order->disk_bytes > 0 && run->bytes > run->order->disk_bytes;
}

/* sha256: NULL where it is not known. */
static void announce(struct render_run *run, const char *type, const char *name, const char *sha256) {
    uint64_t bytes = 0;
    const char *content = announce_content_type(name);
    char *path = file_join(run->out_dir, name);
    if (run->status == STATUS_OK && sha256)
        run->status = announce_known(run->progress, type, path, name, content, sha256, &bytes, &run->error);
    else if (run->status == STATUS_OK)
        run->status = announce_file(run->progress, type, path, name, content, &bytes, &run->error);
    mem_free(path);
    if (run->status != STATUS_OK || strcmp(type, EVENT_OUTPUT) != 0)
        return;
    run->bytes += bytes;
    run->told = mem_realloc_array(run->told, run->told_count + 1, sizeof *run->told);
    run->told[run->told_count++] = mem_strdup(name);
}

static bool should_stop(void *user) {
    struct render_run *run = user;
    return requests_poll(&run->requests) || run->status != STATUS_OK || over_share(run);
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
    double before = (double)run->order->views_done;
    progress_step(run->progress, STAGE, before + done, before + total, eta);
}

/* The record has a line for every picture but the one that is being announced. */
static void tell_record(struct render_run *run) {
    char hex[SHA256_HEX_SIZE], *path = file_join(run->out_dir, OUTPUT_RECORD);
    double now = clock_sec();
    if (run->order->parts && now >= run->next_record && sha256_of_file(path, hex, NULL) == STATUS_OK) {
        run->next_record = now + RECORD_INTERVAL_SEC;
        progress_record(run->progress, OUTPUT_RECORD, hex);
    }
    mem_free(path);
}

static void tell_file(void *user, const char *name, const char *sha256) {
    struct render_run *run = user;
    tell_record(run);
    announce(run, EVENT_OUTPUT, name, sha256);
}

static void note_kept(void *user, const char *name, const char *sha256) {
    struct render_run *run = user;
    run->kept = mem_realloc_array(run->kept, run->kept_count + 1, sizeof *run->kept);
    struct kept_file *file = &run->kept[run->kept_count++];
    file->name = mem_strdup(name);
    snprintf(file->sha256, sizeof file->sha256, "%s", sha256);
}

static void tell_preview(void *user, const char *name) {
    struct render_run *run = user;
    char *from = file_join(run->out_dir, name), *to = file_join(run->out_dir, PREVIEW);
    if (rename(from, to) == 0)
        announce(run, EVENT_PREVIEW, PREVIEW, NULL);
    mem_free(to);
    mem_free(from);
}

static void tell_message(void *user, const char *text) {
    const struct render_run *run = user;
    progress_log(run->progress, "info", text);
}

/* --- what was kept --------------------------------------------------------------------------- */

static int by_name(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

static int by_kept_name(const void *a, const void *b) {
    return strcmp(((const struct kept_file *)a)->name, ((const struct kept_file *)b)->name);
}

/* NULL: it is no kept picture's. kept[] is sorted. */
static const char *kept_sha256(const struct render_run *run, char *name) {
    const struct kept_file key = {.name = name}, *found = NULL;
    if (run->kept_count > 0)
        found = bsearch(&key, run->kept, run->kept_count, sizeof *run->kept, by_kept_name);
    return found ? found->sha256 : NULL;
}

/* Announces the files below `folder` of out/ ("": out/ itself) that are not among told[sorted_count], which is
 * sorted. */
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
                 (sorted_count == 0 || !bsearch(&name, run->told, sorted_count, sizeof *run->told, by_name)))
            tell_file(run, name, kept_sha256(run, name));
        mem_free(full);
        mem_free(name);
    }
    file_free_names(names, count);
    mem_free(path);
    return status;
}

/* --- the whole ------------------------------------------------------------------------------- */

static struct relight_job job_of(const struct render_run *run) {
    const struct order *order = run->order;
    return (struct relight_job){.outputs = order->outputs,
                                .files = order->files,
                                .settings = order->settings,
                                .out = run->out_dir,
                                .first_view = order->first_view + order->views_done,
                                .view_count = order->view_count - order->views_done,
                                .denoiser = order->denoiser};
}

/* In how many parts it is better done; 1: as it is. */
static int count_parts(const struct order *order, const struct relight_plan *plan) {
    double parts = order->split_parts > 0     ? order->split_parts
                   : order->split_paths > 0.0 ? floor(plan->paths / order->split_paths)
                                              : 1.0;
    return (int)fmax(1.0, fmin(fmin(parts, JOB_PARTS_MAX), (double)plan->pictures));
}

/* Whether the render has ended by saying that it is better done in parts. */
static bool split(const struct render_run *run) {
    const struct relight_job job = job_of(run);
    struct relight_plan plan;
    /* what is wrong with its cameras, the render itself will say */
    if (!run->order->may_split || relight_plan_make(&job, &plan, NULL) != STATUS_OK)
        return false;
    int parts = plan.pictures > PICTURES_MAX ? 1 : count_parts(run->order, &plan);
    if (parts > 1)
        progress_plan(run->progress, plan.pictures, parts, plan.digest);
    return parts > 1;
}

static enum status render(struct render_run *run, struct parallel *pool, struct error *err) {
    const struct relight_job job = job_of(run);
    const struct relight_watch watch = {.user = run,
                                        .should_stop = should_stop,
                                        .progress = tell_progress,
                                        .file = tell_file,
                                        .kept = note_kept,
                                        .preview = tell_preview,
                                        .message = tell_message};
    enum status status = relight_run(&job, &watch, pool, err);
    size_t sorted_count = run->told_count;
    if (sorted_count > 0)
        qsort(run->told, sorted_count, sizeof *run->told, by_name);
    if (run->kept_count > 0)
        qsort(run->kept, run->kept_count, sizeof *run->kept, by_kept_name);
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
    if (status == STATUS_OK && !split(&run))
        status = render(&run, pool, err);
    parallel_free(pool);
    for (size_t i = 0; i < run.told_count; i++)
        mem_free(run.told[i]);
    mem_free(run.told);
    for (size_t i = 0; i < run.kept_count; i++)
        mem_free(run.kept[i].name);
    mem_free(run.kept);
    mem_free(run.out_dir);
    return status;
}
