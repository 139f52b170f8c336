/* attempt.c -- see attempt.h. */
#include "server/job/attempt.h"

#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/job/admission.h"
#include "server/job/housekeeping.h"
#include "server/job/orders.h"
#include "server/job/scene_fit.h"

#define EVENTS_MAX 500000      /* of one attempt: three days at 2 a second, which is a lot */
#define CHECK_LIMIT_SEC 3600.0 /* a scene's check that takes longer is considered stuck */

/* The folder with all outputs of the job's source, relative to the data folder; the caller's. */
static enum status find_outputs(struct store *store, int64_t source, char **folder, struct error *err) {
    struct output_row row = {0};
    *folder = NULL;
    enum status status = store_source_check_readable(store, source, err);
    if (status == STATUS_OK)
        status = store_output_get(store, source, OUTPUT_MESH, &row, err);
    if (status == STATUS_OK) {
        char *dir = layout_attempt(NULL, source, row.attempt);
        *folder = layout_out(dir);
        mem_free(dir);
    }
    output_row_release(&row);
    /* What it reads has gone, or is no longer as it was when the job was submitted: a retry would not help. */
    if (status == STATUS_CONFLICT && err)
        status = err->status = STATUS_INPUT;
    return status;
}

/* Prepares the attempt's folder. What another kind than a reconstruction has finished is its checkpoint: `anew` begins
 * without. A part leaves that where it is. */
static enum status prepare_folder(const struct attempt *a, const struct scheduler_config *config, const struct job *job,
                                  bool anew, struct error *err) {
    if (a->part.part > 0)
        return attempt_folder_begin_part(config->data_dir, job->id, a->number, err);
    enum status status = attempt_folder_begin(config->data_dir, job->id, a->number, err);
    if (status == STATUS_OK && job->kind != JOB_RECONSTRUCT && !anew)
        status = attempt_folder_carry_outputs(config->data_dir, job->id, a->number, err);
    return status;
}

/* Prepares the attempt's folder and starts its run. */
static enum status run_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                           const struct job *job, const struct scene_row *row, bool anew, struct error *err) {
    cJSON *order = NULL;
    char *outputs = NULL, *files = job->kind == JOB_RENDER ? layout_job_files(NULL, job->id) : NULL;
    const struct job_work todo = {job, row, &a->part, a->number, a->thread_count};
    enum status status = orders_of_job(&todo, config, store, &order, err);
    if (status == STATUS_OK && job->source_id)
        status = find_outputs(store, job->source_id, &outputs, err);
    const struct admission foretold = {.worker_limit_bytes = config->worker_memory_bytes};
    double need = 0.0;
    if (status == STATUS_OK)
        status = admission_foretell(&foretold, store, job, &need, err);
    if (status == STATUS_OK)
        status = prepare_folder(a, config, job, anew, err);
    char *folder = layout_attempt(NULL, job->id, a->number), *home = layout_job(NULL, job->id),
         *log = layout_log(a->part.part > 0 ? folder : home);
    const struct run_work work = {.folder = folder,
                                  .log = log,
                                  .scene_id = job->kind == JOB_RENDER ? NULL : job->scene_id,
                                  .outputs = outputs,
                                  .files = files,
                                  .order = order,
                                  .job_id = job->id,
                                  .attempt = a->number,
                                  .memory_bytes = need};
    if (status == STATUS_OK)
        status = config->executor->start(config->executor, &work, &a->run, err);
    cJSON_Delete(order);
    mem_free(log);
    mem_free(home);
    mem_free(folder);
    mem_free(outputs);
    mem_free(files);
    return status;
}

void attempt_empty(struct attempt *a) {
    run_free(a->run);
    mem_free(a->dir);
    mem_free(a->whole_dir);
    mem_free(a->end_message);
    mem_free(a->end_hint);
    mem_free(a->settings);
    mem_free(a->reading);
    cJSON_Delete(a->plan);
    cJSON_Delete(a->problems);
    cJSON_Delete(a->facts);
    cJSON_Delete(a->untaken);
    cJSON_Delete(a->late_progress);
    *a = (struct attempt){0};
}

/* Whether the job accepts a scene whose mesh and photographs do not fit. */
static bool ignores_fit(const char *settings) {
    cJSON *given = cJSON_Parse(settings);
    const char *word = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(given, "fit"));
    bool ignores = word && strcmp(word, "ignore") == 0;
    cJSON_Delete(given);
    return ignores;
}

/* A job whose scene was rejected, or does not fit, is started only to fail, so that its user is told. *row is the
 * caller's in any case. A render reads no scene. */
