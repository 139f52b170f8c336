/* store_steps.h -- everything that the store can be asked, as steps in an order in which each of them has something to
 * do: the life of some scenes, uploads, jobs, tokens and messages. For tests that let a call fail in the middle of
 * each. */
#ifndef UNBAKE_TESTS_UNIT_STORE_STEPS_H
#define UNBAKE_TESTS_UNIT_STORE_STEPS_H

#include <limits.h>

#include "common/sha256.h"
#include "server/store/internal.h"
#include "tests/unit/store_rig.h"

#define UPLOAD "0123456789abcdef0123456789abcdef"
#define UPLOAD_B "fedcba9876543210fedcba9876543210"

/* --- what is asked, in this order -------------------------------------------------------------- */

static struct store *store;
static char *dir;
static int64_t job, second_job, token_id;
static int attempt;
static char token[TOKEN_SIZE];
static struct caller alice;

/* Where the answer is no status: the right one, or that of doubt. */
static enum status doubt(bool is_right) {
    return is_right ? STATUS_OK : error_set(&err, sql_fault->status, "it does not know");
}

static enum status add_scene(void) {
    bool existed;
    return store_scene_add(store, SCENE_A, "room", 10, alice.user_id, &existed, &err);
}
static enum status add_other_scene(void) {
    bool existed;
    return store_scene_add(store, SCENE_B, "other", 10, 0, &existed, &err);
}
static enum status next_unchecked(void) {
    struct unchecked one;
    size_t count;
    return store_scene_unchecked(store, NULL, 0, 1, &one, &count, &err);
}
static enum status postpone(void) { return store_scene_postpone(store, SCENE_A, NULL, "[{\"file\":\"a\"}]", &err); }
static enum status check_again(void) { return store_scene_check_again(store, &err); }
static enum status reject(void) { return store_scene_reject(store, SCENE_A, NULL, "[{\"file\":\"a\"}]", "{}", &err); }
static enum status ready(void) { return store_scene_ready(store, SCENE_A, NULL, "{}", &err); }
static enum status other_ready(void) { return store_scene_ready(store, SCENE_B, NULL, "{}", &err); }
static enum status get_scene(void) {
    struct scene_row row;
    enum status status = store_scene_get(store, SCENE_A, &row, &err);
    scene_row_release(&row);
    return status;
}
static enum status find_scene(void) {
    struct scene_row row;
    enum status status = store_scene_find(store, &alice, "aaaa", &row, &err);
    scene_row_release(&row);
    return status;
}
static enum status list_scenes(void) {
    struct scene_row rows[1];
    char cursor[128];
    size_t count;
    enum status status = store_scene_list(store, NULL, "", 1, rows, &count, cursor, &err);
    CHECK(status == STATUS_OK || count == 0);
    for (size_t i = 0; i < count; i++)
        scene_row_release(&rows[i]);
    return status;
}
static enum status patch_scene(void) {
    const struct scene_patch patch = {.name = "named", .retention = {.sets_expiry = true, .expires_ms = 1}};
    return store_scene_patch(store, &alice, SCENE_A, &patch, &err);
}
static enum status read_scene_otherwise(void) {
    return store_scene_patch(store, &alice, SCENE_A, &(struct scene_patch){.reading = "{\"axes\":\"opencv\"}"}, &err);
}
static enum status tell_overtaken(void) { return store_scene_set_facts(store, SCENE_A, "{}", "{\"a\":1}", &err); }
static enum status tell_checking(void) { return store_scene_set_facts(store, SCENE_A, NULL, "{\"b\":2}", &err); }
static enum status conclude_overtaken(void) { return store_scene_ready(store, SCENE_A, "{}", "{}", &err); }
static enum status access_scene(void) {
    enum access access;
    return store_scene_access(store, &(struct caller){.user_id = 77, .role = ROLE_USER}, SCENE_A, &access, &err);
}
static enum status would_delete_scene(void) {
    bool is_gone;
    return store_scene_delete(store, SCENE_B, 0, true, &is_gone, &err);
}
static enum status disown_scene(void) {
    bool is_gone;
    return store_scene_delete(store, SCENE_A, 0, false, &is_gone, &err);
}
static enum status delete_scene(void) {
    bool is_gone;
    return store_scene_delete(store, SCENE_B, -1, false, &is_gone, &err);
}
static enum status share_scene(void) {
    bool existed;
    return store_scene_add(store, SCENE_A, "room", 10, 0, &existed, &err);
}

