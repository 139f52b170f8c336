/* attempt.c -- see attempt.h. */
#include "server/job/attempt.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/job/housekeeping.h"
#include "server/job/memory.h"
#include "server/worker/progress.h"

#define EVENTS_MAX 500000   /* of one attempt: an honest one stays far below */
#define PROBLEMS_MAX 1000   /* of one scene */
#define LAST_WORDS_MAX 400  /* bytes */
#define CHECK_LIMIT_SEC 3600.0 /* a scene's check that takes longer is taken for stuck */

/* --- starting -------------------------------------------------------------------------------- */

static enum status write_order(const char *dir, cJSON *order, struct error *err) {
    char *text = json_text(order), *path = file_join(dir, "job.json");
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(text);
    mem_free(path);
    return status;
}

/* The members that both kinds of order have. */
static cJSON *new_order(const char *kind, const struct scheduler_config *config, int thread_count) {
    cJSON *order = cJSON_CreateObject();
    json_add_string(order, "kind", kind);
    json_add_int(order, "thread_count", thread_count);
    json_add_int(order, "memory_bytes", (int64_t)config->worker_memory_bytes);
    json_add_bool(order, "sandbox", config->sandbox);
    return order;
}

static char *scene_dir(const struct scheduler_config *config, const char *scene_id) {
    return mem_printf("%s/scenes/%s", config->data_dir, scene_id);
}

static enum status order_job(struct attempt *a, const struct scheduler_config *config,
                             const struct job *job, int thread_count, struct error *err) {
    cJSON *settings;
    enum status status =
        json_parse(job->settings, strlen(job->settings), "the job's settings", &settings, err);
    if (status != STATUS_OK)
        return status;
    char *out = file_join(a->dir, "out"), *scene = scene_dir(config, job->scene_id);
    char *files = file_join(scene, "files");
    struct buf reduced;
    buf_init(&reduced, 4096);
    cJSON *smaller = memory_reduce(settings, job->memory_step, &thread_count, &reduced);
    cJSON *order = new_order("reconstruct", config, thread_count);
    json_add_string(order, "scene_id", job->scene_id);
    json_add_string(order, "scene", files);
    json_add_string(order, "name", job->name);
    json_add_int(order, "job_id", job->id);
    json_add_int(order, "attempt", a->number);
    json_add_number(order, "checkpoint_interval_sec", config->checkpoint_interval_sec);
    json_add(order, "settings", smaller);
    if (reduced.length > 0)
        json_add_string(order, "reduced", buf_text(&reduced));
    status = file_make_dirs(out, err);
    if (status == STATUS_OK)
        status = write_order(a->dir, order, err);
    cJSON_Delete(order);
    cJSON_Delete(settings);
    buf_release(&reduced);
    mem_free(files);
    mem_free(scene);
    mem_free(out);
    return status;
}

static void empty(struct attempt *a) {
    supervisor_release(&a->worker);
    mem_free(a->dir);
    mem_free(a->end_message);
    mem_free(a->end_hint);
    mem_free(a->settings);
    cJSON_Delete(a->problems);
    cJSON_Delete(a->facts);
    *a = (struct attempt){.worker = {.pid_fd = -1, .pipe_fd = -1}};
}

/* A job whose scene was rejected is started only so that it fails, as its user must be told. */
static enum status check_scene(struct store *store, const char *scene_id, struct error *err) {
    struct scene_row row;
    enum status status = store_scene_get(store, scene_id, &row, err);
    if (status == STATUS_OK && row.state != SCENE_READY) {
        cJSON *problems = cJSON_Parse(row.problems);
        const char *first = cJSON_GetStringValue(
            cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(problems, 0), "reason"));
        error_set(err, STATUS_INPUT, "the scene %.12s was rejected%s%.300s", scene_id, first ? ": " : "",
                  first ? first : "");
        status = error_hint(err, "`unbake scenes show %.12s`, or GET /v1/scenes/%.12s, lists its problems.",
                            scene_id, scene_id);
        cJSON_Delete(problems);
    }
    scene_row_release(&row);
    return status;
}

/* What a retry from a stage asks for; done before the process starts, so it is done once. */
static enum status restart(struct attempt *a, struct store *store, const struct job *job,
                           struct error *err) {
    bool keeps_checkpoint;
    if (!job->restart_from[0])
        return STATUS_OK;
    enum status status = STATUS_OK;
    if (job_stage_parse(job->restart_from, &keeps_checkpoint) && !keeps_checkpoint)
        status = housekeeping_drop_checkpoint(a->dir, err);
    return status == STATUS_OK ? store_job_restarted(store, job->id, a->number, err) : status;
}

