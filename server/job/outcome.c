/* outcome.c -- see outcome.h. */
#include "server/job/outcome.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/data/layout.h"
#include "server/data/trash.h"
#include "server/job/disk_usage.h"
#include "server/job/housekeeping.h"
#include "server/job/memory_reduction.h"
#include "server/job/worker_log.h"
#include "server/job/worker_messages.h"
#include "server/worker/progress.h"

#define LOG_TAIL_MAX 400 /* bytes */

enum outcome {
    OUTCOME_OK,
    OUTCOME_SPLIT, /* it is better done in parts */
    OUTCOME_INPUT,
    OUTCOME_CRASH,
    OUTCOME_MEMORY, /* a crash that a smaller working set may avoid */
    OUTCOME_STOPPED,
    OUTCOME_BLOCKED,
    OUTCOME_LOST,     /* where it ran is at fault, or the way there */
    OUTCOME_REFUSED,  /* where it was to run, it was not taken */
    OUTCOME_PREEMPTED /* its place was wanted for others */
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
    char text[256];
    if (a->end.code == SIGKILL) {
        say(v, OUTCOME_CRASH, "killed from outside, or by a limit of memory that does not say so", HINT_MEMORY);
        return;
    }
    snprintf(text, sizeof text, "the worker crashed (%s)", strsignal(a->end.code));
    say(v, OUTCOME_CRASH, text, "");
}

static void judge_exit(const struct attempt *a, struct verdict *v) {
    int code = a->end.code;
    const char *message = a->end_message ? a->end_message : "", *hint = a->end_hint;
    char text[1024];
    switch (code) {
    case PROGRESS_EXIT_OK:
        if (a->has_end && a->end_status == STATUS_OK && a->plan)
            say(v, OUTCOME_SPLIT, "", "");
        else if (a->has_end && a->end_status == STATUS_OK)
            say(v, OUTCOME_OK, message, "");
        else
            say(v, OUTCOME_CRASH, "the worker ended without a result", "");
        return;
    case PROGRESS_EXIT_INPUT: say(v, OUTCOME_INPUT, message[0] ? message : "the input is at fault", hint); return;
    case PROGRESS_EXIT_MEMORY: say(v, OUTCOME_MEMORY, "out of memory", HINT_MEMORY); return;
    case PROGRESS_EXIT_NO_SPACE:
        snprintf(text, sizeof text, "disk full: %.900s", message[0] ? message : a->end.reason);
        say(v, OUTCOME_BLOCKED, text, hint && hint[0] ? hint : "Free some space, then resume the job.");
        return;
    case PROGRESS_EXIT_STOPPED:
        if (a->stopping)
            say(v, OUTCOME_STOPPED, "", "");
        else
            say(v, OUTCOME_CRASH, "the worker was stopped from outside", "");
        return;
    case PROGRESS_EXIT_FAILED:
        if (message[0]) {
            say(v, OUTCOME_CRASH, message, hint);
            return;
        }
        break;
    default: break;
    }
    snprintf(text, sizeof text, "the worker ended with status %d", code);
    say(v, OUTCOME_CRASH, text, "");
}

static void judge(const struct attempt *a, struct verdict *v) {
    *v = (struct verdict){0};
    switch (a->end.way) {
    case RUN_EXIT: judge_exit(a, v); break;
    case RUN_SIGNAL: judge_signal(a, v); break;
    case RUN_MEMORY: say(v, OUTCOME_MEMORY, "killed by the kernel, which ran out of memory", HINT_MEMORY); break;
    case RUN_LOST: say(v, OUTCOME_LOST, a->end.reason, ""); break;
    case RUN_PREEMPTED: say(v, OUTCOME_PREEMPTED, a->end.reason, ""); break;
    case RUN_REFUSED: say(v, OUTCOME_REFUSED, a->end.reason, "Resume the job once that is put right."); break;
    }
    /* It was asked to stop: how it ended does not matter. */
    if ((v->outcome == OUTCOME_CRASH || v->outcome == OUTCOME_MEMORY || v->outcome == OUTCOME_LOST) && a->stopping)
        say(v, OUTCOME_STOPPED, "", "");
    if (v->outcome != OUTCOME_CRASH && v->outcome != OUTCOME_MEMORY)
        return;
    if (a->has_end && a->end_status != STATUS_OK) /* the worker reported its own end */
        return;
    char *words = run_log_tail(a->run, LOG_TAIL_MAX);
    size_t used = strlen(v->reason);
    if (words[0])
        snprintf(v->reason + used, sizeof v->reason - used, "; the end of its log: %s", words);
    mem_free(words);
}

