/* remote_runs.c -- see remote.h. This file keeps the runs; remote_follow.c has the rules. */
#include "server/executor/remote.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/random_hex.h"
#include "server/data/layout.h"
#include "server/executor/remote_run.h"
#include "server/executor/time_limit.h"
#include "server/job/worker_log.h"

#define RETRY_SEC 1.0      /* after a fault of the store */
#define REPORTS_AT_ONCE 16 /* of one attempt; others wait meanwhile */

static const struct run_kind kind;

static struct remote_run *of(struct run *run) { return (struct remote_run *)(void *)run; }

static const struct remote_run *of_const(const struct run *run) { return (const struct remote_run *)(const void *)run; }

static double now_sec(const struct remote *m) { return m->parts.now(m->parts.user); }

/* --- rows ---------------------------------------------------------------------------------- */

/* The row as it is now. */
static void update(struct remote_run *r, const struct remote_row *row) {
    struct remote_figures *f = &r->remote->figures;
    if (row->claimed_ms > 0 && r->row.claimed_ms == 0) {
        atomic_fetch_add(&f->claimed, 1);
        atomic_fetch_add(&f->waited_ms,
                         (unsigned long long)(row->claimed_ms > row->begun_ms ? row->claimed_ms - row->begun_ms : 0));
        log_info("job %lld: attempt %d runs on %s", (long long)row->job_id, row->number, row->host);
    }
    if (row->heard_count != r->row.heard_count) { /* seen later than it was: this side waits longer, never shorter */
        r->heard_at = now_sec(r->remote);
        r->unknown_count = 0;
        if (r->is_told_silent && row->phase == REMOTE_CLAIMED &&
            store_remote_trouble(r->remote->parts.store, row->job_id, row->number, "", NULL) == STATUS_OK)
            r->is_told_silent = false;
    }
    r->has_unread |= row->last_seq > r->row.last_seq || row->phase == REMOTE_ENDED;
    r->row = *row;
    if (row->phase == REMOTE_CLAIMED)
        r->submission = SUBMISSION_DONE;
}

static const struct remote_row *find_row(const struct remote_row *rows, size_t count, const struct remote_run *r) {
    for (size_t i = 0; i < count; i++)
        if (rows[i].job_id == r->row.job_id && rows[i].number == r->row.number)
            return &rows[i];
    return NULL;
}

/* Reads the rows of all runs, if any may have changed. */
static void look(struct remote *m) {
    uint64_t changes = store_remote_changes(m->parts.store);
    struct remote_row *rows, ended;
    size_t count;
    struct error err;
    if (changes == m->changes && !m->must_look)
        return;
    enum status status = store_remote_list(m->parts.store, m->parts.site->name, &rows, &count, &err);
    for (struct remote_run *r = m->runs; r && status == STATUS_OK; r = r->next) {
        const struct remote_row *row = find_row(rows, count, r);
        if (row)
            update(r, row);
        else if (r->row.phase != REMOTE_ENDED &&
                 store_remote_get(m->parts.store, r->row.job_id, r->row.number, &ended, &err) == STATUS_OK)
            update(r, &ended);
    }
    mem_free(rows);
    if (status == STATUS_OK) {
        m->changes = changes;
        m->must_look = false;
    } else {
        m->retry_at = now_sec(m) + RETRY_SEC;
    }
}

static void count_runs(struct remote *m) {
    unsigned long long waiting = 0, running = 0;
    for (const struct remote_run *r = m->runs; r; r = r->next) {
        waiting += r->row.phase < REMOTE_CLAIMED;
        running += r->row.phase == REMOTE_CLAIMED;
    }
    atomic_store(&m->figures.waiting, waiting);
    atomic_store(&m->figures.running, running);
}

/* What there is to do for all runs. */
static void turn(struct remote *m) {
    m->retry_at = 0.0;
    look(m);
    remote_receive(m);
    remote_judge(m);
    remote_query_status(m);
    count_runs(m);
}

/* --- the run ------------------------------------------------------------------------------- */

struct line_listener {
    run_line_fn *each;
    void *user;
};

static void pass_lines(void *user, const char *lines) {
    const struct line_listener *l = user;
    while (*lines) {
        size_t length = strcspn(lines, "\n");
        l->each(l->user, lines, length);
        lines += length + (lines[length] == '\n');
    }
}

static void read_lines(struct remote_run *r, size_t limit, run_line_fn *each, void *user) {
    struct line_listener listener = {each, user};
    struct error err;
    for (size_t i = 0; i < limit && r->has_unread; i++) {
        enum status status =
            store_remote_read(r->remote->parts.store, r->row.job_id, r->row.number, pass_lines, &listener, &err);
        if (status == STATUS_NOT_FOUND)
            r->has_unread = false;
        else if (status != STATUS_OK)
            r->remote->retry_at = now_sec(r->remote) + RETRY_SEC;
        if (status != STATUS_OK)
            return;
    }
}

