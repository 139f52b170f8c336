/* remote_follow.c -- what a site's commands say of its attempts, and what follows from it; the rules are in remote.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/log.h"
#include "common/mem.h"
#include "common/random_hex.h"
#include "server/executor/remote_run.h"

#define LEASE_FACTOR 1.5 /* of the lease: what the node stops at, this side waits for half as long again */
#define ORPHANS_MAX 16   /* cancelled after one listing */

static double now_sec(const struct remote *m) { return m->parts.now(m->parts.user); }

static bool is_silent(const struct remote_run *r) {
    return now_sec(r->remote) - r->heard_at >= LEASE_FACTOR * r->row.lease_sec;
}

void remote_decide(struct remote_run *r, enum run_way way, int code, const char *format, ...) {
    va_list arguments;
    if (r->has_verdict)
        return;
    r->has_verdict = true;
    r->verdict = (struct run_end){.way = way, .code = code};
    va_start(arguments, format);
    vsnprintf(r->verdict.reason, sizeof r->verdict.reason, format, arguments);
    va_end(arguments);
}

/* --- commands that are sent ---------------------------------------------------------------- */

static void send(struct remote *m, enum site_command_kind kind, char *const *words, const struct site_job *job,
                 char *input) {
    struct site_command *e = mem_calloc(1, sizeof *e);
    e->kind = kind;
    snprintf(e->name, sizeof e->name, "%s", job->name ? job->name : "");
    e->argv = site_words(m->parts.site, words, job);
    e->input = input;
    e->begun = now_sec(m);
    m->parts.commands->add(m->parts.commands, e);
}

void remote_submit(struct remote_run *r, const char *token) {
    struct remote *m = r->remote;
    const struct site_job job = {.name = r->row.name,
                                 .token = token,
                                 .job_id = r->row.job_id,
                                 .attempt = r->row.number,
                                 .memory_bytes = r->memory_bytes};
    r->submission = SUBMISSION_SENT;
    r->tries++;
    r->absent_count = r->unknown_count = 0;
    r->submitted_at = r->heard_at = now_sec(m);
    atomic_fetch_add(&m->figures.submissions, 1);
    send(m, SITE_COMMAND_SUBMIT, m->parts.site->submit, &job, site_script(m->parts.site, &job));
}

static void cancel(struct remote *m, const char *name, const char *id, int64_t job_id, int number) {
    const struct site_job job = {.name = name, .id = id, .job_id = job_id, .attempt = number};
    atomic_fetch_add(&m->figures.cancels, 1);
    send(m, SITE_COMMAND_CANCEL, m->parts.site->cancel, &job, NULL);
}

void remote_cancel(struct remote_run *r) {
    cancel(r->remote, r->row.name, r->row.external_id, r->row.job_id, r->row.number);
}

/* Whether the site has to be asked about it: a node that reports speaks for itself. */
static bool needs_status(const struct remote_run *r) {
    if (r->has_verdict || r->submission == SUBMISSION_SENT || r->row.phase == REMOTE_ENDED)
        return false;
    return r->row.phase != REMOTE_CLAIMED || now_sec(r->remote) - r->heard_at > 0.5 * r->row.lease_sec;
}

static bool any_needs_status(const struct remote *m) {
    for (const struct remote_run *r = m->runs; r; r = r->next)
        if (needs_status(r))
            return true;
    return false;
}

/* The ids that are known, with commas between. */
static char *all_ids(const struct remote *m) {
    struct buf ids;
    buf_init(&ids, SITE_IDS_BYTES); /* room for max_running of the longest: site.c */
    for (const struct remote_run *r = m->runs; r; r = r->next)
        if (r->row.external_id[0] && !r->has_verdict)
            buf_printf(&ids, "%s%s", ids.length > 0 ? "," : "", r->row.external_id);
    char *text = mem_strdup(buf_text(&ids));
    buf_release(&ids);
    return text;
}

