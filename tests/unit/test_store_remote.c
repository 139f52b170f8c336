/* test_store_remote.c -- attempts on other machines, as the store sees them: the fence, what is repeated, who comes
 * second, and that there is one end. */
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/store/internal.h"
#include "server/store/remote.h"
#include "tests/unit/store_rig.h"

#define TOKEN_A "1111111111111111111111111111111111111111111111111111111111111111"
#define TOKEN_B "2222222222222222222222222222222222222222222222222222222222222222"

static struct remote_row row;
static struct remote_reply reply;

/* A job whose attempt has begun to be submitted. */
static struct remote_key begin_attempt(struct store *store) {
    struct remote_key key = {.token_sha256 = TOKEN_A, .claimant = "aa"};
    key.job_id = add_job(store, SCENE_A, 0);
    OK(store_job_start(store, key.job_id, "slurm", &key.number, &err));
    struct remote_row new = {.job_id = key.job_id, .number = key.number, .executor = "slurm", .lease_sec = 60};
    snprintf(new.name, sizeof new.name, "unbake-%d-%d-abc", (int)key.job_id, key.number);
    OK(store_remote_begin(store, &new, TOKEN_A, &err));
    return key;
}

struct heard {
    const char *wanted; /* NULL: anything */
    int count;
};

static void hear(void *user, const char *lines) {
    struct heard *heard = user;
    for (const char *c = lines; *c; c++)
        heard->count += *c == '\n';
    CHECK_THAT(!heard->wanted || strstr(heard->wanted, lines) != NULL, "%s", lines);
}

static int count_lines(struct store *store, const struct remote_key *key, const char *wanted) {
    struct heard heard = {.wanted = wanted};
    while (store_remote_read(store, key->job_id, key->number, hear, &heard, &err) == STATUS_OK)
        ;
    return heard.count;
}

static void check_life(struct store *store) {
    struct remote_key key = begin_attempt(store);
    OK(store_remote_submitted(store, key.job_id, key.number, "4711", &err));
    OK(store_remote_explain(store, key.job_id, key.number, "Priority", &err));
    struct job job;
    OK(store_job_get(store, key.job_id, &job, &err));
    CHECK(strcmp(job.reason, "waiting in slurm: Priority") == 0);
    int64_t revision = job.revision;
    job_release(&job);
    OK(store_remote_explain(store, key.job_id, key.number, "Priority", &err));
    OK(store_job_get(store, key.job_id, &job, &err));
    CHECK(job.revision == revision);
    int64_t started_ms = job.started_ms;
    job_release(&job);
    usleep(5000); /* in the queue, which is no running time */

    uint64_t changes = store_remote_changes(store);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    CHECK(row.phase == REMOTE_CLAIMED && strcmp(row.host, "node7") == 0 && strcmp(row.external_id, "4711") == 0);
    CHECK(row.claimed_ms >= row.begun_ms && row.begun_ms > 0 && store_remote_changes(store) > changes);
    OK(store_job_get(store, key.job_id, &job, &err));
    CHECK(job.state == JOB_RUNNING && !job.reason[0]);
    CHECK(started_ms > 0 && job.started_ms >= started_ms + 5 && job.started_ms >= row.claimed_ms);
    CHECK(job.revision > revision);
    started_ms = job.started_ms;
    job_release(&job);
    usleep(5000);
    OK(store_remote_claim(store, &key, "node7", &row, &err)); /* its reply was lost */
    OK(store_job_get(store, key.job_id, &job, &err));
    CHECK(job.started_ms == started_ms);
    job_release(&job);
    OK(store_remote_submitted(store, key.job_id, key.number, "4711", &err)); /* its reply came late */
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.phase == REMOTE_CLAIMED);

    OK(store_remote_report(store, &key, 1, "one\ntwo\n", 1.5, &reply, &err));
    CHECK(reply.last_seq == 1 && reply.wanted == REMOTE_GO_ON && reply.lease_sec == 60);
    OK(store_remote_report(store, &key, 2, "", 2.5, &reply, &err));
    OK(store_remote_report(store, &key, 3, "three\n", 2.0, &reply, &err));
    CHECK(count_lines(store, &key, "one\ntwo\nthree\n") == 3);
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.last_seq == 3 && row.cpu_sec == 2.5 && row.heard_count == 5);
    struct remote_end end = {.way = "exit", .code = 0, .log_tail = "bye"};
    OK(store_remote_end(store, &key, 4, &end, 3.0, &err));
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.phase == REMOTE_ENDED && strcmp(row.end.way, "exit") == 0 && strcmp(row.end.log_tail, "bye") == 0);
    OK(store_job_succeed(store, key.job_id, key.number, "", &err));
}