static enum status add_token(void) { return store_token_add(store, "alice", ROLE_USER, 0, token, &token_id, &err); }
static enum status find_token(void) { return store_token_find(store, token, &alice, &err); }
static enum status valid_token(void) { return doubt(store_token_is_valid(store, token_id)); }
static enum status list_tokens(void) {
    struct token_row *rows;
    size_t count;
    enum status status = store_token_list(store, &rows, &count, &err);
    mem_free(rows);
    return status;
}
static enum status revoke_number(void) {
    size_t count;
    char number[24];
    snprintf(number, sizeof number, "%lld", (long long)token_id);
    return store_token_revoke(store, number, &count, &err);
}
static enum status revoke_name(void) {
    size_t count;
    return store_token_revoke(store, "alice", &count, &err);
}
static enum status user_bytes(void) {
    uint64_t bytes;
    return store_user_bytes(store, alice.user_id, NULL, 0, &bytes, &err);
}

static enum status check_share(void) {
    return store_share_check(store, &(struct share){.limit_bytes = 1 << 20, .user_id = alice.user_id}, 10, &err);
}
static enum status check_scene_share(void) { return store_share_check_scene(store, SCENE_A, 10, 1 << 20, &err); }
static enum status enter_disk(void) {
    const struct disk_use list[] = {{.job_id = job, .bytes = 10}, {.scene_id = SCENE_A, .bytes = 10}};
    return store_disk_enter(store, list, 2, &err);
}
static enum status unknown_disk(void) {
    struct disk_use list[4];
    size_t count;
    return store_disk_unknown(store, 0, 4, list, &count, &err);
}

static enum status submit(void) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .owner_id = alice.user_id,
                          .max_attempts = 9,
                          .user_queue_limit = 9,
                          .user_max_jobs = 9,
                          .webhook_url = "http://x/",
                          .webhook_secret = "s",
                          .idempotency_key = "key",
                          .request_sha256 = "hash"};
    bool replayed;
    return store_job_add(store, &new, 9, &job, &replayed, &err);
}
static enum status submit_second(void) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .owner_id = alice.user_id,
                          .max_attempts = 1};
    bool replayed;
    return store_job_add(store, &new, 9, &second_job, &replayed, &err);
}
/* He keeps as many as he may. */
static enum status submit_too_many(void) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .owner_id = alice.user_id,
                          .max_attempts = 1,
                          .user_max_jobs = 2};
    bool replayed;
    int64_t none;
    enum status status = store_job_add(store, &new, 9, &none, &replayed, &err);
    return status == STATUS_NO_SPACE && strstr(err.message, "may keep 2") ? STATUS_OK : status;
}
static enum status get_job(void) {
    struct job row;
    enum status status = store_job_get(store, job, &row, &err);
    job_release(&row);
    return status;
}
static enum status list_by(int state) {
    struct job rows[4];
    size_t count;
    enum status status =
        store_job_list(store, &alice, &(struct job_filter){.state = state, .kind = -1}, 0, 4, rows, &count, &err);
    CHECK(status == STATUS_OK || count == 0);
    for (size_t i = 0; i < count; i++)
        job_release(&rows[i]);
    return status;
}
static enum status list_jobs(void) { return list_by(-1); }
static enum status list_queued(void) { return list_by(JOB_QUEUED); }
static enum status place(enum job_place place) {
    struct job_patch patch = {.name = "m", .priority = INT_MIN, .shared = -1, .place = place, .before_id = second_job};
    return store_job_patch(store, job, -1, &patch, &err);
}
static enum status place_first(void) { return place(JOB_PLACE_FIRST); }
static enum status place_last(void) { return place(JOB_PLACE_LAST); }
static enum status place_before(void) { return place(JOB_PLACE_BEFORE); }
static enum status next_job(void) {
    int64_t id;
    return store_job_next(store, 1, NULL, &id, &err);
}
static enum status running_jobs(void) {
    struct running list[4];
    size_t count;
    return store_job_running(store, 4, list, &count, &err);
}
static enum status cancel_job(void) { return store_job_cancel(store, job, &err); }
static enum status pause_job(void) { return store_job_pause(store, job, &err); }
static enum status resume_job(void) { return store_job_resume(store, job, &(struct count_limits){9, 9}, &err); }
static enum status retry_job(void) {
    return store_job_retry(store, job, 9, "refine", &(struct count_limits){9, 9}, &err);
}
static enum status extend_job(void) { return store_job_extend(store, job, 9, "{}", NULL, &err); }
static enum status start_job(void) { return store_job_start(store, job, "process", &attempt, &err); }
static enum status restarted_job(void) { return store_job_restarted(store, job, attempt, &err); }
static enum status crash_job(void) { return store_job_crash(store, job, attempt, "why", "hint", 1, &err); }
static enum status stop_job(void) { return store_job_stop(store, job, attempt, "why", &err); }
static enum status block_job(void) { return store_job_block(store, job, attempt, "why", "hint", &err); }
static enum status fail_job(void) { return store_job_fail(store, job, attempt, "why", "hint", &err); }
static enum status succeed_job(void) { return store_job_succeed(store, job, attempt, "", &err); }
static enum status delete_job(void) { return store_job_delete(store, second_job, &err); }
static enum status explain(void) { return store_job_explain(store, 0, "it waits", "", "", &err); }
static enum status explain_no_more(void) { return store_job_explain(store, 0, "", "it", "", &err); }
static enum status reconcile(void) {
    size_t requeued;
    return store_reconcile(store, NULL, 0, &requeued, &err);
}
static enum status pay(void) {
    store->unpaid = mem_realloc_array(store->unpaid, 1, sizeof *store->unpaid);
    store->unpaid[0] = (struct unpaid){alice.user_id, "2026-01", 100.0, 1.0};
    store->unpaid_count = 1;
    return store_usage_pay(store, &err);
}
static enum status charge(void) { return store_usage_add(store, alice.user_id, 3.0, &err); }

