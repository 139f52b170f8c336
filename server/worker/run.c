/* run.c -- a reconstruction inside a worker: the clocks, the checkpoint, the previews, the
 * outputs, and what is said of them.
 *
 * 1. A file is announced after it is whole under its final name and was read back, with the hash of what is there.
 * 2. Checkpoints come every checkpoint_interval_sec. Where they would take more than
 *    CHECKPOINT_SHARE of the time (a slow disk) the interval grows, at most CHECKPOINT_STRETCH
 *    times: what a crash costs stays bounded. Previews likewise, without a bound.
 * 3. A request to stop (requests.h) is heard at the work's next step, after a checkpoint. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/parallel.h"
#include "common/sha256.h"
#include "server/data/layout.h"
#include "server/export/outputs.h"
#include "server/reconstruct/reconstruct.h"
#include "server/worker/announce.h"
#include "server/worker/checkpoint.h"
#include "server/worker/checkpoint_parts.h"
#include "server/worker/load.h"
#include "server/worker/pixel_memory.h"
#include "server/worker/read_back.h"
#include "server/worker/requests.h"
#include "server/worker/results.h"
#include "server/worker/tasks.h"
#include "server/worker/working_time.h"

#define CHECKPOINT_SHARE 0.02
#define CHECKPOINT_STRETCH 5.0
#define PREVIEW_SHARE 0.05
#define PROGRESS_INTERVAL_SEC 0.25 /* minimum between two reports of progress */
#define METRIC_INTERVAL_SEC 1.0    /* minimum between values of a series */
#define SERIES_MAX 16              /* metrics of a reconstruction that are told; it has fewer */

struct worker_run {
    const struct order *order;
    struct progress *progress;
    struct checkpoint *checkpoint;
    struct spill *spill; /* of the photographs' pixels */
    uint64_t told_bytes; /* what they take of the disk, as was told last */
    char *out_dir;
    struct requests requests;
    const struct mesh *mesh; /* the mesh of the outputs */
    struct working_time worked;
    double next_checkpoint, next_preview, next_progress; /* monotonic, s */
    double preview_interval_sec;
    size_t series_count;
    struct {
        char name[32];
        double next;  /* when the next value may be sent */
        bool is_held; /* the newest value was not sent: it is sent */
        long step;    /* when the stage ends, so a curve has its last point */
        double value;
    } series[SERIES_MAX];
};

/* --- called by the engine -------------------------------------------------------------------- */

static bool stop_requested(void *user) {
    struct worker_run *run = user;
    return requests_poll(&run->requests);
}

static bool checkpoint_due(void *user) {
    const struct worker_run *run = user;
    return clock_sec() >= run->next_checkpoint;
}

static bool preview_due(void *user) {
    const struct worker_run *run = user;
    return run->requests.preview || clock_sec() >= run->next_preview;
}

/* --- messages -------------------------------------------------------------------------------- */

static void tell_held_metrics(struct worker_run *run) {
    for (size_t i = 0; i < run->series_count; i++) {
        if (run->series[i].is_held)
            progress_metric(run->progress, run->series[i].name, run->series[i].step, run->series[i].value);
        run->series[i].is_held = false;
    }
}

/* What pixels take of the disk, when that has changed. */
static void tell_space(struct worker_run *run) {
    uint64_t bytes = spill_file_bytes(run->spill);
    if (bytes != run->told_bytes)
        progress_space(run->progress, bytes);
    run->told_bytes = bytes;
}

static void tell_stage(void *user, const char *stage) {
    struct worker_run *run = user;
    tell_space(run);
    tell_held_metrics(run);
    progress_stage(run->progress, stage);
    run->next_progress = 0.0; /* send the new stage's remaining time at once */
}

static void tell_progress(void *user, const char *stage, double done, double total, double eta_sec) {
    struct worker_run *run = user;
    double now = clock_sec();
    if (now < run->next_progress && done < total)
        return;
    run->next_progress = now + PROGRESS_INTERVAL_SEC;
    tell_space(run);
    progress_step(run->progress, stage, done, total, eta_sec);
}

static void tell_metric(void *user, const char *series, long step, double value) {
    struct worker_run *run = user;
    double now = clock_sec();
    size_t i = 0;
    while (i < run->series_count && strcmp(run->series[i].name, series) != 0)
        i++;
    if (i == SERIES_MAX || strlen(series) >= sizeof run->series[0].name)
        return;
    if (i == run->series_count) {
        strcpy(run->series[i].name, series);
        run->series_count++;
    }
    run->series[i].is_held = now < run->series[i].next;
    run->series[i].step = step;
    run->series[i].value = value;
    if (run->series[i].is_held)
        return;
    run->series[i].next = now + METRIC_INTERVAL_SEC;
    progress_metric(run->progress, series, step, value);
}

