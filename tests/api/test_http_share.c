/* test_http_share.c -- a user's share: what passes it is refused, to this user only. */
#include "tests/api/rig.h"

static int send_as(const struct rig *rig, const char *token, const char *request, size_t length, struct buf *reply) {
    char *text = mem_printf("%s\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer %s\r\n"
                            "Content-Length: %zu\r\n\r\n",
                            request, token, length);
    size_t head = strlen(text);
    text = mem_realloc_array(text, head + length + 1, 1);
    memset(text + head, ' ', length);
    memcpy(text + head, "{\"scene\":\"" RIG_SCENE "\"}", length < 76 ? length : 76);
    int status = rig_ask(rig, text, head + length, reply);
    mem_free(text);
    return status;
}

/* In chunks, so that nobody knows how many bytes come: those of send_as. */
static int send_chunked(const struct rig *rig, const char *token, size_t length, char filling, struct buf *reply) {
    char *text = mem_printf("POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                            "Authorization: Bearer %s\r\nTransfer-Encoding: chunked\r\n\r\n%zx\r\n",
                            token, length);
    size_t head = strlen(text);
    text = mem_realloc_array(text, head + length + 7, 1);
    memset(text + head, filling, length);
    memcpy(text + head, "{\"scene\":\"" RIG_SCENE "\"}", 76);
    memcpy(text + head + length, "\r\n0\r\n\r\n", 7);
    int status = rig_ask(rig, text, head + length + 7, reply);
    mem_free(text);
    return status;
}

/* Two bodies of which there is room for one. Where the lengths are known, the second is refused before it is sent; else
 * both begin, and the first that is whole gets the room. */
static void test_two_at_once(const struct rig *rig, const char *token, bool has_length) {
    int fd[2];
    struct buf reply;
    char *text = mem_printf("POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                            "Authorization: Bearer %s\r\n%s\r\nExpect: 100-continue\r\n\r\n",
                            token, has_length ? "Content-Length: 600000" : "Transfer-Encoding: chunked");
    char *body = mem_calloc(1, 600000);
    for (int i = 0; i < 2; i++) {
        fd[i] = rig_connect(rig);
        rig_send(fd[i], text, strlen(text));
        buf_init(&reply, 1 << 20);
        rig_receive(fd[i], &reply, has_length && i == 1 ? "HTTP/1.1 507" : "100 Continue");
        buf_release(&reply);
    }
    for (int i = 0; i < (has_length ? 1 : 2); i++) {
        body[0] = (char)(i + 2 * has_length);
        if (!has_length)
            rig_send(fd[i], "927c0\r\n", 7);
        rig_send(fd[i], body, 600000);
        if (!has_length)
            rig_send(fd[i], "\r\n0\r\n\r\n", 7);
        buf_init(&reply, 1 << 20);
        rig_receive(fd[i], &reply, NULL);
        CHECK(strstr(buf_text(&reply), i == 0 ? "HTTP/1.1 201" : "HTTP/1.1 507"));
        buf_release(&reply);
    }
    close(fd[0]);
    close(fd[1]);
    mem_free(body);
    mem_free(text);
}

static int ask(const struct rig *rig, const char *token, const char *what, int64_t job, const char *action) {
    struct buf reply;
    char *request = mem_printf("%s/%lld%s HTTP/1.1", what, (long long)job, action);
    int status = send_as(rig, token, request, 0, &reply);
    buf_release(&reply);
    mem_free(request);
    return status;
}

/* Two of the owner's jobs, 1 and 2, are queued, which is all that may be: no other way leads past that. */
static void test_back_into_the_queue(const struct rig *rig, const char *token) {
    const char *submit = "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json", *post = "POST /v1/jobs";
    struct buf reply;
    struct error err;
    int attempt;
    CHECK(ask(rig, token, post, 1, "/pause") == 202 && ask(rig, token, post, 2, "/cancel") == 202);
    for (int i = 0; i < 2; i++) { /* jobs 3 and 4 */
        CHECK(send_as(rig, token, submit, 76, &reply) == 201);
        buf_release(&reply);
    }
    CHECK(ask(rig, token, post, 1, "/resume") == 429);
    CHECK(ask(rig, token, post, 2, "/retry") == 429);
    CHECK(ask(rig, token, post, 2, "/retry?from=load") == 429);
    rig_must(store_job_start(rig->store, 3, "process", &attempt, &err), &err, "start");
    CHECK(ask(rig, token, post, 1, "/resume") == 202); /* one is no longer queued */
    CHECK(ask(rig, token, post, 2, "/retry") == 429);
}

/* One user cannot have all event streams. */
static void test_streams(struct rig *rig, const char *one, const char *other) {
    const char *const token[] = {one, one, other};
    struct buf reply;
    int fd[3];
    rig->api->config.user_max_streams = 1;
    for (int i = 0; i < 3; i++) {
        char *text =
            mem_printf("GET /v1/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer %s\r\n\r\n", token[i]);
        fd[i] = rig_connect(rig);
        rig_send(fd[i], text, strlen(text));
        buf_init(&reply, 1 << 20);
        rig_receive(fd[i], &reply, i == 1 ? "user_max_streams" : "retry:");
        CHECK_THAT(rig_status(&reply) == (i == 1 ? 429 : 200), "stream %d: %d", i, rig_status(&reply));
        buf_release(&reply);
        mem_free(text);
    }
    for (int i = 0; i < 3; i++)
        close(fd[i]);
}