/* Enters that an attempt could not even begin. */
static enum status enter_false_start(struct store *store, int64_t job_id, int number,
                                     const struct error *why, struct error *err) {
    switch (why->status) {
    case STATUS_INPUT:
    case STATUS_NOT_FOUND:
        return store_job_fail(store, job_id, number, why->message, why->hint, err);
    case STATUS_NO_SPACE:
        return store_job_block(store, job_id, number, why->message,
                               "Free some space, then resume the job.", err);
    default: { /* the machine is at fault: it costs the job nothing, but must not be hurried */
        enum status status = store_job_stop(store, job_id, number, why->message, err);
        if (status == STATUS_OK && err)
            *err = *why;
        return status == STATUS_OK ? why->status : status;
    }
    }
}

enum status attempt_start_job(struct attempt *a, const struct scheduler_config *config,
                              struct store *store, struct figures *figures, int64_t job_id,
                              int thread_count, struct error *err) {
    struct job job;
    struct error why = {0};
    int number;
    enum status status = store_job_start(store, job_id, &number, err);
    if (status == STATUS_CONFLICT || status == STATUS_NOT_FOUND)
        return STATUS_OK; /* its user was faster: paused, cancelled, deleted */
    if (status != STATUS_OK)
        return status;
    *a = (struct attempt){.job_id = job_id, .number = number, .iteration = -1.0,
                          .worker = {.pid_fd = -1, .pipe_fd = -1},
                          .dir = mem_printf("%s/jobs/%lld", config->data_dir, (long long)job_id)};
    status = store_job_get(store, job_id, &job, &why);
    if (status == STATUS_OK) {
        memcpy(a->scene_id, job.scene_id, sizeof a->scene_id);
        a->owner_id = job.owner_id;
        if (number == 1 && job.started_ms > job.created_ms)
            atomic_fetch_add(&figures->first_wait_ms, (unsigned long long)(job.started_ms - job.created_ms));
        atomic_fetch_add(&figures->first_start_count, number == 1);
        a->settings = mem_strdup(job.settings);
        a->thread_count = thread_count;
        a->memory_step = job.memory_step;
        a->oom_kills = memory_oom_kills();
        status = check_scene(store, job.scene_id, &why);
    }
    if (status == STATUS_OK)
        status = restart(a, store, &job, &why);
    if (status == STATUS_OK)
        status = order_job(a, config, &job, thread_count, &why);
    if (status == STATUS_OK)
        status = supervisor_start(&a->worker, config->worker_binary, a->dir, &why);
    job_release(&job);
    if (status == STATUS_OK) {
        a->phase = ATTEMPT_ALIVE;
        log_info("job %lld: attempt %d runs as process %d with %d threads", (long long)job_id,
                 number, (int)a->worker.pid, thread_count);
        return STATUS_OK;
    }
    log_warning("job %lld: attempt %d could not begin: %s", (long long)job_id, number, why.message);
    empty(a);
    return enter_false_start(store, job_id, number, &why, err);
}

enum status attempt_start_check(struct attempt *a, const struct scheduler_config *config,
                                const char *scene_id, int thread_count, struct error *err) {
    struct error why = {0};
    *a = (struct attempt){.worker = {.pid_fd = -1, .pipe_fd = -1},
                          .dir = scene_dir(config, scene_id), .problems = cJSON_CreateArray()};
    snprintf(a->scene_id, sizeof a->scene_id, "%s", scene_id);
    cJSON *order = new_order("check", config, thread_count);
    json_add_string(order, "scene_id", scene_id);
    enum status status = file_make_dirs(a->dir, &why);
    housekeeping_drop_scraps(a->dir); /* the daemon may have been killed in the middle of an earlier check */
    if (status == STATUS_OK)
        status = write_order(a->dir, order, &why);
    if (status == STATUS_OK)
        status = supervisor_start(&a->worker, config->worker_binary, a->dir, &why);
    cJSON_Delete(order);
    if (status == STATUS_OK) {
        a->kill_at_sec = clock_sec() + CHECK_LIMIT_SEC;
        a->phase = ATTEMPT_ALIVE;
        log_info("scene %.12s: checked by process %d", scene_id, (int)a->worker.pid);
        return STATUS_OK;
    }
    /* It stays in `checking`: the scheduler tries again in a while. */
    empty(a);
    if (err)
        *err = why;
    return status;
}

