/* executor_model.h -- a cluster that misbehaves, in virtual time, and the model that says what must hold all the same.
 *
 * The real executor (server/executor) and the real store work for a scheduler whose commands time out, lie, repeat ids,
 * lose replies and answer late; whose nodes die, are cut off, are started twice; under a daemon that dies at any
 * moment. A script is one seed. What is held:
 *
 * 1. An attempt is claimed once, and of one job no two attempts write at the same time; none after its end.
 * 2. A job succeeds only by an attempt whose node said so, once; nothing is accepted after.
 * 3. Lines are heard in their order, none is missing of an attempt whose node has ended it, and one is heard again only
 *    after the daemon died.
 * 4. An end that the store has taken from a node is the attempt's end, whatever this side has judged meanwhile.
 * 5. Lost is only what the site had; a submission of which nothing came is repeated.
 * 6. When the faults stop, every job comes to an end. */
#ifndef UNBAKE_TESTS_EXECUTOR_MODEL_H
#define UNBAKE_TESTS_EXECUTOR_MODEL_H

#include <math.h>
#include <string.h>
#include <unistd.h>

#include "common/log.h"
#include "common/rng.h"
#include "server/executor/remote.h"
#include "server/store/remote.h"
#include "tests/unit/store_rig.h"

#ifndef JOBS_MAX
#define JOBS_MAX 4
#define CLUSTER_MAX 400 /* jobs that the site ever has in one script */
#endif
#define COMMANDS_MAX 256
#define WORK_REPORTS 5 /* of an attempt before it is done */
#define FAULTS_SEC 900.0
#define LAST_SEC 20000.0 /* by then everything must have ended */

enum cluster_state { CLUSTER_UNBORN, CLUSTER_QUEUED, CLUSTER_RUNNING, CLUSTER_GONE };

/* One job of the site, and its node. */
struct cluster_job {
    char name[64], id[32];
    enum cluster_state state;
    double at; /* of the next change of its state */
    const char *gone_word;
    /* the node */
    bool alive, is_claimed, is_writing, must_stop, is_preempted, is_unanswered;
    char token_sha256[SHA256_HEX_SIZE], claimant[17];
    int64_t job_id, seq;
    int attempt, done, start_count;
    double next_at, lease_until, cut_until, write_until;
};

struct model_job {
    int64_t id;
    struct run *run; /* NULL: it does not run */
    int attempt;
    bool has_node_end, succeeded, was_killed_daemon, is_over;
    int64_t heard; /* the last line */
    int request;   /* RUN_STOP, RUN_KILL; -1: none */
};

static struct model {
    uint64_t random;
    double now, busy_until;
    bool is_calm; /* no more faults */
    struct store *store;
    struct site site;
    struct remote *remote;
    struct command_queue commands;
    struct site_command *command[COMMANDS_MAX];
    double command_at[COMMANDS_MAX];
    size_t command_count;
    struct cluster_job cluster[CLUSTER_MAX];
    size_t cluster_count;
    char last_status[1 << 18];
    struct model_job job[JOBS_MAX];
    size_t job_count, running, running_max; /* running_max 0: no limit */
    char *dir;
    long claims, ends, restarts, losses, preemptions; /* over all scripts */
    long log_tail;                                    /* of nodes, after this side had decided */
} model;

static inline double chance(void) { return (double)(rng_mix64(model.random++) >> 11) * 0x1p-53; }
static inline bool happens(double probability) { return !model.is_calm && chance() < probability; }
static inline double between(double low, double high) { return low + (high - low) * chance(); }

/* --- the site's commands --------------------------------------------------------------------- */

static inline void cluster_add(const struct site_command *e, double delay) {
    if (model.cluster_count == CLUSTER_MAX)
        return;
    struct cluster_job *c = &model.cluster[model.cluster_count];
    long long job = 0;
    char token[65] = "";
    *c = (struct cluster_job){.state = CLUSTER_UNBORN, .at = model.now + delay};
    snprintf(c->name, sizeof c->name, "%s", e->name);
    /* ids are repeated now and then */
    snprintf(c->id, sizeof c->id, "%d", happens(0.1) ? 7 : 1000 + (int)model.cluster_count);
    CHECK(sscanf(e->input, "token=%64s job=%lld attempt=%d", token, &job, &c->attempt) == 3);
    c->job_id = job;
    sha256_of(token, strlen(token), c->token_sha256);
    model.cluster_count++;
}

