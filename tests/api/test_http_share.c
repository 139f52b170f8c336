/* test_http_share.c -- a user's share: what passes it is refused, to this user only. */
#include "tests/api/rig.h"

static int send_as(const struct rig *rig, const char *token, const char *request, size_t length,
                   struct buf *reply) {
    char *text = mem_printf("%s\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer %s\r\n"
                            "Content-Length: %zu\r\n\r\n", request, token, length);
    size_t head = strlen(text);
    text = mem_realloc_array(text, head + length + 1, 1);
    memset(text + head, ' ', length);
    memcpy(text + head, "{\"scene\":\"" RIG_SCENE "\"}", length < 76 ? length : 76);
    int status = rig_ask(rig, text, head + length, reply);
    mem_free(text);
    return status;
}

int main(void) {
    struct rig rig;
    struct error err;
    struct buf reply;
    char alice[TOKEN_SIZE], bob[TOKEN_SIZE];
    int64_t id;
    int status = 0;
    rig_start(&rig, &rig_patient, 60);
    rig.api->config.user_max_bytes = 1 << 20;
    rig.api->config.user_queue_limit = 2;
    rig_must(store_token_add(rig.store, "alice", ROLE_USER, alice, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "bob", ROLE_ADMIN, bob, &id, &err), &err, "token");
    rig_scene(&rig);

    /* Bytes: announced, and found out on the way. */
    const char *upload = "POST /v1/scenes HTTP/1.1";
    CHECK(send_as(&rig, alice, upload, 600 << 10, &reply) == 201);
    buf_release(&reply);
    CHECK(send_as(&rig, alice, upload, 600 << 10, &reply) == 507); /* the same again: nobody knows yet */
    CHECK(strstr(buf_text(&reply), "1 MiB are what a user may keep"));
    buf_release(&reply);
    CHECK(send_as(&rig, bob, upload, 600 << 10, &reply) != 507);
    buf_release(&reply);
    CHECK(send_as(&rig, alice, "POST /v1/uploads HTTP/1.1\r\nTus-Resumable: 1.0.0\r\nUpload-Length: 500000", 0,
                  &reply) == 507);
    buf_release(&reply);

    /* Jobs. */
    const char *submit = "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json";
    for (int i = 0; i < 3; i++) {
        status = send_as(&rig, bob, submit, 76, &reply);
        CHECK_THAT(status == (i < 2 ? 201 : 429), "job %d: %d", i, status);
        if (status == 429)
            CHECK(strstr(buf_text(&reply), "Retry-After: "));
        buf_release(&reply);
    }
    rig.api->config.user_max_bytes = 1000;
    CHECK(send_as(&rig, bob, submit, 76, &reply) == 507);
    buf_release(&reply);
    rig_stop(&rig);
    return check_result();
}