void remote_query_status(struct remote *m) {
    if (m->asking || now_sec(m) < m->ask_at || !any_needs_status(m))
        return;
    char *ids = all_ids(m);
    const struct site_job job = {.ids = ids};
    m->asking = true;
    atomic_fetch_add(&m->figures.queries, 1);
    send(m, SITE_COMMAND_STATUS, m->parts.site->status, &job, NULL);
    mem_free(ids);
}

/* --- what a listing says ------------------------------------------------------------------- */

/* The site has it, alive. */
static void note_alive(struct remote_run *r, const struct job_status *job) {
    struct remote *m = r->remote;
    struct error err;
    r->absent_count = 0;
    r->submission = SUBMISSION_DONE;
    if (r->row.phase == REMOTE_SUBMITTING || (job->id[0] && strcmp(job->id, r->row.external_id) != 0)) {
        if (store_remote_submitted(m->parts.store, r->row.job_id, r->row.number, job->id, &err) == STATUS_OK)
            m->must_look = true;
    }
    /* It was claimed, and is in the queue again: the one that claimed it is gone. */
    bool is_again = r->row.phase == REMOTE_CLAIMED && job->state == SITE_WAITING;
    if (job->state == SITE_UNKNOWN) /* a word that says nothing changes nothing */
        return;
    r->unknown_count = is_again ? r->unknown_count + 1 : 0;
    r->gone = is_again ? SITE_PREEMPTED : SITE_UNKNOWN;
    if (r->row.phase < REMOTE_CLAIMED)
        (void)store_remote_explain(m->parts.store, r->row.job_id, r->row.number,
                                   job->state == SITE_RUNNING ? "it begins" : job->reason, NULL);
}

/* The site does not have it, or not alive. */
static void note_gone(struct remote_run *r, const struct job_status *job) {
    if (!job && r->submission == SUBMISSION_DOUBTED) {
        r->absent_count++;
        return;
    }
    r->submission = SUBMISSION_DONE;
    r->unknown_count++;
    r->gone = job ? job->state : r->gone;
}

/* The site's jobs that carry the names of attempts that are over. */
static void cancel_orphans(struct remote *m, const struct job_status_list *listing) {
    int count = 0;
    for (size_t i = 0; i < listing->count && count < ORPHANS_MAX; i++) {
        const struct job_status *job = &listing->job[i];
        struct remote_row row;
        long long id = 0;
        int number = 0;
        if ((job->state != SITE_WAITING && job->state != SITE_RUNNING) ||
            sscanf(job->name, NAME_PREFIX "%lld-%d-", &id, &number) != 2 ||
            store_remote_get(m->parts.store, id, number, &row, NULL) != STATUS_OK || strcmp(row.name, job->name) != 0 ||
            row.phase != REMOTE_ENDED)
            continue;
        if (job->state == SITE_RUNNING && row.claimed_ms > 0) /* it is about to end, or its next report ends it */
            continue;
        cancel(m, job->name, job->id, id, number);
        count++;
    }
}

static void take_listing(struct remote *m, const struct site_command *e) {
    struct job_status_list listing = {0};
    m->asking = false;
    m->ask_at = now_sec(m) + m->parts.site->status_sec;
    bool is_good = e->status == STATUS_OK && job_status_parse(&listing, m->parts.site, e->output);
    if (!is_good) {
        atomic_fetch_add(&m->figures.faults, 1);
        if (!m->complained)
            log_warning("executor %s: its status command says nothing: %s", m->parts.site->name,
                        e->status == STATUS_OK ? "its output cannot be understood" : e->err.message);
    }
    m->complained = !is_good;
    for (struct remote_run *r = m->runs; r && is_good; r = r->next) {
        /* One that was submitted after the question may be missing from the answer. */
        if (r->has_verdict || r->submission == SUBMISSION_SENT || r->submitted_at >= e->begun)
            continue;
        const struct job_status *job = job_status_find(&listing, r->row.name);
        if (job && (job->state == SITE_WAITING || job->state == SITE_RUNNING || job->state == SITE_UNKNOWN))
            note_alive(r, job);
        else
            note_gone(r, job);
    }
    if (is_good)
        cancel_orphans(m, &listing);
    job_status_release(&listing);
}