static enum status progress(void) {
    return store_event_add(store, job, attempt, EVENT_PROGRESS, "{\"stage\":\"refine\",\"done\":1,\"total\":2}", &err);
}
static enum status many_events(void) { /* every 64th removes old ones */
    enum status status = STATUS_OK;
    for (int i = 0; i < 64 && status == STATUS_OK; i++)
        status = store_event_add(store, job, attempt, EVENT_LOG, "{}", &err);
    return status;
}
static void no_event(void *user, int64_t id, int64_t at_ms, int number, const char *type, const char *data) {
    (void)user, (void)id, (void)at_ms, (void)number, (void)type, (void)data;
}
static void no_row(void *user, const struct event_row *row) { (void)user, (void)row; }
static enum status list_events(void) { return store_event_list(store, job, 0, 9, no_event, NULL, &err); }
static enum status page_of(const struct caller *who, int64_t id) {
    struct event_page page;
    return store_event_page(store, who, id, 0, 1000, 1 << 20, no_row, NULL, &page, &err);
}
static enum status page_of_job(void) { return page_of(&alice, job); }
static enum status page_of_all(void) { return page_of(NULL, 0); }
static enum status page_of_mine(void) { return page_of(&alice, 0); }
static enum status last_event_of_job(void) {
    int64_t id;
    return store_event_last(store, job, &id, &err);
}
static enum status last_event_of_all(void) {
    int64_t id;
    return store_event_last(store, 0, &id, &err);
}
static enum status newest_event(void) {
    int64_t id;
    return store_event_newest(store, &id, &err);
}
static enum status prune_events(void) {
    bool more;
    return store_event_prune(store, INT64_MAX, &more, &err);
}