/* The reply was lost, and the node says it again: the same reply, and nothing twice. */
static void check_repeated(struct store *store) {
    struct remote_key key = begin_attempt(store);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    CHECK(row.refused_count == 0);
    for (int i = 0; i < 3; i++) {
        OK(store_remote_report(store, &key, 1, "one\n", 1.0, &reply, &err));
        CHECK(reply.last_seq == 1);
    }
    OK(store_remote_report(store, &key, 2, "two\n", 1.0, &reply, &err));
    OK(store_remote_report(store, &key, 1, "one\n", 1.0, &reply, &err));
    CHECK(reply.last_seq == 2);
    IS(store_remote_report(store, &key, 4, "four\n", 1.0, &reply, &err), STATUS_INPUT);
    IS(store_remote_report(store, &key, 0, "none\n", 1.0, &reply, &err), STATUS_INPUT);
    IS(store_remote_report(store, &key, 3, "broken", 1.0, &reply, &err), STATUS_INPUT);
    CHECK(count_lines(store, &key, NULL) == 2);
    struct remote_end end = {.way = "signal", .code = 11}, other = {.way = "exit"}, odd = {.way = "whim"};
    IS(store_remote_end(store, &key, 2, &end, 1.0, &err), STATUS_INPUT);
    IS(store_remote_end(store, &key, 3, &odd, 1.0, &err), STATUS_INPUT);
    OK(store_remote_end(store, &key, 3, &end, 1.0, &err));
    OK(store_remote_end(store, &key, 3, &end, 1.0, &err));
    OK(store_remote_end(store, &key, 3, &other, 1.0, &err)); /* accepted as the same, without effect */
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(strcmp(row.end.way, "signal") == 0 && row.end.code == 11);
    IS(store_remote_end(store, &key, 4, &other, 1.0, &err), STATUS_CONFLICT);
    IS(store_remote_report(store, &key, 4, "late\n", 1.0, &reply, &err), STATUS_CONFLICT);
    CHECK(count_lines(store, &key, NULL) == 0);
    OK(store_job_crash(store, key.job_id, key.number, "x", "", 0, &err));
}

static void check_fence(struct store *store) {
    struct remote_key key = begin_attempt(store), wrong = key, second = key;
    wrong.token_sha256 = TOKEN_B;
    second.claimant = "bb";
    IS(store_remote_claim(store, &wrong, "x", &row, &err), STATUS_NOT_FOUND);
    IS(store_remote_report(store, &key, 1, "early\n", 0.0, &reply, &err), STATUS_CONFLICT);
    IS(store_remote_may_read(store, &key, &err), STATUS_CONFLICT);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    IS(store_remote_claim(store, &second, "node8", &row, &err), STATUS_CONFLICT);
    IS(store_remote_report(store, &second, 1, "two\n", 0.0, &reply, &err), STATUS_CONFLICT);
    IS(store_remote_report(store, &wrong, 1, "two\n", 0.0, &reply, &err), STATUS_NOT_FOUND);
    IS(store_remote_refuse(store, &second, "another version", &err), STATUS_CONFLICT);
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.refused_count == 2 && strcmp(row.host, "node7") == 0 && row.phase == REMOTE_CLAIMED);
    OK(store_remote_may_read(store, &key, &err));

    /* A writer that is at it when the attempt is given up is waited for; nobody begins to write after. */
    size_t writers;
    OK(store_remote_enter(store, &key, &err));
    OK(store_remote_enter(store, &key, &err));
    OK(store_remote_close(store, key.job_id, key.number, &writers, &err));
    CHECK(writers == 2);
    IS(store_remote_enter(store, &key, &err), STATUS_CONFLICT);
    store_remote_leave(store, &key);
    store_remote_leave(store, &key);
    OK(store_remote_close(store, key.job_id, key.number, &writers, &err));
    CHECK(writers == 0);
    IS(store_remote_report(store, &key, 1, "late\n", 0.0, &reply, &err), STATUS_CONFLICT);
    OK(store_job_lose(store, key.job_id, key.number, "silent", &err));

    /* The job goes on as another attempt: the former one's node has no say in it. */
    int number;
    OK(store_job_start(store, key.job_id, "slurm", &number, &err));
    struct remote_row new = {.job_id = key.job_id, .number = number, .executor = "slurm", .name = "n2", .lease_sec = 9};
    OK(store_remote_begin(store, &new, TOKEN_B, &err));
    IS(store_remote_report(store, &key, 1, "late\n", 0.0, &reply, &err), STATUS_CONFLICT);
    struct remote_end end = {.way = "exit"};
    IS(store_remote_end(store, &key, 1, &end, 0.0, &err), STATUS_CONFLICT);
    struct remote_key mixed = key;
    mixed.number = number; /* with the token of the first */
    IS(store_remote_claim(store, &mixed, "node7", &row, &err), STATUS_NOT_FOUND);
    /* However the attempt ends, its row ends with it. */
    OK(store_job_block(store, key.job_id, number, "full", "", &err));
    OK(store_remote_get(store, key.job_id, number, &row, &err));
    CHECK(row.phase == REMOTE_ENDED);
    new.number = number + 1;
    IS(store_remote_begin(store, &new, TOKEN_A, &err), STATUS_CONFLICT); /* it does not run */
}