/* --- what a submission says ---------------------------------------------------------------- */

static struct remote_run *find_run(const struct remote *m, const char *name) {
    for (struct remote_run *r = m->runs; r; r = r->next)
        if (strcmp(r->row.name, name) == 0)
            return r;
    return NULL;
}

/* The id in submit's output; false where there is none. */
static bool find_id(const struct site *site, const char *output, char id[64]) {
    struct line_parts parts;
    for (const char *at = output; *at && *site->submit_id;) {
        size_t length = strcspn(at, "\n");
        if (pattern_match(site->submit_id, at, length, &parts)) {
            memcpy(id, parts.id, sizeof parts.id);
            return true;
        }
        at += length + (at[length] == '\n');
    }
    return false;
}

static void take_submission(struct remote *m, const struct site_command *e) {
    struct remote_run *r = find_run(m, e->name);
    char id[64] = "";
    bool is_good = e->status == STATUS_OK && (find_id(m->parts.site, e->output, id) || !*m->parts.site->submit_id);
    if (!is_good)
        atomic_fetch_add(&m->figures.faults, 1);
    if (!r || r->submission != SUBMISSION_SENT)
        return; /* it was given up meanwhile; should it be in the queue, the listing shows it */
    r->submitted_at = r->heard_at = now_sec(m);
    r->submission = is_good ? SUBMISSION_DONE : SUBMISSION_DOUBTED;
    m->ask_at = fmin(m->ask_at, now_sec(m) + (is_good ? m->parts.site->status_sec : 1.0));
    if (!is_good) {
        snprintf(r->fault, sizeof r->fault, "%.190s",
                 e->status == STATUS_OK ? "the output of its submit command cannot be understood" : e->err.message);
        log_warning("job %lld: attempt %d may not have come to %s: %s", (long long)r->row.job_id, r->row.number,
                    m->parts.site->name, r->fault);
        return;
    }
    /* Where the store fails, the listing says it again. */
    if (store_remote_submitted(m->parts.store, r->row.job_id, r->row.number, id, NULL) == STATUS_OK)
        m->must_look = true;
    (void)store_remote_explain(m->parts.store, r->row.job_id, r->row.number, "", NULL);
}

void remote_receive(struct remote *m) {
    struct site_command *e;
    while ((e = m->parts.commands->next_done(m->parts.commands)) != NULL) {
        if (e->kind == SITE_COMMAND_STATUS)
            take_listing(m, e);
        else if (e->kind == SITE_COMMAND_SUBMIT)
            take_submission(m, e);
        else if (e->status != STATUS_OK) /* what should have gone and is still there, the next listing shows */
            atomic_fetch_add(&m->figures.faults, 1);
        site_command_free(e);
    }
}

/* --- judgement ----------------------------------------------------------------------------- */

/* The submission has not come through: once more, under another name. */
static void submit_again(struct remote_run *r) {
    struct remote *m = r->remote;
    const char *name = m->parts.site->name;
    char token[REMOTE_TOKEN_DIGITS + 1], random[REMOTE_NAME_DIGITS + 1];
    struct error err;
    if (r->tries >= REMOTE_TRIES_MAX) {
        remote_decide(r, RUN_REFUSED, 0, "%s does not take it: %.190s", name,
                      r->fault[0] ? r->fault : "no reason is known");
        return;
    }
    if (random_hex(token, REMOTE_TOKEN_DIGITS, &err) != STATUS_OK ||
        random_hex(random, REMOTE_NAME_DIGITS, &err) != STATUS_OK)
        return;
    char digest[SHA256_HEX_SIZE], fresh[REMOTE_NAME_SIZE];
    sha256_of(token, REMOTE_TOKEN_DIGITS, digest);
    snprintf(fresh, sizeof fresh, NAME_PREFIX "%lld-%d-%s", (long long)r->row.job_id, r->row.number, random);
    enum status status = store_remote_rename(m->parts.store, r->row.job_id, r->row.number, fresh, digest, &err);
    if (status == STATUS_OK) {
        memcpy(r->row.name, fresh, sizeof r->row.name);
        remote_submit(r, token);
    } else {
        m->must_look = true; /* claimed meanwhile, or the store fails: next time */
    }
}

