/* test_http_quota.c -- what one user may take of what all share, each with its own status, the option's name and who
 * can raise it; admins are not bound. Uploads that never begin give their space back soon. */
#include <sys/stat.h>

#include "common/clock.h"
#include "server/data/collector.h"
#include "server/uploads/resumable.h"
#include "server/uploads/upload.h"
#include "server/uploads/upload_session.h"
#include "tests/api/rig.h"

static struct rig rig;
static struct error err;
static char anna[TOKEN_SIZE], chief[TOKEN_SIZE];
static int64_t anna_id;

/* POST /v1/uploads of so many bytes; its id goes to `id` where it is made. */
static int create(const char *token, uint64_t bytes, char id[33], struct buf *reply) {
    char *text =
        mem_printf("POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer %s\r\n"
                   "Tus-Resumable: 1.0.0\r\nUpload-Length: %llu\r\n\r\n",
                   token, (unsigned long long)bytes);
    int status = rig_ask(&rig, text, strlen(text), reply);
    const char *location = strstr(buf_text(reply), "\r\nLocation: /v1/uploads/");
    CHECK((status == 201) == (location && sscanf(location + 24, "%32[0-9a-f]", id) == 1));
    mem_free(text);
    return status;
}

static void expect(const char *token, uint64_t bytes, int wanted, const char *option) {
    char id[33];
    struct buf reply;
    int status = create(token, bytes, id, &reply);
    CHECK_THAT(status == wanted && strstr(buf_text(&reply), option), "%llu bytes: %d, not %d with %s: %s",
               (unsigned long long)bytes, status, wanted, option, buf_text(&reply));
    CHECK(status != 429 || strstr(buf_text(&reply), "\r\nRetry-After: "));
    CHECK(status == 201 || strstr(buf_text(&reply), "administrator"));
    buf_release(&reply);
    if (status == 201)
        rig_must(store_upload_delete(rig.store, id, &err), &err, "store_upload_delete");
}

/* Two requests without a byte do not fill the disk. */
static void test_pledges(void) {
    char id[2][33];
    struct buf reply;
    uint64_t room;
    rig_must(file_free_bytes(rig.dir, &room, &err), &err, "file_free_bytes");
    rig.api->config.max_upload_bytes = INT64_MAX;
    rig.api->config.user_pledge_percent = 50;
    expect(anna, room / 100 * 60, 507, "user_pledge_percent");
    rig.api->config.user_pledge_percent = 1;
    CHECK(create(anna, room / 1000 * 6, id[0], &reply) == 201);
    buf_release(&reply);
    expect(anna, room / 1000 * 6, 507, "user_pledge_percent");
    expect(chief, room / 1000 * 6, 201, "");
    rig_must(store_upload_delete(rig.store, id[0], &err), &err, "store_upload_delete");
    rig.api->config.user_pledge_percent = 0;

    rig.api->config.admin_free_bytes = room;
    expect(anna, 1000, 507, "are kept free");
    expect(chief, 1000, 201, "");
    rig.api->config.admin_free_bytes = 0;

    rig.api->config.user_max_uploads = 2;
    for (int i = 0; i < 2; i++) {
        CHECK(create(anna, 1000, id[i], &reply) == 201);
        buf_release(&reply);
    }
    expect(anna, 1000, 429, "user_max_uploads");
    expect(chief, 1000, 201, "");
    for (int i = 0; i < 2; i++)
        rig_must(store_upload_delete(rig.store, id[i], &err), &err, "store_upload_delete");
}

/* Begins an upload in one request, of so many bytes, and waits for its admission or refusal; the connection. */
static int begin(uint64_t bytes) {
    char *text = mem_printf("POST /v1/scenes HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer %s\r\n"
                            "Expect: 100-continue\r\nContent-Length: %llu\r\n\r\n",
                            anna, (unsigned long long)bytes);
    int fd = rig_connect(&rig);
    rig_send(fd, text, strlen(text));
    mem_free(text);
    return fd;
}

/* 100 where it was admitted, else the refusal's status; `option` is named by a refusal. */
static int answer_to(int fd, const char *option) {
    struct buf reply;
    buf_init(&reply, 1 << 20);
    rig_receive(fd, &reply, "\r\n\r\n");
    int status = rig_status(&reply);
    if (status != 100 && !strstr(buf_text(&reply), option))
        rig_receive(fd, &reply, option);
    buf_release(&reply);
    return status;
}