static inline void do_submit(struct site_command *e) {
    double kind = model.is_calm ? 1.0 : chance();
    e->status = STATUS_OK;
    e->output = mem_strdup("");
    if (kind < 0.08) { /* refused for good, this time */
        e->status = error_set(&e->err, STATUS_IO, "submit: invalid partition");
        return;
    }
    cluster_add(e, kind < 0.16 ? between(5.0, 120.0) : 0.0);
    if (kind < 0.24) { /* it came through, or will, but nobody says so */
        e->status = error_set(&e->err, STATUS_UNAVAILABLE, "submit did not end within 60 s");
        return;
    }
    if (kind < 0.28)
        cluster_add(e, between(0.0, 30.0)); /* twice */
    mem_free(e->output);
    e->output = kind < 0.32 ? mem_strdup("Segmentation fault (core dumped)\n")
                            : mem_printf("submitted %s\n", model.cluster[model.cluster_count - 1].id);
}

static inline void do_status(struct site_command *e) {
    static const char *const words[] = {"?", "PD", "R", "F"};
    struct buf text;
    double kind = model.is_calm ? 1.0 : chance();
    e->status = STATUS_OK;
    buf_init(&text, sizeof model.last_status - 1);
    for (size_t i = 0; i < model.cluster_count; i++) {
        const struct cluster_job *c = &model.cluster[i];
        if (c->state == CLUSTER_UNBORN || (c->state == CLUSTER_GONE && model.now > c->at + 300.0) ||
            (kind < 0.05 && chance() < 0.5)) /* leaves some out */
            continue;
        buf_printf(&text, "%s %s %s some reason\n", c->id, c->name,
                   c->state == CLUSTER_GONE && c->gone_word ? c->gone_word : words[c->state]);
    }
    if (kind > 0.05 && kind < 0.12) {
        e->status = error_set(&e->err, STATUS_UNAVAILABLE, "status did not end within 60 s");
    } else if (kind > 0.12 && kind < 0.18) {
        buf_clear(&text);
        buf_puts(&text, chance() < 0.5 ? "slurm_load_jobs error\n" : "");
    } else if (kind > 0.18 && kind < 0.24) { /* what was true some time ago */
        buf_clear(&text);
        buf_puts(&text, model.last_status);
    }
    e->output = mem_strdup(buf_text(&text));
    snprintf(model.last_status, sizeof model.last_status, "%s", buf_text(&text));
    buf_release(&text);
}

static inline void node_dies(struct cluster_job *c) {
    c->alive = false;
    if (c->is_writing) {
        const struct remote_key key = {c->job_id, c->attempt, c->token_sha256, c->claimant};
        store_remote_leave(model.store, &key); /* its connection breaks */
    }
    c->is_writing = false;
}

static inline void gone(struct cluster_job *c, const char *word) {
    if (c->alive)
        node_dies(c);
    c->state = CLUSTER_GONE;
    c->at = model.now;
    c->gone_word = word;
}

static inline void do_cancel(struct site_command *e) {
    e->status = happens(0.3) ? error_set(&e->err, STATUS_IO, "cancel: connection refused") : STATUS_OK;
    e->output = mem_strdup("");
    for (size_t i = 0; i < model.cluster_count && e->status == STATUS_OK; i++)
        if (strcmp(model.cluster[i].name, e->name) == 0 && model.cluster[i].state != CLUSTER_GONE)
            gone(&model.cluster[i], "F");
}

static inline void model_commands_add(struct command_queue *commands, struct site_command *e) {
    (void)commands;
    CHECK(model.command_count < COMMANDS_MAX);
    model.busy_until = fmax(model.busy_until, model.now) + between(0.05, happens(0.1) ? 60.0 : 2.0);
    model.command[model.command_count] = e;
    model.command_at[model.command_count++] = model.busy_until;
}

static inline struct site_command *model_commands_next_done(struct command_queue *commands) {
    (void)commands;
    if (model.command_count == 0 || model.command_at[0] > model.now)
        return NULL;
    struct site_command *e = model.command[0];
    model.command_count--;
    memmove(model.command, model.command + 1, model.command_count * sizeof *model.command);
    memmove(model.command_at, model.command_at + 1, model.command_count * sizeof *model.command_at);
    if (e->kind == SITE_COMMAND_SUBMIT)
        do_submit(e);
    else if (e->kind == SITE_COMMAND_STATUS)
        do_status(e);
    else
        do_cancel(e);
    return e;
}