/* Enters an attempt that ran out of memory: the next one gets a smaller working set, if possible. */
static enum status settle_memory(const struct attempt *a, struct store *store, const struct verdict *v,
                                 struct error *err) {
    struct buf reason, what;
    cJSON *settings = cJSON_Parse(a->settings); /* the order was made from them, so they parse */
    int step = a->memory_step;
    buf_init(&what, 4096);
    buf_init(&reason, 4096);
    buf_puts(&reason, v->reason);
    if (memory_reduction_is_possible(a->kind, settings, step, a->thread_count, &what)) {
        step++;
        buf_printf(&reason, "; a further attempt works with %s", buf_text(&what));
    }
    enum status status = store_job_crash(store, a->job_id, a->number, buf_text(&reason), v->hint, step, err);
    cJSON_Delete(settings);
    buf_release(&reason);
    buf_release(&what);
    return status;
}

/* What the worker has planned, it may have planned wrongly: it has parsed untrusted files. */
static enum status settle_split(const struct attempt *a, struct store *store, struct error *err) {
    double pictures, parts;
    const char *digest;
    struct error why;
    enum status status = json_number(a->plan, "pictures", "a plan", 0.0, &pictures, &why);
    if (status == STATUS_OK)
        status = json_number(a->plan, "parts", "a plan", 0.0, &parts, &why);
    if (status == STATUS_OK)
        status = json_string(a->plan, "digest", "a plan", "", &digest, &why);
    if (status == STATUS_OK && !(pictures >= 0.0 && pictures <= PICTURES_MAX && parts >= 0.0 && parts <= JOB_PARTS_MAX))
        status = error_set(&why, STATUS_INPUT, "%.9g parts of %.9g pictures cannot be", parts, pictures);
    if (status == STATUS_OK)
        status = store_job_split(store, a->job_id, a->number, (int64_t)pictures, (int)parts, digest, &why);
    if (status == STATUS_INPUT)
        return store_job_crash(store, a->job_id, a->number, why.message, "", a->memory_step, err);
    if (status != STATUS_OK && err)
        *err = why;
    return status;
}

static enum status settle_job(const struct attempt *a, struct store *store, const struct verdict *v,
                              struct error *err) {
    switch (v->outcome) {
    case OUTCOME_OK: return store_job_succeed(store, a->job_id, a->number, v->reason, err);
    case OUTCOME_SPLIT: return settle_split(a, store, err);
    case OUTCOME_INPUT: return store_job_fail(store, a->job_id, a->number, v->reason, v->hint, err);
    case OUTCOME_REFUSED:
    case OUTCOME_BLOCKED: return store_job_block(store, a->job_id, a->number, v->reason, v->hint, err);
    case OUTCOME_STOPPED: return store_job_stop(store, a->job_id, a->number, "", err);
    case OUTCOME_PREEMPTED: return store_job_stop(store, a->job_id, a->number, v->reason, err);
    case OUTCOME_MEMORY: return settle_memory(a, store, v, err);
    case OUTCOME_LOST: return store_job_lose(store, a->job_id, a->number, v->reason, err);
    case OUTCOME_CRASH: break;
    }
    return store_job_crash(store, a->job_id, a->number, v->reason, v->hint, a->memory_step, err);
}

static void remove_folder(const struct attempt *a, struct trash *trash, char *(*layout)(const char *work_dir)) {
    struct error err;
    char *scene = trash ? layout_scene(NULL, a->scene_id) : mem_strdup(a->dir), *path = layout(scene);
    enum status status = trash ? trash_take(trash, path, &err) : file_remove_tree(path, &err);
    if (status != STATUS_OK)
        log_warning("scene %.12s: %s", a->scene_id, err.message);
    mem_free(path);
    mem_free(scene);
}