static enum status put_output(void) {
    return store_output_put(store, job, attempt, EVENT_OUTPUT, "a.png", 3, SCENE_A, "image/png", &err);
}
static enum status get_output(void) {
    struct output_row row;
    enum status status = store_output_get(store, job, "a.png", &row, &err);
    output_row_release(&row);
    return status;
}
static enum status want_digest(void) { return store_output_want_digest(store, job, "a.png", &err); }
static enum status next_digest(void) {
    struct output_row row;
    int64_t id;
    enum status status = store_output_next_digest(store, &id, &row, &err);
    output_row_release(&row);
    return status;
}
static enum status enter_digest(void) {
    struct output_row row;
    const struct file_version version = {.inode = 7, .bytes = 3};
    enum status status = store_output_get(store, job, "a.png", &row, &err);
    if (status == STATUS_OK)
        status = store_output_enter_digest(store, job, &row, &version, SCENE_A, &err);
    output_row_release(&row);
    return status;
}
static enum status list_outputs(void) {
    struct output_row *rows;
    size_t count;
    enum status status = store_output_list(store, job, &rows, &count, &err);
    CHECK(status == STATUS_OK || (count == 0 && !rows));
    for (size_t i = 0; i < count; i++)
        output_row_release(&rows[i]);
    mem_free(rows);
    return status;
}

static enum status next_message(void) {
    struct outbox_row row;
    enum status status = store_outbox_next(store, 0, NULL, 0, &row, &err);
    outbox_row_release(&row);
    return status;
}
static enum status settle(bool delivered) {
    bool gave_up;
    return store_outbox_settle(
        store, 1, &(struct outbox_outcome){.delivered = delivered, .reason = delivered ? NULL : "no"}, &gave_up, &err);
}
static enum status put_off(void) { return settle(false); }
static enum status delivered(void) { return settle(true); }
static enum status wait_for_message(void) {
    double seconds;
    return store_outbox_wait(store, &seconds, &err);
}

static enum status add_upload_of(const char *id) {
    struct upload_row row = {.owner_id = alice.user_id, .name = (char[]){"u"}, .metadata = (char[]){""}, .length = 10};
    snprintf(row.id, sizeof row.id, "%s", id);
    return store_upload_add(store, &row, "hash", 4, &(struct count_limits){9, 9}, &err);
}
static enum status add_upload(void) { return add_upload_of(UPLOAD); }
static enum status add_other_upload(void) { return add_upload_of(UPLOAD_B); }
static enum status get_upload(void) {
    struct upload_row row;
    char hash[4];
    enum status status = store_upload_get(store, UPLOAD, &row, hash, sizeof hash, &err);
    upload_row_release(&row);
    return status;
}
static enum status list_uploads(void) {
    struct upload_row rows[1];
    char cursor[128];
    size_t count;
    enum status status = store_upload_list(store, &alice, "", "", 1, rows, &count, cursor, &err);
    CHECK(status == STATUS_OK || count == 0);
    for (size_t i = 0; i < count; i++)
        upload_row_release(&rows[i]);
    return status;
}
static enum status begin_upload(void) { return store_upload_begin(store, UPLOAD, "boot", &err); }
static enum status advance_upload(void) { return store_upload_advance(store, UPLOAD, 7, "mesh", 4, &err); }
static enum status finish_upload(void) { return store_upload_finish(store, UPLOAD, SCENE_A, &err); }
static enum status keep_upload(void) {
    return store_upload_set_retention(store, UPLOAD, &(struct retention){.pin = KEEP_PIN_ON}, &err);
}
static enum status delete_upload(void) { return store_upload_delete(store, UPLOAD, &err); }

static enum status keep(void) { return store_retention_set_periods(store, 1, 1, 1, &err); }
static enum status list_expired(void) {
    struct expired *list;
    size_t count;
    enum status status = store_expired_list(store, INT64_MAX, 9, &list, &count, &err);
    for (size_t i = 0; i < count; i++)
        mem_free(list[i].name);
    mem_free(list);
    return status;
}
static enum status expire(enum expired_kind what, const char *id) {
    struct expired expired = {.kind = what};
    snprintf(expired.id, sizeof expired.id, "%s", id);
    return store_expired_delete(store, &expired, INT64_MAX, &err);
}
static enum status expire_upload(void) { return expire(EXPIRED_UPLOAD, UPLOAD_B); }
static enum status expire_scene(void) { return expire(EXPIRED_SCENE, SCENE_A); }
static enum status expire_job(void) {
    char id[24];
    snprintf(id, sizeof id, "%lld", (long long)job);
    return expire(EXPIRED_JOB, id);
}