/* --- listening ------------------------------------------------------------------------------- */

struct listener {
    struct attempt *attempt;
    struct store *store;
    struct figures *figures;
};

static void enter_event(const struct listener *l, const char *type, const cJSON *data) {
    struct attempt *a = l->attempt;
    struct error err;
    if (a->job_id == 0 || a->event_count++ >= EVENTS_MAX)
        return;
    char *text = json_text(data);
    enum status status = store_event_add(l->store, a->job_id, a->number, type, text, &err);
    mem_free(text);
    if (status != STATUS_OK && !a->complained) {
        a->complained = true; /* once: the next thousand reports would say the same */
        log_warning("job %lld: cannot record a %s event: %s", (long long)a->job_id, type,
                    err.message);
    }
}

/* The file must be there, whole, and a plain file: what is announced is served to users. */
static void enter_file(const struct listener *l, const char *type, const cJSON *line) {
    struct attempt *a = l->attempt;
    struct error err;
    const char *name, *sha256, *content_type;
    double bytes;
    if (a->job_id == 0 || a->event_count++ >= EVENTS_MAX)
        return;
    enum status status = json_string(line, "name", type, "", &name, &err);
    if (status == STATUS_OK)
        status = json_string(line, "sha256", type, "", &sha256, &err);
    if (status == STATUS_OK)
        status = json_string(line, "content_type", type, "application/octet-stream", &content_type,
                             &err);
    if (status == STATUS_OK)
        status = json_number(line, "bytes", type, -1.0, &bytes, &err);
    if (status == STATUS_OK) {
        struct stat info;
        char *path = mem_printf("%s/out/%s", a->dir, name);
        if (lstat(path, &info) != 0 || !S_ISREG(info.st_mode) || (double)info.st_size != bytes)
            status = error_set(&err, STATUS_INPUT, "%s is not a file of %.0f bytes", name, bytes);
        mem_free(path);
    }
    if (status == STATUS_OK)
        status = store_output_put(l->store, a->job_id, a->number, type, name, (uint64_t)bytes,
                                  sha256, content_type, &err);
    if (status != STATUS_OK)
        log_warning("job %lld: its worker announced a file that is not taken: %s",
                    (long long)a->job_id, err.message);
}

static void note_end(struct attempt *a, const cJSON *line) {
    const char *word, *message, *hint;
    if (json_string(line, "status", "end", "", &word, NULL) != STATUS_OK ||
        json_string(line, "message", "end", "", &message, NULL) != STATUS_OK ||
        json_string(line, "hint", "end", "", &hint, NULL) != STATUS_OK)
        return;
    for (int i = 0; i < STATUS_COUNT; i++) {
        if (strcmp(status_name((enum status)i), word) == 0) {
            a->has_end = true;
            a->end_status = (enum status)i;
        }
    }
    mem_free(a->end_message);
    mem_free(a->end_hint);
    a->end_message = mem_strdup(message);
    a->end_hint = mem_strdup(hint);
}

static void note_checkpoint(const struct listener *l, const cJSON *line) {
    double iteration, bytes, seconds;
    if (json_number(line, "iteration", "checkpoint", 0, &iteration, NULL) != STATUS_OK ||
        json_number(line, "bytes", "checkpoint", 0, &bytes, NULL) != STATUS_OK ||
        json_number(line, "seconds", "checkpoint", 0, &seconds, NULL) != STATUS_OK)
        return;
    if (bytes >= 0.0 && seconds >= 0.0 && bytes < 1e15 && seconds < 1e6) {
        atomic_fetch_add(&l->figures->checkpoint_count, 1);
        atomic_fetch_add(&l->figures->checkpoint_bytes, (unsigned long long)bytes);
        atomic_fetch_add(&l->figures->checkpoint_us, (unsigned long long)(seconds * 1e6));
    }
    cJSON *data = cJSON_CreateObject();
    char *message = mem_printf("checkpoint at iteration %.0f: %.1f MB in %.2f s", iteration,
                               bytes * 1e-6, seconds);
    json_add_string(data, "level", "info");
    json_add_string(data, "message", message);
    enter_event(l, EVENT_LOG, data);
    mem_free(message);
    cJSON_Delete(data);
}

/* How far the optimiser is: the loss comes with its iteration, `rays` is only for the figures.
 * True when the metric is none of the job's curves. */