static void check_wishes(struct store *store) {
    struct remote_key key = begin_attempt(store);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    OK(store_remote_request(store, key.job_id, key.number, REMOTE_PREVIEW, &err));
    OK(store_remote_report(store, &key, 1, "", 0.0, &reply, &err));
    CHECK(reply.wanted == REMOTE_PREVIEW);
    OK(store_remote_report(store, &key, 1, "", 0.0, &reply, &err)); /* that reply was lost */
    CHECK(reply.wanted == REMOTE_PREVIEW);
    OK(store_remote_report(store, &key, 2, "", 0.0, &reply, &err));
    CHECK(reply.wanted == REMOTE_GO_ON);
    OK(store_remote_request(store, key.job_id, key.number, REMOTE_STOP, &err));
    OK(store_remote_request(store, key.job_id, key.number, REMOTE_PREVIEW, &err));
    for (int64_t seq = 3; seq < 5; seq++) {
        OK(store_remote_report(store, &key, seq, "", 0.0, &reply, &err));
        CHECK(reply.wanted == REMOTE_STOP);
    }
    OK(store_remote_request(store, key.job_id, key.number, REMOTE_CANCEL, &err));
    OK(store_remote_report(store, &key, 5, "", 0.0, &reply, &err));
    CHECK(reply.wanted == REMOTE_CANCEL && strcmp(remote_request_name(reply.wanted), "cancel") == 0);
    OK(store_job_stop(store, key.job_id, key.number, "", &err));
}

static void check_refused(struct store *store) {
    struct remote_key key = begin_attempt(store);
    OK(store_remote_refuse(store, &key, "the node has version 1", &err));
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.phase == REMOTE_ENDED && strcmp(row.end.way, "refused") == 0 && row.end.reason[0]);
    IS(store_remote_claim(store, &key, "node7", &row, &err), STATUS_CONFLICT);
    OK(store_job_block(store, key.job_id, key.number, "refused", "", &err));
}

static void check_limit_and_list(struct store *store) {
    struct remote_key key = begin_attempt(store);
    struct remote_row *rows;
    size_t count;
    OK(store_remote_list(store, "slurm", &rows, &count, &err));
    CHECK(count == 1 && rows[0].job_id == key.job_id && rows[0].phase == REMOTE_SUBMITTING);
    mem_free(rows);
    OK(store_remote_list(store, "pbs", &rows, &count, &err));
    CHECK(count == 0 && !rows);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    int64_t seq = 1;
    while (store_remote_report(store, &key, seq, "line\n", 0.0, &reply, &err) == STATUS_OK)
        seq++;
    CHECK(err.status == STATUS_LIMIT && seq == REMOTE_REPORTS_MAX + 1);
    OK(store_remote_report(store, &key, seq, "", 0.0, &reply, &err)); /* without lines it lives on */
    CHECK(count_lines(store, &key, NULL) == REMOTE_REPORTS_MAX);
    OK(store_job_cancel(store, key.job_id, &err));
    OK(store_job_stop(store, key.job_id, key.number, "", &err));
    OK(store_remote_list(store, NULL, &rows, &count, &err));
    CHECK(count == 0);
    OK(store_job_delete(store, key.job_id, &err));
    IS(store_remote_report(store, &key, seq + 1, "late\n", 0.0, &reply, &err), STATUS_NOT_FOUND);
}

/* Makes the disk full for the store, or gives it room again. */
static void fill_disk(struct store *store, bool is_full) {
    static int64_t cushion;
    cushion = is_full ? store->reserve.cushion_bytes : cushion;
    store->reserve.cushion_bytes = is_full ? INT64_C(1) << 60 : cushion; /* no disk has that */
    reserve_after_commit(store);
    CHECK(store->reserve.is_tight == is_full);
}