static enum status probe(void) { return store_probe(store, &err); }
static enum status count(void) {
    struct store_counts counts;
    return store_count(store, &counts, &err);
}
static enum status has_files(void) { return doubt(!store_has_files(store, STORE_FILES_JOB, "nobody's")); }
static enum status back_up(void) {
    char *path = file_join(dir, "copy");
    unlink(path);
    enum status status = store_backup(store, path, &err);
    mem_free(path);
    return status;
}
static enum status look_for_users(void) { return store_load_has_users(store, &err); }

static const struct step {
    const char *name;
    enum status (*ask)(void);
    enum { IS_ONE, IS_MANY /* transactions */, IS_VAGUE /* another failure is told than SQLite's */ } kind;
} steps[] = {
#define STEP(function)                                                                                                 \
    { #function, function, IS_ONE }
#define STEPS(function)                                                                                                \
    { #function, function, IS_MANY }
    STEP(probe),
    STEP(has_files),
    STEP(look_for_users),
    STEP(add_token),
    STEP(find_token),
    STEP(valid_token),
    STEP(list_tokens),
    STEP(keep),
    STEP(add_scene),
    STEP(add_other_scene),
    STEP(next_unchecked),
    STEP(postpone),
    STEP(check_again),
    STEP(reject),
    STEP(add_scene),
    STEP(ready),
    STEP(read_scene_otherwise),
    STEP(tell_overtaken),
    STEP(tell_checking),
    STEP(conclude_overtaken),
    STEP(ready),
    STEP(other_ready),
    STEP(get_scene),
    STEP(find_scene),
    STEP(list_scenes),
    STEP(patch_scene),
    STEP(access_scene),
    STEP(user_bytes),
    STEP(check_share),
    STEP(check_scene_share),
    STEP(would_delete_scene),
    STEP(add_upload),
    STEP(add_other_upload),
    STEP(get_upload),
    STEP(list_uploads),
    STEP(begin_upload),
    STEP(advance_upload),
    STEP(finish_upload),
    STEP(keep_upload),
    STEP(delete_upload),
    STEP(list_expired),
    STEP(expire_upload),
    STEP(submit),
    STEP(submit),
    STEP(submit_second),
    STEP(submit_too_many),
    STEP(unknown_disk),
    STEP(enter_disk),
    STEP(get_job),
    STEP(list_jobs),
    STEP(list_queued),
    STEP(place_first),
    STEP(place_last),
    STEP(place_before),
    STEP(count),
    STEP(next_job),
    STEP(pause_job),
    STEP(resume_job),
    STEPS(explain),
    STEPS(explain_no_more),
    STEP(start_job),
    STEP(progress),
    STEP(progress),
    STEPS(many_events),
    STEP(put_output),
    STEP(get_output),
    STEP(list_outputs),
    STEP(next_digest),
    STEP(enter_digest),
    STEP(want_digest),
    STEP(list_events),
    STEP(page_of_job),
    STEP(page_of_all),
    STEP(page_of_mine),
    STEP(last_event_of_job),
    STEP(last_event_of_all),
    STEP(newest_event),
    STEP(running_jobs),
    STEP(charge),
    STEP(charge),
    STEP(pay),
    STEP(next_message),
    STEP(put_off),
    STEP(wait_for_message),
    STEP(delivered),
    STEP(crash_job),
    STEP(start_job),
    STEP(stop_job),
    STEP(start_job),
    STEP(block_job),
    STEP(resume_job),
    STEP(start_job),
    STEP(pause_job),
    STEP(resume_job),
    STEPS(reconcile),
    STEP(start_job),
    STEP(fail_job),
    STEP(retry_job),
    STEP(start_job),
    STEP(restarted_job),
    STEP(cancel_job),
    STEP(stop_job),
    STEP(extend_job),
    STEP(cancel_job),
    STEP(retry_job),
    STEP(start_job),
    STEP(succeed_job),
    STEP(prune_events),
    STEP(list_expired),
    STEP(expire_job),
    STEP(delete_job),
    STEP(share_scene),
    STEP(disown_scene),
    STEP(expire_scene),
    STEP(delete_scene),
    STEP(revoke_number),
    STEP(add_token),
    STEP(revoke_name),
    {"back_up", back_up, IS_VAGUE},
};

#endif