/* Waits until none is under way in one request: the daemon has seen that they were cut off. */
static void await_no_arrivals(void) {
    while (arrivals_of(rig.api->arrivals, anna_id, NULL).count > 0)
        usleep(1000);
}

/* What comes in one request counts from its admission, too: of a burst as many are admitted as may be under way, and
 * what they are to hold is pledged, kept and to be checked. */
static void test_arrivals(void) {
    enum { MOST = 3, BURST = 12 };
    int fds[BURST], admitted = 0, refused = 0;
    char id[33];
    struct buf reply;
    uint64_t room;
    rig_must(file_free_bytes(rig.dir, &room, &err), &err, "file_free_bytes");
    rig.api->config.max_upload_bytes = INT64_MAX;
    rig.api->config.user_max_uploads = MOST;
    for (int i = 0; i < BURST; i++)
        fds[i] = begin(1000);
    for (int i = 0; i < BURST; i++) {
        int status = answer_to(fds[i], "user_max_uploads");
        admitted += status == 100;
        refused += status == 429;
    }
    CHECK_THAT(admitted == MOST && refused == BURST - MOST, "%d were admitted, %d refused", admitted, refused);
    expect(anna, 1000, 429, "user_max_uploads");
    expect(chief, 1000, 201, "");
    for (int i = 0; i < BURST; i++)
        close(fds[i]);
    await_no_arrivals();
    rig.api->config.user_max_uploads = 0;

    rig.api->config.user_pledge_percent = 1;
    fds[0] = begin(room / 1000 * 6);
    CHECK(answer_to(fds[0], "user_pledge_percent") == 100);
    fds[1] = begin(room / 1000 * 6);
    CHECK(answer_to(fds[1], "user_pledge_percent") == 507);
    expect(anna, room / 1000 * 6, 507, "user_pledge_percent");
    rig.api->config.user_pledge_percent = 0;
    rig.api->config.user_max_bytes = room / 1000 * 10;
    CHECK(create(anna, room / 1000 * 6, id, &reply) == 507 && strstr(buf_text(&reply), "a user may keep"));
    buf_release(&reply);
    rig.api->config.user_max_bytes = 0;
    rig.api->config.user_max_checks = 1;
    expect(anna, 1000, 429, "user_max_checks");
    rig.api->config.user_max_checks = 0;
    close(fds[0]);
    close(fds[1]);
    await_no_arrivals();
    expect(anna, 1000, 201, "");
}

static void test_checks(int64_t user) {
    char id[33];
    struct buf reply;
    bool existed;
    rig.api->config.user_max_checks = 1;
    expect(anna, 1000, 201, "");
    rig_must(store_scene_add(rig.store, RIG_SCENE, "room", 10, user, &existed, &err), &err, "store_scene_add");
    expect(anna, 1000, 429, "user_max_checks");
    expect(chief, 1000, 201, "");
    rig_must(store_scene_ready(rig.store, RIG_SCENE, NULL, "{}", &err), &err, "store_scene_ready");
    CHECK(create(anna, 1000, id, &reply) == 201); /* which becomes a scene to check */
    buf_release(&reply);
    expect(anna, 1000, 429, "user_max_checks");
    rig_must(store_upload_delete(rig.store, id, &err), &err, "store_upload_delete");
    expect(anna, 1000, 201, "");
    rig.api->config.user_max_checks = 0;
}

static bool is_there(const char *id) {
    struct upload_row row;
    enum status status = store_upload_get(rig.store, id, &row, NULL, 0, &err);
    upload_row_release(&row);
    return status == STATUS_OK;
}

/* Of one nothing has arrived, of the other a byte: that one is kept for as long as it was. */
static void test_age(void) {
    char empty[33], begun[33], hash[512] = "";
    struct buf reply;
    CHECK(create(anna, 1000, empty, &reply) == 201);
    CHECK(strstr(buf_text(&reply), "\r\nUpload-Expires: "));
    buf_release(&reply);
    CHECK(create(anna, 1000, begun, &reply) == 201);
    buf_release(&reply);
    rig_must(store_upload_advance(rig.store, begun, 1, hash, 10, &err), &err, "store_upload_advance");
    rig_must(collector_run(&rig.api->collector_config, false, NULL, NULL, &err), &err, "collector_run");
    CHECK(is_there(empty) && is_there(begun));
    rig_must(store_retention_set_empty_upload(rig.store, 1, &err), &err, "store_retention_set_empty_upload");
    usleep(5000);
    rig_must(collector_run(&rig.api->collector_config, false, NULL, NULL, &err), &err, "collector_run");
    CHECK(!is_there(empty) && is_there(begun));
}