static bool note_figures(const struct listener *l, const cJSON *line) {
    struct attempt *a = l->attempt;
    const char *series;
    double step, value;
    if (json_string(line, "series", "metric", "", &series, NULL) != STATUS_OK ||
        json_number(line, "step", "metric", 0, &step, NULL) != STATUS_OK ||
        json_number(line, "value", "metric", 0, &value, NULL) != STATUS_OK)
        return false;
    bool is_rays = strcmp(series, "rays") == 0;
    /* The first iteration that is heard of may be a resumed one: only what follows is new. */
    if (strcmp(series, "loss") == 0 && step < 1e15) {
        if (a->iteration >= 0.0 && step > a->iteration)
            atomic_fetch_add(&l->figures->iteration_count, (unsigned long long)(step - a->iteration));
        a->iteration = step;
    }
    if (is_rays && value > a->rays && value < 1e18) {
        atomic_fetch_add(&l->figures->ray_count, (unsigned long long)(value - a->rays));
        a->rays = value;
    }
    return is_rays;
}

static void hear(void *user, const char *text, size_t length) {
    const struct listener *l = user;
    struct attempt *a = l->attempt;
    cJSON *line;
    if (json_parse(text, length, "a worker's line", &line, NULL) != STATUS_OK)
        return; /* and so is a line of an unknown type */
    /* Events have their type beside their data, not in it. */
    cJSON *kept = cJSON_DetachItemFromObjectCaseSensitive(line, "type");
    const char *type = kept && kept->valuestring ? kept->valuestring : "";
    if (strcmp(type, "stage") == 0) { /* a stage begins: its progress is none */
        json_add_number(line, "done", 0.0);
        json_add_number(line, "total", 0.0);
        json_add_number(line, "eta_sec", -1.0);
    }
    if (strcmp(type, "progress") == 0 || strcmp(type, "stage") == 0)
        enter_event(l, EVENT_PROGRESS, line);
    else if (strcmp(type, "metric") == 0) {
        if (!note_figures(l, line))
            enter_event(l, EVENT_METRIC, line);
    }
    else if (strcmp(type, "log") == 0)
        enter_event(l, EVENT_LOG, line);
    else if (strcmp(type, "preview") == 0)
        enter_file(l, EVENT_PREVIEW, line);
    else if (strcmp(type, "output") == 0)
        enter_file(l, EVENT_OUTPUT, line);
    else if (strcmp(type, "checkpoint") == 0)
        note_checkpoint(l, line);
    else if (strcmp(type, "end") == 0)
        note_end(a, line);
    else if (strcmp(type, "problem") == 0 && a->problems) {
        if (cJSON_GetArraySize(a->problems) < PROBLEMS_MAX) {
            cJSON_AddItemToArray(a->problems, line);
            line = NULL;
        }
    } else if (strcmp(type, "scene") == 0) {
        cJSON_Delete(a->facts);
        a->facts = cJSON_DetachItemFromObjectCaseSensitive(line, "facts");
    }
    cJSON_Delete(kept);
    cJSON_Delete(line);
}

void attempt_listen(struct attempt *a, struct store *store, struct figures *figures) {
    struct listener listener = {.attempt = a, .store = store, .figures = figures};
    if (a->phase != ATTEMPT_ALIVE)
        return;
    supervisor_read(&a->worker, hear, &listener);
    if (supervisor_bury(&a->worker, &a->wait_status, hear, &listener))
        a->phase = ATTEMPT_ENDED;
}

/* --- the outcome -------------------------------------------------------------------------------- */

enum outcome {
    OUTCOME_OK,
    OUTCOME_INPUT,
    OUTCOME_CRASH,
    OUTCOME_MEMORY, /* a crash that a smaller working set may mend */
    OUTCOME_STOPPED,
    OUTCOME_BLOCKED
};

struct verdict {
    enum outcome outcome;
    char reason[1024], hint[256];
};

#define HINT_MEMORY "Use a smaller texture_size, or give workers more memory."

static void say(struct verdict *v, enum outcome outcome, const char *reason, const char *hint) {
    v->outcome = outcome;
    snprintf(v->reason, sizeof v->reason, "%s", reason);
    snprintf(v->hint, sizeof v->hint, "%s", hint ? hint : "");
}