static enum status check_scene(struct store *store, const struct job *job, struct scene_row *row, struct error *err) {
    const char *scene_id = job->scene_id;
    if (job->kind == JOB_RENDER)
        return STATUS_OK;
    enum status status = store_scene_get(store, scene_id, row, err);
    if (status == STATUS_OK && row->state != SCENE_READY) {
        cJSON *problems = cJSON_Parse(row->problems);
        const char *first =
            cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(problems, 0), "reason"));
        error_set(err, STATUS_INPUT, "the scene %.12s was rejected%s%.300s", scene_id, first ? ": " : "",
                  first ? first : "");
        status = error_hint(err, "`unbake scenes show %.12s`, or GET /v1/scenes/%.12s, lists its problems.", scene_id,
                            scene_id);
        cJSON_Delete(problems);
    } else if (status == STATUS_OK && job->kind == JOB_RECONSTRUCT && !ignores_fit(job->settings) &&
               scene_fit_check(row, NULL, err) != STATUS_OK) {
        status = err->status = STATUS_INPUT;
    }
    return status;
}

/* Carries out a retry from a stage, before the process starts and therefore once. */
static enum status restart(const struct attempt *a, const struct scheduler_config *config, struct store *store,
                           const struct job *job, struct error *err) {
    bool keeps_checkpoint;
    if (!job->restart_from[0])
        return STATUS_OK;
    enum status status = STATUS_OK;
    if (job_stage_parse(job->kind, job->restart_from, &keeps_checkpoint) && !keeps_checkpoint)
        status = attempt_folder_drop_checkpoint(config->data_dir, job->id, err);
    return status == STATUS_OK ? store_job_restarted(store, job->id, a->number, err) : status;
}

/* Records that an attempt could not even start. */
static enum status enter_false_start(struct store *store, int64_t job_id, int number, const struct error *why,
                                     struct error *err) {
    switch (why->status) {
    case STATUS_INPUT:
    case STATUS_NOT_FOUND: return store_job_fail(store, job_id, number, why->message, why->hint, err);
    case STATUS_NO_SPACE:
        return store_job_block(store, job_id, number, why->message, "Free some space, then resume the job.", err);
    case STATUS_LIMIT:
        return store_job_block(
            store, job_id, number, why->message,
            "Delete jobs or scenes that you do not need, then resume the job; an administrator can raise"
            " the option user_max_mib.",
            err);
    default: { /* The machine is at fault: the job loses no attempt, and is not retried at once. */
        enum status status = store_job_stop(store, job_id, number, why->message, err);
        if (status == STATUS_OK && err)
            *err = *why;
        return status == STATUS_OK ? why->status : status;
    }
    }
}

static void name_attempt(struct attempt *a, const struct scheduler_config *config, int64_t job_id, int number) {
    *a = (struct attempt){.job_id = job_id,
                          .number = number,
                          .executor = config->executor,
                          .iteration = -1.0,
                          .event_max = config->attempt_events_max > 0 ? config->attempt_events_max : EVENTS_MAX,
                          .data_dir = config->data_dir,
                          .dir = layout_attempt(config->data_dir, job_id, number),
                          .whole_dir = layout_job(config->data_dir, job_id)};
}

static void know_job(struct attempt *a, const struct job *job, int thread_count) {
    memcpy(a->scene_id, job->scene_id, sizeof a->scene_id);
    a->owner_id = job->owner_id;
    a->kind = job->kind;
    a->settings = mem_strdup(job->settings);
    a->thread_count = thread_count;
    a->memory_step = job->memory_step;
}

enum status attempt_resume_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                               const struct attempt_key *key, struct error *err) {
    struct job job = {0};
    struct job_part part = {0};
    struct run *run = NULL;
    enum status status = store_job_get(store, key->job_id, &job, err);
    if (status == STATUS_OK)
        status = store_part_of(store, key->job_id, key->number, &part, err);
    if (status == STATUS_OK && !config->executor->resume)
        status = error_set(err, STATUS_NOT_FOUND, "no run of %s outlives its daemon", config->executor->name);
    if (status == STATUS_OK)
        status = config->executor->resume(config->executor, key->job_id, key->number, &run, err);
    if (status == STATUS_OK) {
        name_attempt(a, config, key->job_id, key->number);
        a->part = part;
        know_job(a, &job, 1);
        a->run = run;
        a->phase = ATTEMPT_ALIVE;
        a->charged_sec = run_cpu_sec(run); /* what the former daemon had not charged is given away */
        log_info("job %lld: attempt %d goes on as %s", (long long)key->job_id, key->number, run->place);
    }
    job_release(&job);
    return status;
}