static uint64_t held_bytes(const char *id) {
    char *path = mem_printf("%s/uploads/%s", rig.dir, id);
    struct stat info = {0};
    CHECK(stat(path, &info) == 0);
    mem_free(path);
    return (uint64_t)info.st_blocks * 512;
}

/* An upload that stands still gives back what it holds, is not counted as pledged, and goes on where it was. */
static void test_idle(void) {
    const uint64_t length = 64 << 20;
    char id[33], body[1000];
    struct buf reply;
    uint64_t pledged;
    int64_t user = anna_id;
    memset(body, 'x', sizeof body);
    CHECK(create(anna, length, id, &reply) == 201);
    buf_release(&reply);
    for (int part = 0; part < 2; part++) {
        char *text = mem_printf(
            "PATCH /v1/uploads/%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer %s\r\n"
            "Tus-Resumable: 1.0.0\r\nUpload-Offset: %d\r\nContent-Type: application/offset+octet-stream\r\n"
            "Content-Length: 1000\r\n\r\n%.1000s",
            id, anna, part * 1000, body);
        int status = rig_ask(&rig, text, strlen(text), &reply);
        CHECK_THAT(status == 204, "part %d: %d: %s", part, status, buf_text(&reply));
        buf_release(&reply);
        mem_free(text);
        rig.api->config.empty_upload_ms = rig.api->resumables->config.idle_ms = 3600000;
        resumables_maintain(rig.api->resumables);
        rig_must(store_user_pledged(rig.store, user, 0, &pledged, &err), &err, "store_user_pledged");
        CHECK_THAT(pledged >= length - 2000, "%llu bytes are pledged", (unsigned long long)pledged);
        CHECK(part == 1 || held_bytes(id) >= length); /* it has just grown */
        usleep(5000);
        rig.api->config.empty_upload_ms = rig.api->resumables->config.idle_ms = 1;
        resumables_maintain(rig.api->resumables);
        CHECK_THAT(held_bytes(id) < 2 << 20, "it holds %llu bytes", (unsigned long long)held_bytes(id));
        rig_must(store_user_pledged(rig.store, user, clock_unix_ms() - 1, &pledged, &err), &err, "store_user_pledged");
        CHECK_THAT(pledged < length - 2000, "%llu bytes are pledged", (unsigned long long)pledged);
    }
    rig_must(store_upload_delete(rig.store, id, &err), &err, "store_upload_delete");
}

/* The last streams are kept for admins. */
static void test_streams(void) {
    struct buf reply;
    int fd[3];
    rig.api->config.max_streams = 10;
    rig.api->config.user_max_streams = 0;
    for (int i = 0; i < 11; i++) {
        char *text = mem_printf("GET /v1/events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer %s\r\n\r\n",
                                i < 10 ? anna : chief);
        int at = rig_connect(&rig);
        rig_send(at, text, strlen(text));
        buf_init(&reply, 1 << 20);
        rig_receive(at, &reply, i == 9 ? "max_streams" : "retry:");
        CHECK_THAT(rig_status(&reply) == (i == 9 ? 503 : 200), "stream %d: %d", i, rig_status(&reply));
        buf_release(&reply);
        mem_free(text);
        if (i < 3)
            fd[i] = at;
    }
    for (int i = 0; i < 3; i++)
        close(fd[i]);
}

int main(void) {
    int64_t id;
    struct caller who;
    rig_start(&rig, &rig_patient, 60);
    log_set_level(LOG_ERROR);
    rig_must(store_token_add(rig.store, "anna", ROLE_USER, 0, anna, &id, &err), &err, "token");
    rig_must(store_token_add(rig.store, "chief", ROLE_ADMIN, 0, chief, &id, &err), &err, "token");
    rig_must(store_token_find(rig.store, anna, &who, &err), &err, "token");
    test_pledges();
    anna_id = who.user_id;
    test_arrivals();
    test_checks(who.user_id);
    test_age();
    test_idle();
    test_streams();
    rig_stop(&rig);
    return check_result();
}