/* On a full disk a node lives on, hears what is wanted, and may end. */
static void check_full(struct store *store) {
    struct remote_key key = begin_attempt(store);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    OK(store_remote_report(store, &key, 1, "one\n", 0.0, &reply, &err));
    fill_disk(store, true);
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    int64_t heard = row.heard_count;
    OK(store_remote_request(store, key.job_id, key.number, REMOTE_STOP, &err));
    OK(store_remote_report(store, &key, 2, "two\n", 0.0, &reply, &err));
    CHECK(reply.last_seq == 1 && reply.wanted == REMOTE_STOP && reply.lease_sec == 60);
    OK(store_remote_get(store, key.job_id, key.number, &row, &err));
    CHECK(row.heard_count == heard + 1);
    IS(store_remote_report(store, &key, 3, "gap\n", 0.0, &reply, &err), STATUS_INPUT);
    struct remote_end end = {.way = "exit", .code = 85};
    OK(store_remote_end(store, &key, 2, &end, 0.0, &err)); /* the number has not been taken */
    CHECK(count_lines(store, &key, "one\n") == 1);
    fill_disk(store, false);
    OK(store_job_stop(store, key.job_id, key.number, "", &err));

    key = begin_attempt(store);
    OK(store_remote_claim(store, &key, "node7", &row, &err));
    fill_disk(store, true);
    OK(store_remote_report(store, &key, 1, "one\n", 0.0, &reply, &err));
    CHECK(reply.last_seq == 0);
    fill_disk(store, false);
    OK(store_remote_report(store, &key, 1, "one\n", 0.0, &reply, &err));
    CHECK(reply.last_seq == 1 && count_lines(store, &key, "one\n") == 1);
    OK(store_job_stop(store, key.job_id, key.number, "", &err));
}

/* --- each line once, whenever the daemon dies ------------------------------------------------ */

struct entering {
    struct store *store;
    struct remote_key key;
    int left; /* lines until this process dies; negative: it does not */
};

/* Enters each line as an event. One that is not entered does not undo the others. */
static void enter(void *user, const char *lines) {
    struct entering *e = user;
    for (const char *at = lines, *end; (end = strchr(at, '\n')) != NULL; at = end + 1) {
        char *data = mem_strndup(at, (size_t)(end - at));
        if (e->left-- == 0)
            _exit(0);
        IS(store_event_add(e->store, e->key.job_id, e->key.number + 1, EVENT_LOG, data, &err), STATUS_CONFLICT);
        OK(store_event_add(e->store, e->key.job_id, e->key.number, EVENT_LOG, data, &err));
        mem_free(data);
    }
}

static void join_line(void *user, const struct event_row *event) {
    if (strcmp(event->type, EVENT_LOG) == 0)
        buf_printf(user, "%s", event->data);
}

static void check_killed(struct store **store, const char *dir) {
    for (int left = 0; left < 7; left++) {
        struct entering e = {.key = begin_attempt(*store), .left = left};
        OK(store_remote_claim(*store, &e.key, "node7", &row, &err));
        OK(store_remote_report(*store, &e.key, 1, "1\n2\n3\n", 0.0, &reply, &err));
        OK(store_remote_report(*store, &e.key, 2, "4\n5\n6\n", 0.0, &reply, &err));
        store_close(*store);
        pid_t child = fork();
        if (child == 0) {
            OK(store_open(&e.store, dir, &err));
            while (store_remote_read(e.store, e.key.job_id, e.key.number, enter, &e, &err) == STATUS_OK)
                ;
            _exit(check_failed_count > 0);
        }
        int code = 1;
        CHECK(waitpid(child, &code, 0) == child && code == 0);
        OK(store_open(store, dir, &err));
        e.store = *store;
        e.left = -1;
        while (store_remote_read(*store, e.key.job_id, e.key.number, enter, &e, &err) == STATUS_OK)
            ;
        struct buf lines;
        struct event_page page;
        buf_init(&lines, 4096);
        OK(store_event_page(*store, NULL, e.key.job_id, 0, 100, 1 << 20, join_line, &lines, &page, &err));
        CHECK_THAT(strcmp(buf_text(&lines), "123456") == 0, "killed at line %d: %s", left, buf_text(&lines));
        buf_release(&lines);
    }
}

int main(void) {
    struct store *store;
    char *dir = fresh_dir();
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    check_life(store);
    check_repeated(store);
    check_fence(store);
    check_wishes(store);
    check_refused(store);
    check_limit_and_list(store);
    check_full(store);
    check_killed(&store, dir);
    store_close(store);
    drop_dir(dir);
    return check_result();
}