/* What the archive was unpacked to, and the pictures of it: a check that was killed could not tidy up. A ready scene
 * needs them, of another only the archive is kept. */
static void remove_unpacked(const struct attempt *a, struct trash *trash) {
    remove_folder(a, trash, layout_files);
    remove_folder(a, trash, layout_previews);
}

static void add_problem(struct attempt *a, const char *reason, const char *hint) {
    cJSON *problem = cJSON_CreateObject();
    json_add_string(problem, "file", "");
    json_add_string(problem, "reason", reason);
    if (hint)
        json_add_string(problem, "hint", hint);
    cJSON_AddItemToArray(a->problems, problem);
}

/* Adds it once, though the entry may be tried again. */
static void add_left_out(struct attempt *a) {
    char *reason = mem_printf("%ld more problems are not listed", a->problems_left_out);
    add_problem(a, reason, NULL);
    mem_free(reason);
    a->problems_left_out = 0;
}

/* Enters the size of a good scene. A size above what its owners may keep is a problem of the scene. */
static enum status settle_size(struct attempt *a, struct store *store, struct error *err) {
    struct error why = {0};
    struct disk_use use = {.bytes = disk_usage_of_folder(a->dir)};
    memcpy(use.scene_id, a->scene_id, sizeof use.scene_id);
    enum status status =
        use.bytes < 0 ? STATUS_OK
                      : store_share_check_scene(store, a->scene_id, (uint64_t)use.bytes, a->user_max_bytes, &why);
    if (status == STATUS_OK)
        return store_disk_enter(store, &use, 1, err);
    if (status != STATUS_LIMIT)
        return error_set(err, status, "%s", why.message);
    error_prefix(&why, "unpacked, it is too large");
    log_info("scene %.12s: %s", a->scene_id, why.message);
    add_problem(a, why.message, "Delete jobs or scenes that you do not need, then send it again.");
    return STATUS_OK;
}

/* What a rejected scene keeps of the facts: what there is to say of it, but nothing that goes with its files. */
static char *facts_of_rejected(const struct attempt *a) {
    cJSON *facts = a->facts ? cJSON_Duplicate(a->facts, true) : cJSON_CreateObject();
    cJSON_DeleteItemFromObjectCaseSensitive(facts, "fit");
    cJSON_DeleteItemFromObjectCaseSensitive(facts, "previews");
    char *text = json_text(facts);
    cJSON_Delete(facts);
    return text;
}

static bool is_good(const struct attempt *a, const struct verdict *v) {
    return v->outcome == OUTCOME_OK && cJSON_GetArraySize(a->problems) == 0 && a->facts;
}

static enum status settle_check(struct attempt *a, struct store *store, struct trash *trash, const struct verdict *v,
                                struct error *err) {
    if (v->outcome == OUTCOME_STOPPED || v->outcome == OUTCOME_LOST) /* it is in `checking`, and is checked again */
        return STATUS_OK;
    enum status status = is_good(a, v) ? settle_size(a, store, err) : STATUS_OK;
    if (status != STATUS_OK)
        return status;
    char *text;
    if (is_good(a, v)) {
        text = json_text(a->facts);
        status = store_scene_ready(store, a->scene_id, a->reading, text, err);
    } else {
        bool waits = v->outcome == OUTCOME_BLOCKED; /* the content is not at fault */
        remove_unpacked(a, trash);
        if (waits || cJSON_GetArraySize(a->problems) == 0)
            add_problem(a,
                        a->killed           ? "its check took too long"
                        : v->reason[0] != 0 ? v->reason
                                            : "its check ended without a result",
                        waits ? "It is checked again when there is more room." : NULL);
        if (a->problems_left_out > 0)
            add_left_out(a);
        char *facts = facts_of_rejected(a);
        text = json_text(a->problems);
        status = waits ? store_scene_postpone(store, a->scene_id, a->reading, text, err)
                       : store_scene_reject(store, a->scene_id, a->reading, text, facts, err);
        mem_free(facts);
    }
    mem_free(text);
    return status;
}