/* --- nodes ----------------------------------------------------------------------------------- */

static inline struct model_job *job_of(int64_t id) {
    for (size_t i = 0; i < model.job_count; i++)
        if (model.job[i].id == id)
            return &model.job[i];
    return NULL;
}

static inline void node_starts(struct cluster_job *c) {
    c->alive = true;
    c->is_claimed = c->must_stop = c->is_preempted = c->is_unanswered = false;
    c->seq = 0;
    c->done = 0;
    c->start_count++;
    c->next_at = model.now + between(0.1, 3.0);
    snprintf(c->claimant, sizeof c->claimant, "%08x%08x", (unsigned)(c - model.cluster), (unsigned)c->start_count);
}

static inline void check_writers(const struct cluster_job *c) {
    for (size_t i = 0; i < model.cluster_count; i++) {
        const struct cluster_job *other = &model.cluster[i];
        CHECK_THAT(other == c || !other->is_writing || other->job_id != c->job_id,
                   "two attempts of job %lld write: %d and %d", (long long)c->job_id, c->attempt, other->attempt);
    }
}

static inline void node_claims(struct cluster_job *c, const struct remote_key *key) {
    struct remote_row row;
    enum status status = store_remote_claim(model.store, key, "node", &row, &err);
    if (status != STATUS_OK) {
        node_dies(c);
        gone(c, "F");
        return;
    }
    if (happens(0.1))
        return; /* the reply is lost: it tries again */
    if (!c->is_claimed)
        model.claims++;
    for (size_t i = 0; i < model.cluster_count; i++) {
        const struct cluster_job *o = &model.cluster[i];
        CHECK_THAT(o == c || !o->is_claimed || o->job_id != c->job_id || o->attempt != c->attempt,
                   "attempt %d of job %lld is claimed twice", c->attempt, (long long)c->job_id);
    }
    c->is_claimed = true;
    c->lease_until = model.now + row.lease_sec;
}

static inline void node_writes(struct cluster_job *c, const struct remote_key *key) {
    if (c->is_writing && model.now >= c->write_until) {
        c->is_writing = false;
        store_remote_leave(model.store, key);
    } else if (!c->is_writing && chance() < 0.3 && store_remote_enter(model.store, key, &err) == STATUS_OK) {
        check_writers(c);
        c->is_writing = true;
        c->write_until = model.now + between(0.0, happens(0.1) ? 200.0 : 10.0);
    }
}

/* It says its last word; *status as the store has it. */
static inline enum status node_ends(struct cluster_job *c, const struct remote_key *key) {
    struct remote_end end = {.way = "exit"};
    if (c->is_preempted)
        memcpy(end.way, "preempted", sizeof "preempted");
    end.code = c->must_stop ? 85 : 0;
    if (c->is_writing) {
        c->is_writing = false;
        store_remote_leave(model.store, key);
    }
    enum status status = store_remote_end(model.store, key, c->seq + 1, &end, 1.0, &err);
    struct model_job *job = job_of(c->job_id);
    if (status == STATUS_OK && job && job->attempt == c->attempt && !strcmp(end.way, "exit") && end.code == 0)
        job->has_node_end = true;
    return status;
}

static inline void node_reports(struct cluster_job *c, const struct remote_key *key) {
    struct remote_reply reply;
    char lines[64];
    c->is_preempted |= !c->is_unanswered && happens(0.01); /* the site has told it to make room */
    bool is_last = c->must_stop || c->is_preempted || c->done >= WORK_REPORTS;
    snprintf(lines, sizeof lines, "%lld\n%lld\n", (long long)(2 * c->seq + 1), (long long)(2 * c->seq + 2));
    enum status status =
        is_last ? node_ends(c, key) : store_remote_report(model.store, key, c->seq + 1, lines, 1.0, &reply, &err);
    if (status == STATUS_CONFLICT || status == STATUS_NOT_FOUND) {
        gone(c, "F"); /* shut out: it stops without a trace */
        return;
    }
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    c->is_unanswered = status != STATUS_OK || happens(0.15);
    if (c->is_unanswered)
        return; /* the reply is lost: the same once more */
    if (is_last) {
        gone(c, "CD");
        return;
    }
    c->seq++;
    c->done++;
    c->lease_until = model.now + reply.lease_sec;
    c->must_stop = reply.wanted == REMOTE_STOP;
    if (reply.wanted == REMOTE_CANCEL)
        gone(c, "F");
}