static void remote_read(struct run *run, run_line_fn *each, void *user) {
    struct remote_run *r = of(run);
    turn(r->remote);
    read_lines(r, REPORTS_AT_ONCE, each, user);
}

static void remote_request(struct run *run, enum run_request request) {
    static const enum remote_request requests[] = {
        [RUN_STOP] = REMOTE_STOP, [RUN_KILL] = REMOTE_CANCEL, [RUN_PREVIEW] = REMOTE_PREVIEW};
    struct remote_run *r = of(run);
    struct error err;
    if (r->row.phase == REMOTE_ENDED || r->has_verdict)
        return;
    /* In the queue there is nothing to save; and what is killed is shut out at once, wherever it is. */
    bool is_over = request == RUN_KILL || (request == RUN_STOP && r->row.phase < REMOTE_CLAIMED);
    if (is_over) {
        remote_decide(r, RUN_LOST, 0, "it was taken back");
        remote_cancel(r);
    } else if (store_remote_request(r->remote->parts.store, r->row.job_id, r->row.number, requests[request], &err) !=
               STATUS_OK) {
        log_warning("job %lld: its node cannot be asked: %s", (long long)r->row.job_id, err.message);
    }
}

/* How its node says that it ended. */
static void read_end(const struct remote_row *row, struct run_end *end) {
    static const struct {
        const char *word;
        enum run_way way;
    } ways[] = {{"exit", RUN_EXIT}, {"signal", RUN_SIGNAL},   {"memory", RUN_MEMORY},
                {"lost", RUN_LOST}, {"refused", RUN_REFUSED}, {"preempted", RUN_PREEMPTED}};
    *end = (struct run_end){.way = RUN_LOST, .code = row->end.code};
    snprintf(end->reason, sizeof end->reason, "%s", row->end.way[0] ? row->end.reason : "it was given up");
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++)
        if (strcmp(ways[i].word, row->end.way) == 0)
            end->way = ways[i].way;
}

static void count_end(struct remote *m, enum run_way way) {
    atomic_ullong *figure = way == RUN_LOST        ? &m->figures.lost
                            : way == RUN_PREEMPTED ? &m->figures.preempted
                            : way == RUN_REFUSED   ? &m->figures.refused
                                                   : NULL;
    if (figure)
        atomic_fetch_add(figure, 1);
}

/* Its row is closed, and then shuts everybody out; what the node has managed to say before that counts. */
static bool close_row(struct remote_run *r) {
    struct remote *m = r->remote;
    size_t writers = 1;
    struct error err;
    struct remote_row row;
    enum status status = store_remote_close(m->parts.store, r->row.job_id, r->row.number, &writers, &err);
    if (status == STATUS_OK)
        status = store_remote_get(m->parts.store, r->row.job_id, r->row.number, &row, &err);
    if (status != STATUS_OK) {
        m->retry_at = now_sec(m) + RETRY_SEC;
        return false;
    }
    update(r, &row);
    return writers == 0;
}

/* What its worker has printed goes where that of workers on this machine is. */
static void take_log(const struct remote_run *r) {
    const char *data_dir = r->remote->parts.data_dir;
    char *dir = layout_attempt(data_dir, r->row.job_id, r->row.number), *from = layout_log(dir);
    char *home = layout_job(data_dir, r->row.job_id), *path = layout_log(home);
    struct error err;
    if (worker_log_take(path, from, NODE_LOG_MAX, &err) != STATUS_OK)
        log_warning("job %lld: the log of attempt %d is not kept: %s", (long long)r->row.job_id, r->row.number,
                    err.message);
    mem_free(path);
    mem_free(home);
    mem_free(from);
    mem_free(dir);
}

static bool remote_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user) {
    struct remote_run *r = of(run);
    const struct site *site = r->remote->parts.site;
    if ((!r->has_verdict && r->row.phase != REMOTE_ENDED) || r->is_closed || !close_row(r))
        return false;
    read_lines(r, REMOTE_REPORTS_MAX + 1, each, user);
    if (r->has_unread)
        return false;
    r->is_closed = true;
    take_log(r);
    if (r->row.end.way[0] || !r->has_verdict) /* its node's word comes first */
        read_end(&r->row, end);
    else
        *end = r->verdict;
    if (end->way == RUN_PREEMPTED && time_limit_is_futile(site, r->remote->parts.data_dir, &r->row)) {
        end->way = RUN_REFUSED;
        snprintf(end->reason, sizeof end->reason,
                 "%s has ended it after %.0f min, its limit (time_min), and it had no checkpoint by then", site->name,
                 site->time_min);
    }
    count_end(r->remote, end->way);
    return true;
}

static double remote_cpu_sec(const struct run *run) { return of_const(run)->row.cpu_sec; }

static char *remote_log_tail(const struct run *run, size_t limit) {
    return mem_printf("%.*s", (int)limit, of_const(run)->row.end.log_tail);
}