/* Nothing can be decided yet; whoever waits for the job learns what it waits for. */
static void tell_silent(struct remote_run *r) {
    const struct remote *m = r->remote;
    char reason[192];
    if (r->is_told_silent || r->row.phase != REMOTE_CLAIMED)
        return;
    snprintf(reason, sizeof reason, "%.60s has been silent for %.0f s; %s %s", r->row.host,
             LEASE_FACTOR * r->row.lease_sec, m->parts.site->name,
             m->complained ? "does not answer either" : "still has the job");
    r->is_told_silent = store_remote_trouble(m->parts.store, r->row.job_id, r->row.number, reason, NULL) == STATUS_OK;
    if (r->is_told_silent)
        log_warning("job %lld: attempt %d: %s", (long long)r->row.job_id, r->row.number, reason);
}

static void judge_silent(struct remote_run *r) {
    const char *name = r->remote->parts.site->name, *host = r->row.host[0] ? r->row.host : "its node";
    bool is_claimed = r->row.phase == REMOTE_CLAIMED;
    if (is_claimed &&
        (r->row.refused_count > 0 || (r->unknown_count >= REMOTE_UNKNOWN_MAX && r->gone == SITE_PREEMPTED)))
        remote_decide(r, RUN_PREEMPTED, 0, "%s has taken it from %s", name, host);
    else if (r->unknown_count >= REMOTE_UNKNOWN_MAX && r->gone == SITE_MEMORY)
        remote_decide(r, RUN_MEMORY, 0, "%s has ended it: it took too much memory", name);
    else if (r->unknown_count >= REMOTE_UNKNOWN_MAX && is_claimed)
        remote_decide(r, RUN_LOST, 0, "%s is silent, and %s does not run it any more", host, name);
    else if (r->unknown_count >= REMOTE_UNKNOWN_MAX)
        remote_decide(r, RUN_LOST, 0,
                      "%s has ended it before its node reported; do its nodes have %.60s, and reach %.80s?", name,
                      r->remote->parts.site->node, r->remote->parts.site->url);
}

void remote_judge(struct remote *m) {
    for (struct remote_run *r = m->runs; r; r = r->next) {
        if (r->has_verdict || r->row.phase == REMOTE_ENDED || r->submission == SUBMISSION_SENT)
            continue;
        if (r->submission == SUBMISSION_DOUBTED && r->row.phase < REMOTE_CLAIMED &&
            r->absent_count >= REMOTE_ABSENT_MAX)
            submit_again(r);
        else if (is_silent(r))
            judge_silent(r);
        if (is_silent(r) && !r->has_verdict)
            tell_silent(r);
        if (r->has_verdict && r->verdict.way != RUN_REFUSED)
            remote_cancel(r);
    }
}

double remote_due(const struct remote *m) {
    double due = m->retry_at > 0.0 ? m->retry_at : (double)INFINITY;
    if (!m->asking && any_needs_status(m))
        due = fmin(due, m->ask_at);
    for (const struct remote_run *r = m->runs; r; r = r->next) {
        double half = r->heard_at + 0.5 * r->row.lease_sec, whole = r->heard_at + LEASE_FACTOR * r->row.lease_sec;
        if (r->has_verdict || r->row.phase == REMOTE_ENDED || r->submission == SUBMISSION_SENT)
            continue;
        if (half > now_sec(m))
            due = fmin(due, half);
        else if (whole > now_sec(m))
            due = fmin(due, whole);
    }
    return due;
}
