/* remote_node.c -- the node's side of remote.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/job/job.h"
#include "server/store/internal.h"
#include "server/store/remote.h"

static enum status unknown(const struct remote_key *key, struct error *err) {
    return error_set(err, STATUS_NOT_FOUND, "there is no attempt %d of job %lld with that token", key->number,
                     (long long)key->job_id);
}

static enum status over(const struct remote_key *key, struct error *err) {
    return error_set(err, STATUS_CONFLICT, "attempt %d of job %lld is over", key->number, (long long)key->job_id);
}

/* Whether it may be claimed by whoever has the token; *claimant (a caller's, REMOTE_CLAIMANT_SIZE) is who did, "":
 * nobody. */
static enum status check_token(struct store *store, const struct remote_key *key, char *claimant, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false, is_over = true;
    enum status status = sql_first(&store->sql, &stmt, &found, err,
                                   "SELECT token_sha256, claimant, phase, state, EXISTS (SELECT 1 FROM attempts WHERE"
                                   " attempts.job_id = ?1 AND attempts.number = ?2 AND attempts.phase = 1) FROM remote"
                                   " JOIN jobs ON jobs.id = job_id WHERE job_id = ?1 AND part = 0 AND number = ?2",
                                   "in", key->job_id, key->number);
    if (status != STATUS_OK)
        return status;
    if (found) {
        found = sha256_equal(sql_text(stmt, 0), key->token_sha256);
        snprintf(claimant, REMOTE_CLAIMANT_SIZE, "%s", sql_text(stmt, 1));
        is_over = sqlite3_column_int(stmt, 2) == REMOTE_ENDED || sqlite3_column_int(stmt, 3) != JOB_RUNNING ||
                  !sqlite3_column_int(stmt, 4);
        sqlite3_reset(stmt);
    }
    return !found ? unknown(key, err) : is_over ? over(key, err) : STATUS_OK;
}

/* The same for who has claimed it. */
static enum status check_claim(struct store *store, const struct remote_key *key, struct error *err) {
    char claimant[REMOTE_CLAIMANT_SIZE];
    enum status status = check_token(store, key, claimant, err);
    if (status == STATUS_OK && (!claimant[0] || strcmp(claimant, key->claimant) != 0))
        status = error_set(err, STATUS_CONFLICT, "attempt %d of job %lld is %s", key->number, (long long)key->job_id,
                           claimant[0] ? "another's" : "not claimed yet");
    return status;
}

/* The end of a transaction in which something was heard of the node. */
static enum status heard(struct store *store, const struct remote_key *key, enum status status, int64_t changed_job,
                         struct error *err) {
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "UPDATE remote SET heard_ms = ?, heard_count = heard_count + 1"
                         " WHERE job_id = ? AND part = 0 AND number = ?",
                         "iin", store_now_ms(), key->job_id, key->number);
    status = store_end(store, status, changed_job, err);
    if (status == STATUS_OK)
        atomic_fetch_add(&store->remote.changes, 1);
    return status;
}

/* --- claims -------------------------------------------------------------------------------- */

static enum status take(struct store *store, const struct remote_key *key, const char *host, struct error *err) {
    enum status status =
        sql_run(&store->sql, err,
                "UPDATE remote SET phase = ?, claimant = ?, host = ?, claimed_ms = ?"
                " WHERE job_id = ? AND part = 0 AND number = ?",
                "nttiin", (int)REMOTE_CLAIMED, key->claimant, host, store_now_ms(), key->job_id, key->number);
    return status == STATUS_OK ? remote_tell_begun(store, key->job_id, err) : status;
}

/* A second one: that is noted, since it says that the site has started the attempt anew. */
static enum status turn_away(struct store *store, const struct remote_key *key, struct error *err) {
    enum status status = sql_run(&store->sql, err,
                                 "UPDATE remote SET refused_count = refused_count + 1"
                                 " WHERE job_id = ? AND part = 0 AND number = ?",
                                 "in", key->job_id, key->number);
    status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    if (status != STATUS_OK)
        return status;
    atomic_fetch_add(&store->remote.changes, 1);
    return error_set(err, STATUS_CONFLICT, "attempt %d of job %lld was claimed by another", key->number,
                     (long long)key->job_id);
}

enum status store_remote_claim(struct store *store, const struct remote_key *key, const char *host,
                               struct remote_row *row, struct error *err) {
    char claimant[REMOTE_CLAIMANT_SIZE];
    if (!key->claimant[0] || strlen(key->claimant) >= REMOTE_CLAIMANT_SIZE)
        return error_set(err, STATUS_INPUT, "a claimant has 1 to %d characters", REMOTE_CLAIMANT_SIZE - 1);
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = check_token(store, key, claimant, err);
    bool is_first = status == STATUS_OK && !claimant[0];
    if (status == STATUS_OK && !is_first && strcmp(claimant, key->claimant) != 0)
        return turn_away(store, key, err);
    if (is_first)
        status = take(store, key, host, err);
    if (status == STATUS_OK)
        status = remote_row_read(store, key->job_id, key->number, row, err);
    return heard(store, key, status, is_first ? key->job_id : STORE_NOTHING_CHANGED, err);
}