static void judge_signal(const struct attempt *a, struct verdict *v) {
    int number = WTERMSIG(a->wait_status);
    char text[256];
    if (number == SIGKILL) {
        bool by_kernel = memory_oom_kills() > a->oom_kills;
        say(v, by_kernel ? OUTCOME_MEMORY : OUTCOME_CRASH,
            by_kernel ? "killed because the machine ran out of memory"
                      : "killed from outside, or by a limit of memory that does not say so",
            HINT_MEMORY);
        return;
    }
    snprintf(text, sizeof text, "the worker crashed (%s)", strsignal(number));
    say(v, OUTCOME_CRASH, text, "");
}

static void judge_exit(const struct attempt *a, struct verdict *v) {
    int code = WEXITSTATUS(a->wait_status);
    const char *message = a->end_message ? a->end_message : "", *hint = a->end_hint;
    char text[1024];
    switch (code) {
    case PROGRESS_EXIT_OK:
        if (a->has_end && a->end_status == STATUS_OK)
            say(v, OUTCOME_OK, "", "");
        else
            say(v, OUTCOME_CRASH, "the worker ended without a result", "");
        return;
    case PROGRESS_EXIT_INPUT:
        say(v, OUTCOME_INPUT, message[0] ? message : "the input is at fault", hint);
        return;
    case PROGRESS_EXIT_MEMORY:
        say(v, OUTCOME_MEMORY, "out of memory", HINT_MEMORY);
        return;
    case PROGRESS_EXIT_NO_SPACE:
        snprintf(text, sizeof text, "disk full: %.900s", message);
        say(v, OUTCOME_BLOCKED, text, "Free some space, then resume the job.");
        return;
    case PROGRESS_EXIT_STOPPED:
        if (a->stopping)
            say(v, OUTCOME_STOPPED, "", "");
        else
            say(v, OUTCOME_CRASH, "the worker was told to stop from outside", "");
        return;
    case PROGRESS_EXIT_FAILED:
        if (message[0]) {
            say(v, OUTCOME_CRASH, message, hint);
            return;
        }
        break;
    default:
        break;
    }
    snprintf(text, sizeof text, "the worker ended with status %d", code);
    say(v, OUTCOME_CRASH, text, "");
}

static void judge(const struct attempt *a, struct verdict *v) {
    *v = (struct verdict){0};
    if (WIFEXITED(a->wait_status))
        judge_exit(a, v);
    else
        judge_signal(a, v);
    /* We wanted it to end: how it did is of no interest. */
    if ((v->outcome == OUTCOME_CRASH || v->outcome == OUTCOME_MEMORY) && a->stopping)
        say(v, OUTCOME_STOPPED, "", "");
    if (v->outcome != OUTCOME_CRASH && v->outcome != OUTCOME_MEMORY)
        return;
    if (a->has_end && a->end_status != STATUS_OK) /* it could speak for itself */
        return;
    char *words = supervisor_last_words(&a->worker, LAST_WORDS_MAX);
    size_t used = strlen(v->reason);
    if (words[0])
        snprintf(v->reason + used, sizeof v->reason - used, "; its last words: %s", words);
    mem_free(words);
}

/* Enters an attempt that ran out of memory: the next one gets by with less, where it can. */
static enum status settle_memory(const struct attempt *a, struct store *store,
                                 const struct verdict *v, struct error *err) {
    struct buf reason, what;
    cJSON *settings = NULL;
    int step = a->memory_step;
    buf_init(&what, 4096);
    buf_init(&reason, 4096);
    buf_puts(&reason, v->reason);
    if (json_parse(a->settings, strlen(a->settings), "settings", &settings, NULL) == STATUS_OK &&
        memory_can_reduce(settings, step, a->thread_count, &what)) {
        step++;
        buf_printf(&reason, "; a further attempt works with %s", buf_text(&what));
    }
    enum status status = store_job_crash(store, a->job_id, a->number, buf_text(&reason), v->hint,
                                         step, err);
    cJSON_Delete(settings);
    buf_release(&reason);
    buf_release(&what);
    return status;
}

static enum status settle_job(const struct attempt *a, struct store *store, const struct verdict *v,
                              struct error *err) {
    switch (v->outcome) {
    case OUTCOME_OK: return store_job_succeed(store, a->job_id, a->number, err);
    case OUTCOME_INPUT:
        return store_job_fail(store, a->job_id, a->number, v->reason, v->hint, err);
    case OUTCOME_BLOCKED:
        return store_job_block(store, a->job_id, a->number, v->reason, v->hint, err);
    case OUTCOME_STOPPED: return store_job_stop(store, a->job_id, a->number, "", err);
    case OUTCOME_MEMORY: return settle_memory(a, store, v, err);
    case OUTCOME_CRASH: break;
    }
    return store_job_crash(store, a->job_id, a->number, v->reason, v->hint, a->memory_step, err);
}