static inline void node_turn(struct cluster_job *c) {
    const struct remote_key key = {c->job_id, c->attempt, c->token_sha256, c->claimant};
    if (c->is_claimed && model.now >= c->lease_until) {
        gone(c, "F"); /* its lease is over: it stops by itself */
        return;
    }
    if (happens(0.002)) {
        gone(c, chance() < 0.3 ? "NF" : "F"); /* killed, or its machine */
        return;
    }
    if (happens(0.002)) { /* the site wants its place, and starts it again later */
        node_dies(c);
        c->state = CLUSTER_QUEUED;
        c->at = model.now + between(1.0, 200.0);
        return;
    }
    if (happens(0.003))
        c->cut_until = model.now + between(1.0, 200.0);
    if (model.now < c->cut_until)
        return;
    if (c->is_claimed)
        node_writes(c, &key);
    if (model.now < c->next_at)
        return;
    c->next_at = model.now + between(2.0, 10.0);
    if (!c->is_claimed)
        node_claims(c, &key);
    else
        node_reports(c, &key);
}

static inline void cluster_turn(void) {
    for (size_t i = 0; i < model.cluster_count; i++) {
        struct cluster_job *c = &model.cluster[i];
        if (c->state == CLUSTER_UNBORN && model.now >= c->at) {
            c->state = CLUSTER_QUEUED;
            c->at = model.now + between(0.0, happens(0.1) ? 300.0 : 20.0);
        } else if (c->state == CLUSTER_QUEUED && model.now >= c->at) {
            c->state = CLUSTER_RUNNING;
            node_starts(c);
        } else if (c->state == CLUSTER_RUNNING && c->alive) {
            node_turn(c);
        }
    }
}

/* --- the daemon ------------------------------------------------------------------------------ */

static inline double model_now(void *user) {
    (void)user;
    return model.now;
}

static inline void daemon_begins(void) {
    model.commands = (struct command_queue){.add = model_commands_add, .next_done = model_commands_next_done};
    model.remote = remote_new(&(struct remote_parts){.site = &model.site,
                                                     .store = model.store,
                                                     .commands = &model.commands,
                                                     .data_dir = model.dir,
                                                     .now = model_now});
}

static inline void hear_line(void *user, const char *line, size_t length) {
    struct model_job *job = user;
    int64_t number = strtoll(line, NULL, 10);
    CHECK(length > 0);
    CHECK_THAT(number == job->heard + 1 || (job->was_killed_daemon && number <= job->heard + 1),
               "job %lld attempt %d: line %lld after %lld", (long long)job->id, job->attempt, (long long)number,
               (long long)job->heard);
    job->heard = number > job->heard ? number : job->heard;
}

static inline void start_one(struct model_job *job) {
    OK(store_job_start(model.store, job->id, "fake", &job->attempt, &err));
    char *folder = mem_printf("jobs/%lld/attempt-%d", (long long)job->id, job->attempt);
    char *path = file_join(model.dir, folder);
    OK(file_make_dirs(path, &err));
    cJSON *order = cJSON_CreateObject();
    const struct run_work work = {
        .folder = folder, .log = "x", .order = order, .job_id = job->id, .attempt = job->attempt};
    const struct executor *executor = remote_executor(model.remote);
    job->heard = 0;
    job->has_node_end = job->was_killed_daemon = false;
    job->request = -1;
    OK(executor->start(executor, &work, &job->run, &err));
    model.running++;
    cJSON_Delete(order);
    mem_free(path);
    mem_free(folder);
}

/* The HTTP side works while the scheduler's thread decides: a node that has just been asked to stop, or was given up,
 * may have reported its end before that. */
static inline void node_hurries(const struct model_job *job) {
    for (size_t i = 0; i < model.cluster_count; i++) {
        struct cluster_job *c = &model.cluster[i];
        if (c->job_id != job->id || c->attempt != job->attempt || !c->alive || !c->is_claimed || c->is_unanswered ||
            model.now < c->cut_until || model.now >= c->lease_until)
            continue;
        c->done = WORK_REPORTS;
        const struct remote_key key = {c->job_id, c->attempt, c->token_sha256, c->claimant};
        node_reports(c, &key);
        model.log_tail++;
        return;
    }
}