/* Inside a transaction. */
static enum status enter_end(struct store *store, const struct remote_key *key, const struct remote_end *end,
                             struct error *err) {
    return sql_run(&store->sql, err,
                   "UPDATE remote SET phase = ?, end_way = ?, end_code = ?, end_reason = ?, end_words = ?"
                   " WHERE job_id = ? AND part = 0 AND number = ?",
                   "ntnttin", (int)REMOTE_ENDED, end->way, end->code, end->reason, end->log_tail, key->job_id,
                   key->number);
}

enum status store_remote_refuse(struct store *store, const struct remote_key *key, const char *reason,
                                struct error *err) {
    char claimant[REMOTE_CLAIMANT_SIZE];
    struct remote_end end = {.way = "refused"};
    snprintf(end.reason, sizeof end.reason, "%s", reason);
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = check_token(store, key, claimant, err);
    if (status == STATUS_OK && claimant[0])
        return turn_away(store, key, err);
    if (status == STATUS_OK)
        status = enter_end(store, key, &end, err);
    return heard(store, key, status, STORE_NOTHING_CHANGED, err);
}

/* --- reports ------------------------------------------------------------------------------- */

/* Inside a transaction: whether the report `seq` is the next; one that was entered is not an error. */
static enum status place(const struct remote_key *key, const struct remote_row *row, int64_t seq, bool *is_next,
                         struct error *err) {
    *is_next = seq == row->last_seq + 1;
    return seq >= 1 && seq <= row->last_seq + 1
               ? STATUS_OK
               : error_set(err, STATUS_INPUT, "report %lld of attempt %d of job %lld does not follow %lld",
                           (long long)seq, key->number, (long long)key->job_id, (long long)row->last_seq);
}

static enum status enter_lines(struct store *store, const struct remote_key *key, int64_t seq, const char *lines,
                               struct error *err) {
    int64_t unread = 0;
    size_t length = strlen(lines);
    if (length == 0)
        return STATUS_OK;
    if (length > REMOTE_LINES_MAX || lines[length - 1] != '\n')
        return error_set(err, STATUS_INPUT, "a report is of complete lines, %d bytes at most", REMOTE_LINES_MAX);
    enum status status = sql_int(&store->sql, 0, &unread, err,
                                 "SELECT count(*) FROM attempt_lines WHERE job_id = ? AND part = 0 AND number = ?",
                                 "in", key->job_id, key->number);
    if (status == STATUS_OK && unread >= REMOTE_REPORTS_MAX)
        status = error_set(err, STATUS_LIMIT, "%d reports of this attempt are not read yet", REMOTE_REPORTS_MAX);
    return status == STATUS_OK
               ? sql_run(&store->sql, err, "INSERT INTO attempt_lines (job_id, number, seq, lines) VALUES (?, ?, ?, ?)",
                         "init", key->job_id, key->number, seq, lines)
               : status;
}

/* Inside a transaction: the report counts as entered. CPU time only grows. */
static enum status advance(struct store *store, const struct remote_key *key, int64_t seq, double cpu_sec,
                           struct error *err) {
    return sql_run(&store->sql, err,
                   "UPDATE remote SET last_seq = ?, cpu_sec = max(cpu_sec, ?)"
                   " WHERE job_id = ? AND part = 0 AND number = ?",
                   "idin", seq, isfinite(cpu_sec) ? cpu_sec : 0.0, key->job_id, key->number);
}

/* Inside a transaction: the reply to `seq`. A preview is asked for once: the first reply that says so has been received
 * when a later report comes. */
static enum status answer(struct store *store, const struct remote_key *key, struct remote_row *row, int64_t seq,
                          struct error *err) {
    int64_t told = 0;
    enum status status =
        sql_int(&store->sql, 0, &told, err, "SELECT told_seq FROM remote WHERE job_id = ? AND part = 0 AND number = ?",
                "in", key->job_id, key->number);
    if (status != STATUS_OK || row->wanted != REMOTE_PREVIEW)
        return status;
    if (told > 0 && seq > told)
        row->wanted = REMOTE_GO_ON;
    return sql_run(&store->sql, err,
                   "UPDATE remote SET wanted = ?, told_seq = ? WHERE job_id = ? AND part = 0 AND number = ?", "niin",
                   (int)row->wanted, row->wanted == REMOTE_GO_ON ? 0 : seq, key->job_id, key->number);
}