static size_t remote_poll(const struct run *run, struct pollfd fds[RUN_FDS], double *look_sec) {
    const struct remote_run *r = of_const(run);
    (void)fds; /* whoever has something wakes the scheduler */
    *look_sec = r->has_unread ? 0.0 : fmax(remote_due(r->remote) - now_sec(r->remote), 0.0);
    if (r->is_closed)
        *look_sec = (double)INFINITY;
    return 0;
}

static void remote_run_free(struct run *run) {
    struct remote_run *r = of(run), **at = &r->remote->runs;
    while (*at != r)
        at = &(*at)->next;
    *at = r->next;
    count_runs(r->remote);
    mem_free(r);
}

static const struct run_kind kind = {.read = remote_read,
                                     .ask = remote_request,
                                     .ended = remote_ended,
                                     .cpu_sec = remote_cpu_sec,
                                     .log_tail = remote_log_tail,
                                     .poll = remote_poll,
                                     .free = remote_run_free};

/* --- the executor -------------------------------------------------------------------------- */

static struct remote *remote_of(const struct executor *executor) {
    return ((const struct remote_face *)(const void *)executor)->remote;
}

static struct remote_run *add_run(struct remote *m, const struct remote_row *row) {
    struct remote_run *r = mem_calloc(1, sizeof *r);
    *r = (struct remote_run){
        .run = {.kind = &kind, .outlives = true, .slow_sec = m->parts.site->lease_sec}, .remote = m, .row = *row};
    r->heard_at = r->submitted_at = now_sec(m);
    r->next = m->runs;
    m->runs = r;
    snprintf(r->run.place, sizeof r->run.place, "%.36s of %.20s", row->name, m->parts.site->name);
    return r;
}

static enum status write_order(const struct remote *m, const struct run_work *work, struct error *err) {
    cJSON_DeleteItemFromObjectCaseSensitive(work->order, "thread_count");
    json_add_int(work->order, "thread_count", (int64_t)m->parts.site->threads);
    char *dir = file_join(m->parts.data_dir, work->folder), *path = layout_order(dir), *text = json_text(work->order);
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(text);
    mem_free(path);
    mem_free(dir);
    return status;
}

static enum status start(const struct executor *executor, const struct run_work *work, struct run **run,
                         struct error *err) {
    struct remote *m = remote_of(executor);
    char token[REMOTE_TOKEN_DIGITS + 1], random[REMOTE_NAME_DIGITS + 1], digest[SHA256_HEX_SIZE];
    struct remote_row row = {
        .job_id = work->job_id, .number = work->attempt, .lease_sec = (int)m->parts.site->lease_sec};
    *run = NULL;
    enum status status = random_hex(token, REMOTE_TOKEN_DIGITS, err);
    if (status == STATUS_OK)
        status = random_hex(random, REMOTE_NAME_DIGITS, err);
    if (status != STATUS_OK)
        return status;
    snprintf(row.executor, sizeof row.executor, "%s", m->parts.site->name);
    snprintf(row.name, sizeof row.name, NAME_PREFIX "%lld-%d-%s", (long long)row.job_id, row.number, random);
    sha256_of(token, REMOTE_TOKEN_DIGITS, digest);
    status = write_order(m, work, err);
    if (status == STATUS_OK)
        status = store_remote_begin(m->parts.store, &row, digest, err);
    if (status != STATUS_OK)
        return status;
    struct remote_run *r = add_run(m, &row);
    r->memory_bytes = work->memory_bytes;
    remote_submit(r, token);
    *run = &r->run;
    return STATUS_OK;
}

static enum status resume(const struct executor *executor, int64_t job_id, int attempt, struct run **run,
                          struct error *err) {
    struct remote *m = remote_of(executor);
    struct remote_row row;
    *run = NULL;
    enum status status = store_remote_get(m->parts.store, job_id, attempt, &row, err);
    if (status != STATUS_OK)
        return status;
    struct remote_run *r = add_run(m, &row);
    r->tries = 1;
    r->has_unread = true;
    r->is_told_silent = row.phase == REMOTE_CLAIMED; /* maybe, by the daemon before */
    r->submission = row.phase == REMOTE_SUBMITTING ? SUBMISSION_DOUBTED : SUBMISSION_DONE;
    *run = &r->run;
    return STATUS_OK;
}

struct remote *remote_new(const struct remote_parts *parts) {
    struct remote *m = mem_calloc(1, sizeof *m);
    m->parts = *parts;
    m->face.executor = (struct executor){
        .name = parts->site->name, .max_running = (int)parts->site->max_running, .start = start, .resume = resume};
    m->face.remote = m;
    m->must_look = true;
    return m;
}

void remote_free(struct remote *remote) { mem_free(remote); }

const struct executor *remote_executor(const struct remote *remote) { return &remote->face.executor; }

const struct remote_figures *remote_figures(const struct remote *remote) { return &remote->figures; }