/* What a job was found to have left counts, and its owner is told. */
static void test_disk(struct rig *rig, const char *token) {
    const struct disk_use use = {.job_id = 1, .bytes = 5 << 20};
    struct buf reply;
    struct error err;
    rig_must(store_disk_enter(rig->store, &use, 1, &err), &err, "disk");
    rig->api->config.user_max_bytes = 5 << 20;
    CHECK(send_as(rig, token, "GET /v1/session HTTP/1.1", 0, &reply) == 200);
    CHECK_THAT(strstr(buf_text(&reply), "\"kept_bytes\":5857280,\"kept_bytes_max\":5242880"), "%s", buf_text(&reply));
    buf_release(&reply);
    CHECK(send_as(rig, token, "GET /v1/jobs/1 HTTP/1.1", 0, &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"disk_bytes\":5242880"));
    buf_release(&reply);
    CHECK(send_as(rig, token, "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json", 76, &reply) == 507);
    CHECK(strstr(buf_text(&reply), "your scenes and jobs take 5.6 of the 5.0 MiB that a user may keep"));
    CHECK(strstr(buf_text(&reply), "an administrator can raise the option user_max_mib"));
    buf_release(&reply);
    rig->api->config.user_max_bytes = 0;
    rig->api->config.user_max_jobs = 4; /* jobs 1 to 4 are this user's */
    CHECK(send_as(rig, token, "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json", 76, &reply) == 507);
    CHECK(strstr(buf_text(&reply), "you keep 4 jobs, and a user may keep 4"));
    CHECK(strstr(buf_text(&reply), "an administrator can raise the option user_max_jobs"));
    buf_release(&reply);
    CHECK(send_as(rig, token, "GET /v1/session HTTP/1.1", 0, &reply) == 200);
    CHECK(strstr(buf_text(&reply), "\"kept_bytes_max\":null"));
    buf_release(&reply);
}

/* That others have sent the same bytes is no answer's to tell: 201 for each, 200 for who sends them again. */
static void check_known(struct rig *rig, const char *one, const char *other) {
    const char *const sent_by[] = {one, other, one, other};
    for (size_t i = 0; i < 4; i++) {
        struct buf reply;
        int status = send_as(rig, sent_by[i], "POST /v1/scenes HTTP/1.1", 1000, &reply);
        CHECK_THAT(status == (i < 2 ? 201 : 200) && strstr(buf_text(&reply), "\"state\":\"checking\""),
                   "sent %zu: %d: %s", i, status, buf_text(&reply));
        buf_release(&reply);
    }
}

int main(void) {
    struct rig rig;
    struct error err;
    struct buf reply;
    char alice[TOKEN_SIZE], bob[TOKEN_SIZE], carol[TOKEN_SIZE], dora[TOKEN_SIZE];
    int64_t id;
    int status = 0;
    rig_start(&rig, &rig_patient, 60);
    rig.api->config.user_max_bytes = 1 << 20;
    rig.api->config.user_queue_limit = 2;
    rig_must(store_token_add(rig.store, "alice", ROLE_USER, 0, alice, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "bob", ROLE_ADMIN, 0, bob, &id, &err), &err, "token");
    rig_scene(&rig);

    /* Bytes: announced, and found out on the way. */
    const char *upload = "POST /v1/scenes HTTP/1.1";
    CHECK(send_as(&rig, alice, upload, 600 << 10, &reply) == 201);
    buf_release(&reply);
    CHECK(send_as(&rig, alice, upload, 600 << 10, &reply) == 507); /* the same again: nobody knows yet */
    CHECK(strstr(buf_text(&reply), "of the 1.0 MiB that a user may keep, and 0.6 MiB more are needed"));
    buf_release(&reply);
    CHECK(send_as(&rig, bob, upload, 600 << 10, &reply) != 507);
    buf_release(&reply);
    CHECK(send_as(&rig, alice, "POST /v1/uploads HTTP/1.1\r\nTus-Resumable: 1.0.0\r\nUpload-Length: 500000", 0,
                  &reply) == 507);
    buf_release(&reply);

    /* Bytes that nobody announced; what is there already takes no more room. */
    CHECK(send_chunked(&rig, alice, 600 << 10, 'x', &reply) == 507);
    buf_release(&reply);
    CHECK(send_chunked(&rig, alice, 600 << 10, ' ', &reply) == 200);
    buf_release(&reply);
    rig_must(store_token_add(rig.store, "carol", ROLE_USER, 0, carol, &id, &err), &err, "token");
    test_two_at_once(&rig, carol, true);
    rig_must(store_token_add(rig.store, "dora", ROLE_USER, 0, dora, &id, &err), &err, "token");
    test_two_at_once(&rig, dora, false);

    test_streams(&rig, alice, bob);

    /* Jobs. */
    const char *submit = "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json";
    for (int i = 0; i < 3; i++) {
        status = send_as(&rig, bob, submit, 76, &reply);
        CHECK_THAT(status == (i < 2 ? 201 : 429), "job %d: %d", i, status);
        if (status == 429)
            CHECK(strstr(buf_text(&reply), "Retry-After: "));
        buf_release(&reply);
    }
    test_back_into_the_queue(&rig, bob);
    test_disk(&rig, bob);
    rig.api->config.user_max_bytes = 0;
    check_known(&rig, alice, bob);
    rig_stop(&rig);
    return check_result();
}