bool outcome_lacks_space(const struct attempt *a) {
    return a->phase == ATTEMPT_ENDED && a->end.way == RUN_EXIT && a->end.code == PROGRESS_EXIT_NO_SPACE;
}

/* What the worker of a part has printed goes to its job's log in one piece. */
static void take_log(const struct attempt *a) {
    char *from = layout_log(a->dir), *to = layout_log(a->whole_dir);
    struct error err;
    if (a->part.part > 0 && worker_log_take(to, from, NODE_LOG_MAX, &err) != STATUS_OK)
        log_warning("job %lld: the log of attempt %d is not kept: %s", (long long)a->job_id, a->number, err.message);
    mem_free(to);
    mem_free(from);
}

/* Announced files must be entered before a job ends. A full disk does not delay a stop, though: the next attempt
 * announces them again. */
static enum status make_up(struct attempt *a, struct store *store, struct error *err) {
    enum status status = worker_messages_retry(a, store, err);
    struct job job = {0};
    bool is_unwanted = status == STATUS_NO_SPACE && a->job_id &&
                       store_job_get(store, a->job_id, &job, NULL) == STATUS_OK && job.wanted != JOB_WANT_RUN;
    job_release(&job);
    if (is_unwanted)
        log_warning("job %lld: %d announced files are dropped, since it is stopped: %s", (long long)a->job_id,
                    cJSON_GetArraySize(a->untaken), err->message);
    return is_unwanted ? STATUS_OK : status;
}

enum status outcome_settle(struct attempt *a, struct store *store, struct trash *trash, struct counters *counters,
                           struct error *err) {
    struct verdict verdict;
    attempt_charge(a, store, counters);
    housekeeping_drop_temporary(a->dir);
    judge(a, &verdict);
    enum status status = make_up(a, store, err);
    if (status == STATUS_OK && a->job_id) {
        take_log(a);
        housekeeping_clean_job(a->data_dir, store, a->job_id, a->number);
        status = disk_usage_enter_job(store, a->job_id, a->whole_dir, err);
    }
    if (status == STATUS_OK)
        status = a->job_id ? settle_job(a, store, &verdict, err) : settle_check(a, store, trash, &verdict, err);
    /* Fenced, or deleted meanwhile: nothing is left to enter. */
    if (status != STATUS_OK && status != STATUS_CONFLICT && status != STATUS_NOT_FOUND)
        return status;
    static const enum attempt_end ends[] = {
        [OUTCOME_OK] = END_SUCCEEDED,       [OUTCOME_SPLIT] = END_SUCCEEDED, [OUTCOME_INPUT] = END_INPUT,
        [OUTCOME_CRASH] = END_CRASHED,      [OUTCOME_MEMORY] = END_MEMORY,   [OUTCOME_STOPPED] = END_STOPPED,
        [OUTCOME_BLOCKED] = END_DISK,       [OUTCOME_LOST] = END_LOST,       [OUTCOME_REFUSED] = END_REFUSED,
        [OUTCOME_PREEMPTED] = END_PREEMPTED};
    if (a->job_id)
        atomic_fetch_add(&counters->ends[ends[verdict.outcome]], 1);
    static const char *const words[] = {
        [OUTCOME_OK] = "is done",           [OUTCOME_SPLIT] = "leaves the rest to parts",
        [OUTCOME_INPUT] = "is refused",     [OUTCOME_CRASH] = "broke off",
        [OUTCOME_MEMORY] = "broke off",     [OUTCOME_STOPPED] = "was stopped",
        [OUTCOME_BLOCKED] = "cannot go on", [OUTCOME_LOST] = "is lost",
        [OUTCOME_REFUSED] = "was refused",  [OUTCOME_PREEMPTED] = "was pre-empted"};
    if (a->job_id)
        log_info("job %lld: attempt %d %s%s%s", (long long)a->job_id, a->number, words[verdict.outcome],
                 verdict.reason[0] ? ": " : "", verdict.reason);
    else
        log_info("scene %.12s: its check %s%s%s", a->scene_id, words[verdict.outcome], verdict.reason[0] ? ": " : "",
                 verdict.reason);
    attempt_empty(a);
    return STATUS_OK;
}