static void tell_log(void *user, const char *message) {
    const struct worker_run *run = user;
    progress_log(run->progress, "info", message);
}

static void tell_warning(void *user, const char *message) {
    const struct worker_run *run = user;
    progress_log(run->progress, "warning", message);
}

static double worked_sec(void *user) {
    struct worker_run *run = user;
    return working_time_sec(&run->worked);
}

/* --- checkpoints ----------------------------------------------------------------------------- */

static enum status save_checkpoint(void *user, long iteration, const struct state_array *array, size_t count,
                                   struct error *err) {
    struct worker_run *run = user;
    struct checkpoint_cost cost;
    struct written_part part;
    double start = clock_sec();
    enum status status = checkpoint_save(run->checkpoint, iteration, array, count, &cost, err);
    if (status == STATUS_OK)
        status = checkpoint_write_part(run->checkpoint, array, count, run->requests.stop, &part, err);
    if (status != STATUS_OK)
        return status;
    if (part.number > 0)
        progress_part(run->progress, part.number, part.first, part.bytes);
    cost.seconds = clock_sec() - start;
    double interval = run->order->checkpoint_interval_sec;
    double wait = fmin(fmax(cost.seconds / CHECKPOINT_SHARE, interval), interval * CHECKPOINT_STRETCH);
    run->next_checkpoint = clock_sec() + wait;
    progress_checkpoint(run->progress, iteration, cost.written_bytes, cost.seconds);
    return STATUS_OK;
}

/* A checkpoint with an unsuitable format or surface is ignored: its work is lost, the job is not. */
static enum status load_checkpoint(void *user, struct state_array *array, size_t count, bool *found,
                                   struct error *err) {
    struct worker_run *run = user;
    long iteration;
    char note[512];
    enum status status = checkpoint_load(run->checkpoint, array, count, found, &iteration, err);
    if (status == STATUS_OK && *checkpoint_note(run->checkpoint))
        progress_log(run->progress, "info", checkpoint_note(run->checkpoint));
    if (status != STATUS_CORRUPT)
        return status;
    snprintf(note, sizeof note, "the checkpoint cannot be used: %.300s; starting from the beginning", err->message);
    progress_log(run->progress, "warning", note);
    *found = false;
    return checkpoint_clear(run->checkpoint, err);
}

/* Identifies what the state depends on. Uses the settings as given: defaults belong to the program's version.
 * Excludes how long the work goes on (a job may be extended) and how much an iteration does (reduced after running
 * out of memory). */
static char *fingerprint_of(const struct order *order) {
    char hex[SHA256_HEX_SIZE];
    static const char *const apart[] = {
        "iterations", "time_limit_sec", "refine_looks", "texels_per_iteration", "listing1_looks", "fit", "executor"};
    cJSON *kept = cJSON_Duplicate(order->settings, true);
    for (size_t i = 0; i < sizeof apart / sizeof *apart; i++)
        cJSON_DeleteItemFromObjectCaseSensitive(kept, apart[i]);
    char *settings = json_text(kept);
    cJSON_Delete(kept);
    sha256_of(settings, strlen(settings), hex);
    mem_free(settings);
    if (order->reading && order->reading->child) { /* another reading is another scene */
        char *reading = json_text(order->reading), *text;
        text = mem_printf("scene %s settings %s reading %s", order->scene_id, hex, reading);
        mem_free(reading);
        return text;
    }
    return mem_printf("scene %s settings %s", order->scene_id, hex);
}

/* --- files ------------------------------------------------------------------------------------ */

static enum status announce(void *user, const char *type, const char *name, const char *content_type,
                            struct error *err) {
    struct worker_run *run = user;
    char *path = file_join(run->out_dir, name);
    enum status status = read_back(path, name, run->mesh, err);
    if (status == STATUS_OK)
        status = announce_file(run->progress, type, path, name, content_type, NULL, err);
    mem_free(path);
    return status;
}

static const char *title_of(const struct worker_run *run) { return *run->order->name ? run->order->name : "unbake"; }