/* What reports and the end have in common, inside a transaction: who says it, what there is, where it belongs. */
static enum status look_at_report(struct store *store, const struct remote_key *key, int64_t seq,
                                  struct remote_row *row, bool *is_next, struct error *err) {
    enum status status = check_claim(store, key, err);
    if (status == STATUS_OK)
        status = remote_row_read(store, key->job_id, key->number, row, err);
    return status == STATUS_OK ? place(key, row, seq, is_next, err) : status;
}

static enum status report_once(struct store *store, const struct remote_key *key, int64_t seq, const char *lines,
                               double cpu_sec, struct remote_reply *reply, struct error *err) {
    struct remote_row row = {0};
    bool is_next = false;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = look_at_report(store, key, seq, &row, &is_next, err);
    if (status == STATUS_OK && is_next)
        status = enter_lines(store, key, seq, lines, err);
    if (status == STATUS_OK && is_next)
        status = advance(store, key, seq, cpu_sec, err);
    if (status == STATUS_OK)
        status = answer(store, key, &row, seq, err);
    *reply = (struct remote_reply){
        .wanted = row.wanted, .lease_sec = row.lease_sec, .last_seq = is_next ? seq : row.last_seq};
    return heard(store, key, status, STORE_NOTHING_CHANGED, err);
}

/* Keeps the lease and passes on what is wanted, and no more. */
static enum status keep_alive(struct store *store, const struct remote_key *key, int64_t seq,
                              struct remote_reply *reply, struct error *err) {
    struct remote_row row = {0};
    bool is_next;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = look_at_report(store, key, seq, &row, &is_next, err);
    *reply = (struct remote_reply){.wanted = row.wanted, .lease_sec = row.lease_sec, .last_seq = row.last_seq};
    return heard(store, key, status, STORE_NOTHING_CHANGED, err);
}

enum status store_remote_report(struct store *store, const struct remote_key *key, int64_t seq, const char *lines,
                                double cpu_sec, struct remote_reply *reply, struct error *err) {
    enum status status = report_once(store, key, seq, lines, cpu_sec, reply, err);
    if (status != STATUS_NO_SPACE)
        return status;
    do
        status = keep_alive(store, key, seq, reply, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

static enum status end_once(struct store *store, const struct remote_key *key, int64_t seq,
                            const struct remote_end *end, double cpu_sec, struct error *err) {
    struct remote_row row = {0};
    bool is_next = false;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    status = look_at_report(store, key, seq, &row, &is_next, err);
    if (status == STATUS_OK && !is_next)
        status = error_set(err, STATUS_INPUT, "report %lld was entered already, and was not the end", (long long)seq);
    if (status == STATUS_OK)
        status = advance(store, key, seq, cpu_sec, err);
    if (status == STATUS_OK)
        status = enter_end(store, key, end, err);
    return heard(store, key, status, STORE_NOTHING_CHANGED, err);
}

/* Whether this very claimant has entered this very end before, whose reply was lost. */
static bool is_repeated(struct store *store, const struct remote_key *key, int64_t seq) {
    int64_t same = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &same, NULL,
                                 "SELECT count(*) FROM remote WHERE job_id = ? AND part = 0 AND number = ? AND"
                                 " token_sha256 = ? AND claimant = ? AND last_seq = ? AND end_way <> ''",
                                 "intti", key->job_id, key->number, key->token_sha256, key->claimant, seq);
    store_unlock(store);
    return status == STATUS_OK && same > 0;
}

enum status store_remote_end(struct store *store, const struct remote_key *key, int64_t seq,
                             const struct remote_end *end, double cpu_sec, struct error *err) {
    static const char *const ways[] = {"exit", "signal", "memory", "lost", "refused", "preempted"};
    enum status status = STATUS_INPUT;
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++)
        if (strcmp(ways[i], end->way) == 0)
            status = STATUS_OK;
    if (status != STATUS_OK)
        return error_set(err, status, "an attempt does not end in the way \"%.16s\"", end->way);
    do
        status = end_once(store, key, seq, end, cpu_sec, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status == STATUS_CONFLICT && is_repeated(store, key, seq) ? STATUS_OK : status;
}

/* --- files --------------------------------------------------------------------------------- */

enum status store_remote_may_read(struct store *store, const struct remote_key *key, struct error *err) {
    store_lock(store);
    enum status status = check_claim(store, key, err);
    store_unlock(store);
    return status;
}

enum status store_remote_enter(struct store *store, const struct remote_key *key, struct error *err) {
    store_lock(store);
    enum status status = check_claim(store, key, err);
    if (status == STATUS_OK)
        remote_writer_add(store, key->job_id, key->number);
    store_unlock(store);
    return status;
}

void store_remote_leave(struct store *store, const struct remote_key *key) {
    store_lock(store);
    remote_writer_drop(store, key->job_id, key->number);
    store_unlock(store);
    atomic_fetch_add(&store->remote.changes, 1); /* the scheduler may wait for the last one */
}
