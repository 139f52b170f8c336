/* test_http_webhook.c -- who sees a job's webhook, which secrets it may have, and that its messages can be sent
 * again. */
#include "tests/api/rig.h"

static struct rig rig;
static struct error err;

static int ask(const char *token, const char *line, const char *body, struct buf *reply) {
    char *text = mem_printf("%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer %s\r\n"
                            "Content-Type: application/json\r\nContent-Length: %zu\r\n\r\n%s",
                            line, token, strlen(body), body);
    int status = rig_ask(&rig, text, strlen(text), reply);
    mem_free(text);
    return status;
}

static void expect(const char *token, const char *line, const char *body, int wanted, const char *there,
                   const char *not_there) {
    struct buf reply;
    int status = ask(token, line, body, &reply);
    CHECK_THAT(status == wanted && strstr(buf_text(&reply), there) && !strstr(buf_text(&reply), not_there),
               "%s: %d, not %d with %s: %s", line, status, wanted, there, buf_text(&reply));
    buf_release(&reply);
}

#define JOB(more) "{\"scene\":\"" RIG_SCENE "\"" more "}"
#define HOOK(secret) ",\"webhook\":{\"url\":\"https://lab.example.org/hook?token=abc\",\"secret\":\"" secret "\"}"
#define SECRET "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"

int main(void) {
    char anna[TOKEN_SIZE], bert[TOKEN_SIZE], chief[TOKEN_SIZE];
    int64_t id;
    bool existed;
    struct caller who;
    rig_start(&rig, &rig_patient, 60);
    log_set_level(LOG_ERROR);
    rig_must(store_token_add(rig.store, "anna", ROLE_USER, 0, anna, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "bert", ROLE_USER, 0, bert, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "chief", ROLE_ADMIN, 0, chief, &id, &err), &err, "token");
    rig_must(store_token_find(rig.store, anna, &who, &err), &err, "token");
    rig_must(store_scene_add(rig.store, RIG_SCENE, "room", 10, who.user_id, &existed, &err), &err, "store_scene_add");
    rig_must(store_scene_ready(rig.store, RIG_SCENE, NULL, "{}", &err), &err, "store_scene_ready");

    expect(anna, "POST /v1/jobs", JOB(HOOK("whsec_c2hvcnQgYnV0IGxvbmc=")), 422, "base64 of 24 to 64 bytes",
           "token=abc");
    expect(anna, "POST /v1/jobs", JOB(HOOK("whsec_not base64 at all, is it")), 422, "base64 of 24 to 64 bytes",
           "token=abc");
    expect(anna, "POST /v1/jobs", JOB(",\"shared\":true" HOOK(SECRET)), 201, "token=abc", SECRET);
    expect(anna, "POST /v1/jobs", JOB(HOOK("a secret of another form")), 201, "token=abc", "another form");
    expect(anna, "POST /v1/jobs", JOB(""), 201, "\"has_webhook\":false", "token=abc");

    /* A shared job's URL is its owner's, and admins'. */
    expect(anna, "GET /v1/jobs/1", "", 200, "token=abc", SECRET);
    expect(chief, "GET /v1/jobs/1", "", 200, "token=abc", SECRET);
    expect(bert, "GET /v1/jobs/1", "", 200, "\"has_webhook\":true", "token=abc");
    expect(bert, "GET /v1/jobs", "", 200, "\"webhook_delivery\":null", "token=abc");
    expect(bert, "GET /v1/jobs/1?wait=1", "", 200, "\"has_webhook\":true", "token=abc");
    expect(bert, "GET /v1/jobs/1/events?follow=0&after=0", "", 200, "\"has_webhook\":true", "token=abc");
    expect(anna, "GET /v1/jobs/1/events?follow=0&after=0", "", 200, "token=abc", SECRET);

    expect(anna, "GET /v1/jobs/1", "", 200, "\"state\":\"idle\"", SECRET);
    expect(bert, "POST /v1/jobs/1/webhook/redeliver", "", 403, "", "token=abc");
    expect(anna, "POST /v1/jobs/3/webhook/redeliver", "", 409, "has no webhook", "token=abc");
    expect(anna, "POST /v1/jobs/1/webhook/redeliver", "", 202, "\"state\":\"pending\",\"pending\":1", SECRET);
    struct outbox_row row;
    rig_must(store_outbox_next(rig.store, 0, NULL, 0, &row, &err), &err, "store_outbox_next");
    CHECK(row.job_id == 1 && row.owner_id == who.user_id && strstr(row.body, "\"state\":\"queued\""));
    outbox_row_release(&row);
    rig_stop(&rig);
    return check_result();
}