/* Rules 4 and 5. */
static inline void check_end(const struct model_job *job, const struct remote_row *row, const struct run_end *end) {
    bool was_there = false;
    if (row->end.way[0])
        CHECK_THAT(end->way == (strcmp(row->end.way, "preempted") == 0 ? RUN_PREEMPTED : RUN_EXIT) &&
                       (end->way == RUN_PREEMPTED || end->code == row->end.code),
                   "attempt %d of job %lld: its node ended it with %s %d, and it ends as %d: %s", job->attempt,
                   (long long)job->id, row->end.way, row->end.code, (int)end->way, end->reason);
    for (size_t i = 0; i < model.cluster_count; i++)
        was_there |= strcmp(model.cluster[i].name, row->name) == 0;
    CHECK_THAT(end->way != RUN_LOST || job->request >= 0 || was_there || model.cluster_count == CLUSTER_MAX,
               "attempt %d of job %lld is lost, and the site never had it", job->attempt, (long long)job->id);
}

static inline void settle(struct model_job *job, const struct run_end *end) {
    struct store *store = model.store;
    for (size_t i = 0; i < model.cluster_count; i++)
        CHECK_THAT(!(model.cluster[i].is_writing && model.cluster[i].job_id == job->id),
                   "attempt %d of job %lld has ended and is written to", job->attempt, (long long)job->id);
    bool was_asked = job->request >= 0;
    model.ends++;
    if (end->way == RUN_EXIT && end->code == 0) {
        CHECK(job->has_node_end && !job->succeeded);
        struct job row;
        OK(store_job_succeed(store, job->id, job->attempt, "", &err));
        OK(store_job_get(store, job->id, &row, &err));
        job->succeeded = row.state == JOB_SUCCEEDED;
        job_release(&row);
    } else if (end->way == RUN_LOST && !was_asked) {
        model.losses++;
        OK(store_job_lose(store, job->id, job->attempt, end->reason, &err));
    } else if (end->way == RUN_REFUSED) {
        OK(store_job_block(store, job->id, job->attempt, end->reason, "", &err));
        OK(store_job_resume(store, job->id, NULL, &err));
    } else {
        CHECK_THAT(was_asked || end->way == RUN_PREEMPTED || end->way == RUN_MEMORY, "way %d code %d: %s", end->way,
                   end->code, end->reason);
        model.preemptions += end->way == RUN_PREEMPTED;
        OK(store_job_stop(store, job->id, job->attempt, end->reason, &err));
    }
    run_free(job->run);
    job->run = NULL;
    model.running--;
}

static inline void job_turn(struct model_job *job) {
    struct run_end end;
    struct job row;
    if (job->is_over)
        return;
    if (job->run) {
        run_read(job->run, hear_line, job);
        if (run_ended(job->run, &end, hear_line, job)) {
            int64_t told = 0;
            struct remote_row at_end;
            OK(store_remote_get(model.store, job->id, job->attempt, &at_end, &err));
            told = 2 * (at_end.last_seq - (at_end.end.way[0] ? 1 : 0));
            CHECK_THAT(job->heard == told, "%lld lines of %lld were heard", (long long)job->heard, (long long)told);
            check_end(job, &at_end, &end);
            settle(job, &end);
        } else if (job->request < 0 && happens(0.0005)) {
            job->request = chance() < 0.5 ? RUN_STOP : RUN_KILL;
            if (job->request == RUN_KILL)
                OK(store_job_cancel(model.store, job->id, &err));
            run_ask(job->run, (enum run_request)job->request);
            if (happens(0.5))
                node_hurries(job);
        }
        return;
    }
    OK(store_job_get(model.store, job->id, &row, &err));
    job->is_over = job_is_terminal(row.state);
    CHECK(row.state == JOB_QUEUED || job->is_over);
    job_release(&row);
    if (!job->is_over && (model.running_max == 0 || model.running < model.running_max))
        start_one(job);
}