static enum status write_preview(void *user, const struct reconstruction *r, struct error *err) {
    struct worker_run *run = user;
    double start = clock_sec();
    struct export_input input = results_so_far(r, title_of(run));
    run->mesh = input.mesh;
    enum status status = export_preview(run->out_dir, &input, announce, run, err);
    double end = clock_sec(), wait = (end - start) / PREVIEW_SHARE;
    if (wait < run->preview_interval_sec)
        wait = run->preview_interval_sec;
    run->next_preview = end + wait;
    run->requests.preview = false;
    return status;
}

static enum status write_outputs(struct worker_run *run, const struct reconstruction *r, struct error *err) {
    struct export_input input;
    results_make(&input, r, title_of(run));
    run->mesh = input.mesh;
    tell_stage(run, "export");
    tell_progress(run, "export", 0.0, 1.0, plan_left_sec(&r->plan));
    enum status status = export_outputs(run->out_dir, &input, announce, run, err);
    mem_free((void *)input.comparison);
    mem_free((void *)input.camera);
    return status;
}

/* --- the whole ---------------------------------------------------------------------------------- */

static enum status open_checkpoint(struct worker_run *run, struct error *err) {
    char note[512];
    char *folder = layout_checkpoint_folder(run->order->dir), *path = layout_checkpoint(run->order->dir);
    char *fingerprint = fingerprint_of(run->order);
    enum status status = file_make_dirs(folder, err);
    if (status == STATUS_OK)
        status = checkpoint_open(&run->checkpoint, path, fingerprint, note, err);
    if (status == STATUS_OK && note[0])
        progress_log(run->progress, "warning", note);
    if (status == STATUS_OK && run->order->parts)
        checkpoint_send_parts(run->checkpoint);
    mem_free(fingerprint);
    mem_free(path);
    mem_free(folder);
    return status;
}

static enum status reconstruct(struct worker_run *run, const struct settings *settings, struct parallel *pool,
                               struct error *err) {
    struct scene scene = {0};
    struct reconstruction r = {0};
    const struct reconstruct_hooks hooks = {
        .user = run,
        .stop_requested = stop_requested,
        .stage = tell_stage,
        .progress = tell_progress,
        .metric = tell_metric,
        .log = tell_log,
        .warning = tell_warning,
        .worked_sec = worked_sec,
        .checkpoint_due = checkpoint_due,
        .preview_due = preview_due,
        .checkpoint_save = save_checkpoint,
        .checkpoint_load = load_checkpoint,
        .preview = write_preview,
    };
    tell_stage(run, "load");
    enum status status = load_scene(run->order, run->progress, run->spill, settings, pool, &scene, err);
    if (status != STATUS_OK) {
        scene_release(&scene);
        return status;
    }
    double now = clock_sec();
    run->next_checkpoint = now + run->order->checkpoint_interval_sec;
    run->next_preview = now; /* an early preview shows that something happens */
    if (run->order->reduced[0])
        progress_log(run->progress, "warning", run->order->reduced);
    status = stop_requested(run) ? error_set(err, STATUS_CANCELLED, "stopped after stage load")
                                 : reconstruct_run(&scene, settings, pool, &hooks, &r, err);
    if (status == STATUS_OK && run->order->reduced[0])
        json_add_string(r.report, "reduced_after_out_of_memory", run->order->reduced);
    if (status == STATUS_OK)
        status = write_outputs(run, &r, err);
    if (status == STATUS_OK)
        snprintf(run->progress->remark, sizeof run->progress->remark, "%s", r.left_out);
    reconstruct_release(&r);
    scene_release(&scene);
    return status;
}

enum status task_reconstruct(const struct order *order, struct progress *progress, struct error *err) {
    struct worker_run run = {.order = order, .progress = progress};
    struct settings settings;
    requests_init(&run.requests, progress->fd); /* before the pool's threads */
    settings_init(&settings);
    run.out_dir = layout_out(order->dir);
    struct parallel *pool = NULL;
    enum status status = settings_apply(&settings, order->settings, NULL, err);
    if (status == STATUS_OK)
        status = file_make_dirs(run.out_dir, err);
    if (status == STATUS_OK)
        status = open_checkpoint(&run, err);
    if (status == STATUS_OK) {
        run.preview_interval_sec = settings_number(&settings, "preview_interval_sec");
        pool = parallel_new(order->thread_count);
        run.spill = pixel_memory_new(order);
        working_time_init(&run.worked, parallel_thread_count(pool));
        status = reconstruct(&run, &settings, pool, err);
    }
    spill_free(run.spill);
    parallel_free(pool);
    checkpoint_close(run.checkpoint);
    settings_release(&settings);
    mem_free(run.out_dir);
    return status;
}