/* What the archive was unpacked to: a check that was killed could not tidy up. A ready scene needs it,
 * of another only the archive is kept. */
static void remove_unpacked(const struct attempt *a) {
    struct error err;
    char *files = file_join(a->dir, "files");
    if (file_remove_tree(files, &err) != STATUS_OK)
        log_warning("scene %.12s: %s", a->scene_id, err.message);
    mem_free(files);
}

static enum status settle_check(struct attempt *a, struct store *store, const struct verdict *v,
                                struct error *err) {
    if (v->outcome == OUTCOME_STOPPED) /* still `checking`: checked again */
        return STATUS_OK;
    char *text;
    enum status status;
    if (v->outcome == OUTCOME_OK && cJSON_GetArraySize(a->problems) == 0 && a->facts) {
        text = json_text(a->facts);
        status = store_scene_ready(store, a->scene_id, text, err);
    } else {
        bool waits = v->outcome == OUTCOME_BLOCKED; /* the content is not at fault */
        remove_unpacked(a);
        if (waits || cJSON_GetArraySize(a->problems) == 0) {
            cJSON *problem = cJSON_CreateObject();
            json_add_string(problem, "file", "");
            json_add_string(problem, "reason",
                            a->killed           ? "its check took too long"
                            : v->reason[0] != 0 ? v->reason
                                                : "its check ended without a result");
            if (waits)
                json_add_string(problem, "hint", "It is checked again when there is more room.");
            cJSON_AddItemToArray(a->problems, problem);
        }
        text = json_text(a->problems);
        status = waits ? store_scene_postpone(store, a->scene_id, text, err)
                       : store_scene_reject(store, a->scene_id, text, err);
    }
    mem_free(text);
    return status;
}

bool attempt_lacks_room(const struct attempt *a) {
    return a->phase == ATTEMPT_ENDED && WIFEXITED(a->wait_status) &&
           WEXITSTATUS(a->wait_status) == PROGRESS_EXIT_NO_SPACE;
}

void attempt_charge(struct attempt *a, struct store *store, struct figures *figures) {
    double used = supervisor_cpu_sec(&a->worker), more = used - a->charged_sec;
    if (!a->job_id || !(more > 0.0) || store_usage_add(store, a->owner_id, more, NULL) != STATUS_OK)
        return;
    atomic_fetch_add(&figures->cpu_ms, (unsigned long long)(more * 1e3));
    a->charged_sec = used;
}

enum status attempt_settle(struct attempt *a, struct store *store, struct figures *figures,
                           struct error *err) {
    struct verdict verdict;
    attempt_charge(a, store, figures);
    housekeeping_drop_scraps(a->dir);
    judge(a, &verdict);
    enum status status = a->job_id ? settle_job(a, store, &verdict, err)
                                   : settle_check(a, store, &verdict, err);
    /* Fenced, or deleted meanwhile: there is nothing left to enter. */
    if (status != STATUS_OK && status != STATUS_CONFLICT && status != STATUS_NOT_FOUND)
        return status;
    static const enum figures_end ends[] = {
        [OUTCOME_OK] = END_SUCCEEDED,   [OUTCOME_INPUT] = END_INPUT,     [OUTCOME_CRASH] = END_CRASHED,
        [OUTCOME_MEMORY] = END_MEMORY, [OUTCOME_STOPPED] = END_STOPPED, [OUTCOME_BLOCKED] = END_DISK};
    if (a->job_id)
        atomic_fetch_add(&figures->ends[ends[verdict.outcome]], 1);
    static const char *const words[] = {
        [OUTCOME_OK] = "is done", [OUTCOME_INPUT] = "is refused", [OUTCOME_CRASH] = "broke off",
        [OUTCOME_MEMORY] = "broke off",
        [OUTCOME_STOPPED] = "was stopped", [OUTCOME_BLOCKED] = "cannot go on"};
    if (a->job_id)
        log_info("job %lld: attempt %d %s%s%s", (long long)a->job_id, a->number,
                 words[verdict.outcome], verdict.reason[0] ? ": " : "", verdict.reason);
    else
        log_info("scene %.12s: its check %s%s%s", a->scene_id, words[verdict.outcome],
                 verdict.reason[0] ? ": " : "", verdict.reason);
    empty(a);
    return STATUS_OK;
}