/* The daemon dies, with what its commands would have said. Those that were sent may come through all the same. */
static inline void daemon_dies(void) {
    model.restarts++;
    for (size_t i = 0; i < model.job_count; i++) {
        run_free(model.job[i].run);
        model.job[i].was_killed_daemon = true;
    }
    for (size_t i = 0; i < model.command_count; i++) {
        struct site_command *e = model.command[i];
        if (e->kind == SITE_COMMAND_SUBMIT && chance() < 0.5)
            cluster_add(e, between(0.0, 5.0));
        site_command_free(e);
    }
    model.command_count = 0;
    remote_free(model.remote);
    for (size_t i = 0; i < model.cluster_count; i++) { /* its connections break */
        struct cluster_job *c = &model.cluster[i];
        const struct remote_key key = {c->job_id, c->attempt, c->token_sha256, c->claimant};
        if (c->is_writing)
            store_remote_leave(model.store, &key);
        c->is_writing = false;
    }
    daemon_begins();
    for (size_t i = 0; i < model.job_count; i++) {
        struct model_job *job = &model.job[i];
        const struct executor *executor = remote_executor(model.remote);
        if (!job->run)
            continue;
        OK(executor->resume(executor, job->id, job->attempt, &job->run, &err));
        if (job->request >= 0) /* the store remembers what the user wants */
            run_ask(job->run, (enum run_request)job->request);
    }
}

/* --- a script -------------------------------------------------------------------------------- */

static inline bool all_over(void) {
    for (size_t i = 0; i < model.job_count; i++)
        if (!model.job[i].is_over)
            return false;
    return true;
}

static inline void model_open(void) {
    static const char conf[] = "submit = fake submit {name}\n"
                               "submit_id = submitted {id}\n"
                               "status = fake status\n"
                               "status_line = {id} {name} {state} {reason}\n"
                               "cancel = fake cancel {name} {id}\n"
                               "waiting = PD\nrunning = R\nended = F CD\npreempted = NF\n"
                               "url = http://127.0.0.1:7117\n"
                               "[script]\n"
                               "token={token} job={job} attempt={attempt}\n{command}\n";
    struct buf problems;
    model.dir = fresh_dir();
    char *path = file_join(model.dir, "fake.conf");
    buf_init(&problems, 65536);
    OK(file_replace(path, conf, sizeof conf - 1, &err));
    OK(site_read(&model.site, "fake", path, &problems, &err));
    CHECK_THAT(problems.length == 0, "%s", buf_text(&problems));
    buf_release(&problems);
    mem_free(path);
    OK(store_open(&model.store, model.dir, &err));
    add_ready_scene(model.store, SCENE_A);
}

static inline void model_close(void) {
    store_close(model.store);
    site_release(&model.site);
    drop_dir(model.dir);
}

static inline void run_script(uint64_t seed) {
    int failed_before = check_failed_count;
    model.random = rng_mix64(seed) >> 1;
    model.now = model.busy_until = 0.0;
    model.is_calm = false;
    model.cluster_count = model.command_count = model.running = 0;
    model.last_status[0] = '\0';
    model.job_count = 1 + (size_t)(chance() * JOBS_MAX) % JOBS_MAX;
    for (size_t i = 0; i < model.job_count; i++)
        model.job[i] = (struct model_job){.id = add_job(model.store, SCENE_A, 0), .request = -1};
    daemon_begins();
    while (!all_over() && model.now < LAST_SEC) {
        model.now += 1.0;
        model.is_calm = model.now > FAULTS_SEC;
        cluster_turn();
        for (size_t i = 0; i < model.job_count; i++)
            job_turn(&model.job[i]);
        if (happens(0.004))
            daemon_dies();
    }
    CHECK_THAT(all_over(), "script %llu: a job has not ended after %.0f s", (unsigned long long)seed, model.now);
    for (size_t i = 0; i < model.cluster_count; i++) /* what is left is shut out */
        if (model.cluster[i].alive)
            gone(&model.cluster[i], "F");
    for (size_t i = 0; i < model.job_count; i++)
        run_free(model.job[i].run);
    for (size_t i = 0; i < model.command_count; i++)
        site_command_free(model.command[i]);
    remote_free(model.remote);
    for (size_t i = 0; i < model.job_count && all_over(); i++)
        OK(store_job_delete(model.store, model.job[i].id, &err));
    if (check_failed_count > failed_before)
        printf("script %llu\n", (unsigned long long)seed);
}

#endif