enum status attempt_start_job(struct attempt *a, const struct scheduler_config *config, struct store *store,
                              struct counters *counters, int64_t job_id, int thread_count, struct error *err) {
    struct job job;
    struct scene_row scene = {0};
    struct error why = {0};
    bool anew = false;
    int number;
    enum status status = store_job_start(store, job_id, config->executor->name, &number, err);
    if (status == STATUS_CONFLICT || status == STATUS_NOT_FOUND)
        return STATUS_OK; /* meanwhile a user has paused, cancelled or deleted it */
    if (status != STATUS_OK)
        return status;
    name_attempt(a, config, job_id, number);
    status = store_job_get(store, job_id, &job, &why);
    if (status == STATUS_OK)
        status = store_part_of(store, job_id, number, &a->part, &why);
    if (status == STATUS_OK) {
        know_job(a, &job, thread_count);
        anew = job.restart_from[0] != '\0';
        if (number == 1 && job.started_ms > job.created_ms)
            atomic_fetch_add(&counters->first_wait_ms, (unsigned long long)(job.started_ms - job.created_ms));
        atomic_fetch_add(&counters->first_start_count, number == 1);
        status = check_scene(store, &job, &scene, &why);
    }
    if (status == STATUS_OK) /* a full disk does not stop a job whose own files fill it */
        status = store_share_check(store, &(struct share){config->user_max_bytes, job.owner_id, NULL, job_id}, 0, &why);
    if (status == STATUS_OK)
        status = restart(a, config, store, &job, &why);
    if (status == STATUS_OK)
        status = run_job(a, config, store, &job, &scene, anew, &why);
    scene_row_release(&scene);
    job_release(&job);
    if (status == STATUS_OK) {
        a->phase = ATTEMPT_ALIVE;
        log_info("job %lld: attempt %d runs as %s with %d threads", (long long)job_id, number, a->run->place,
                 thread_count);
        return STATUS_OK;
    }
    log_warning("job %lld: attempt %d could not begin: %s", (long long)job_id, number, why.message);
    attempt_empty(a);
    return enter_false_start(store, job_id, number, &why, err);
}

enum status attempt_start_check(struct attempt *a, const struct scheduler_config *config, struct store *store,
                                const struct unchecked *scene, int thread_count, struct error *err) {
    struct error why = {0};
    struct scene_row row;
    const char *scene_id = scene->id;
    *a = (struct attempt){.owner_id = scene->owner_id,
                          .data_dir = config->data_dir,
                          .dir = layout_scene(config->data_dir, scene_id),
                          .whole_dir = layout_scene(config->data_dir, scene_id),
                          .user_max_bytes = config->user_max_bytes,
                          .problems = cJSON_CreateArray()};
    snprintf(a->scene_id, sizeof a->scene_id, "%s", scene_id);
    cJSON *order = orders_new("check", config, thread_count);
    json_add_string(order, "scene_id", scene_id);
    enum status status = store_scene_get(store, scene_id, &row, &why);
    if (status == STATUS_OK) {
        a->reading = mem_strdup(row.reading);
        json_add(order, "reading", cJSON_Parse(row.reading));
        status = file_make_dirs(a->dir, &why);
    }
    scene_row_release(&row);
    housekeeping_drop_temporary(a->dir); /* the daemon may have been killed during an earlier check */
    char *folder = layout_scene(NULL, scene_id), *log = layout_log(folder);
    const struct run_work work = {.folder = folder, .log = log, .order = order};
    if (status == STATUS_OK)
        status = config->executor->start(config->executor, &work, &a->run, &why);
    mem_free(log);
    mem_free(folder);
    cJSON_Delete(order);
    if (status == STATUS_OK) {
        a->kill_at_sec = clock_sec() + CHECK_LIMIT_SEC;
        a->phase = ATTEMPT_ALIVE;
        log_info("scene %.12s: checked by %s", scene_id, a->run->place);
        return STATUS_OK;
    }
    /* The scene stays in `checking`; the scheduler retries later. */
    attempt_empty(a);
    if (err)
        *err = why;
    return status;
}

void attempt_charge(struct attempt *a, struct store *store, struct counters *counters) {
    double used = run_cpu_sec(a->run), more = used - a->charged_sec;
    if (!a->job_id || !(more > 0.0))
        return;
    (void)store_usage_add(store, a->owner_id, more, NULL); /* a failed charge is kept for later */
    atomic_fetch_add(&counters->cpu_ms, (unsigned long long)(more * 1e3));
    a->charged_sec = used;
}
