/* test_http_life.c -- the HTTP side starts where it can, and stops without losing what it was given. */
#include <pthread.h>
#include <sys/resource.h>

#include "server/uploads/resumable.h"
#include "server/uploads/upload_session.h"
#include "tests/api/rig.h"

#define BYTES 1000
#define HALF (BYTES / 2)

static struct rig rig;
static struct error err;

static void check_start(void) {
    static const char *const addresses[] = {"nowhere", "localhost:80", "127.0.0.256", ""};
    for (size_t i = 0; i < sizeof addresses / sizeof *addresses; i++) {
        struct listener_config network = {.address = addresses[i], .connection_max = 9, .limits = rig_patient};
        struct listener *listener;
        enum status status = service_listen(&listener, &network, rig.api, &err);
        CHECK_THAT(status == STATUS_INPUT && strstr(err.message, "cannot listen on"), "\"%s\": %s, %s", addresses[i],
                   status_name(status), err.message);
    }
}

/* --- how many ------------------------------------------------------------------------------------- */

#define CONNECTION_MAX 9

static const char request[] = "GET /readyz HTTP/1.1\r\nHost: localhost\r\n\r\n";

static struct listener *start_small(void) {
    struct listener_config network = {.address = "127.0.0.1", .connection_max = CONNECTION_MAX, .limits = rig_patient};
    struct listener *listener;
    rig_must(service_listen(&listener, &network, rig.api, &err), &err, "service_listen");
    return listener;
}

/* Asks, and waits for the answer as long as it may take. */
static void check_answer(int fd) {
    struct buf reply;
    buf_init(&reply, 1 << 20);
    rig_send(fd, request, sizeof request - 1);
    rig_receive(fd, &reply, "\r\n\r\n");
    CHECK_THAT(rig_status(&reply) == 200, "%s", buf_text(&reply));
    buf_release(&reply);
}

static bool is_answered(int fd, int within_ms) {
    struct pollfd reply = {.fd = fd, .events = POLLIN};
    return poll(&reply, 1, within_ms) != 0;
}

/* As many connections as allowed are served at a time; more have to wait, and are served when one ends. */
static void check_limit(void) {
    struct rig small = rig;
    int fds[CONNECTION_MAX + 3];
    small.listener = start_small();
    for (int i = 0; i < CONNECTION_MAX + 3; i++)
        fds[i] = rig_connect(&small);
    for (int i = 0; i < CONNECTION_MAX; i++)
        check_answer(fds[i]);
    for (int i = CONNECTION_MAX; i < CONNECTION_MAX + 3; i++) {
        rig_send(fds[i], request, sizeof request - 1);
        CHECK(!is_answered(fds[i], 100) && listener_connections(small.listener) == CONNECTION_MAX);
        close(fds[i - CONNECTION_MAX]);
        CHECK(is_answered(fds[i], 60000));
    }
    for (int i = 3; i < CONNECTION_MAX + 3; i++)
        close(fds[i]);
    listener_stop(small.listener);
    rig.api->listener = rig.listener;
}

/* Without descriptors left it waits until there are some. */
static void check_descriptors(void) {
    int fd = rig_connect(&rig); /* before: it needs one itself */
    check_answer(fd);
    close(fd);
    fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    struct sockaddr_in to = rig_address(rig.listener);
    struct rlimit before, none;
    getrlimit(RLIMIT_NOFILE, &before);
    none = (struct rlimit){.rlim_cur = 3, .rlim_max = before.rlim_max};
    while (listener_connections(rig.listener) > 0)
        usleep(1000);
    setrlimit(RLIMIT_NOFILE, &none);
    CHECK(connect(fd, (struct sockaddr *)&to, sizeof to) == 0);
    rig_send(fd, request, sizeof request - 1);
    usleep(250000);
    CHECK(recv(fd, &(char){0}, 1, MSG_DONTWAIT | MSG_PEEK) < 0);
    setrlimit(RLIMIT_NOFILE, &before);
    CHECK(is_answered(fd, 60000));
    close(fd);
}

/* --- stopping -------------------------------------------------------------------------------------- */

/* Connects and asks again and again, until it is refused. */
static void *knock(void *user) {
    const struct sockaddr_in *to = user;
    for (bool is_refused = false; !is_refused;) {
        char reply[256];
        int fd = socket(AF_INET, SOCK_STREAM, 0);
        is_refused = connect(fd, (const struct sockaddr *)to, sizeof *to) != 0;
        if (!is_refused && send(fd, request, sizeof request - 1, MSG_NOSIGNAL) > 0)
            (void)!recv(fd, reply, sizeof reply, 0);
        close(fd);
    }
    return NULL;
}

/* It stops at any moment of its threads' work. */
static void check_stop_when_busy(void) {
    for (int round = 0; round < 200; round++) {
        struct listener *listener = start_small();
        struct sockaddr_in to = rig_address(listener);
        pthread_t knocker[4];
        for (int i = 0; i < 4; i++)
            CHECK(pthread_create(&knocker[i], NULL, knock, &to) == 0);
        usleep((useconds_t)(2000 + 37 * round));
        listener_quiesce(listener);
        listener_stop(listener);
        for (int i = 0; i < 4; i++)
            pthread_join(knocker[i], NULL);
        rig.api->listener = rig.listener;
    }
}

static void create(char id[UPLOAD_ID_SIZE]) {
    struct upload_row row = {.name = mem_strdup("room"), .metadata = mem_strdup(""), .length = BYTES};
    rig_must(resumable_create(rig.api->resumables, &row, 0, &err), &err, "resumable_create");
    memcpy(id, row.id, UPLOAD_ID_SIZE);
    upload_row_release(&row);
}

/* Sends all of the upload but `left` bytes of value `byte`; the connection. */
static int send_all_but(const char *id, char byte, size_t left) {
    char bytes[BYTES];
    unsigned long long before = atomic_load(&rig.api->uploaded_bytes);
    int fd = rig_connect(&rig);
    char *head = mem_printf("PATCH /v1/uploads/%s HTTP/1.1\r\nHost: localhost\r\nTus-Resumable: 1.0.0\r\n"
                            "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n"
                            "Content-Length: %d\r\n\r\n",
                            id, BYTES);
    memset(bytes, byte, sizeof bytes);
    rig_send(fd, head, strlen(head));
    rig_send(fd, bytes, BYTES - left);
    while (atomic_load(&rig.api->uploaded_bytes) < before + BYTES - left)
        usleep(1000);
    mem_free(head);
    return fd;
}

static void check_whole(const char *id) {
    struct upload_row row;
    rig_must(store_upload_get(rig.store, id, &row, NULL, 0, &err), &err, "store_upload_get");
    CHECK_THAT(row.received == BYTES && *row.scene_id, "%llu bytes are counted", (unsigned long long)row.received);
    upload_row_release(&row);
}

static void *stop(void *user) {
    (void)user;
    listener_quiesce(rig.listener);
    listener_stop(rig.listener);
    return NULL;
}

/* While one upload is being finished the daemon stops: that one gets its answer, another, whose end comes too late, is
 * told to come back, and what of it was received is there. */
static void check_stop(void) {
    char first[UPLOAD_ID_SIZE], second[UPLOAD_ID_SIZE], bytes[HALF], path[128];
    struct resumables *p = rig.api->resumables;
    struct buf reply;
    pthread_t thread;
    snprintf(path, sizeof path, "GET /v1/jobs/%lld/events HTTP/1.1\r\nHost: localhost\r\n\r\n",
             (long long)rig_job(&rig));
    int stream = rig_connect(&rig);
    buf_init(&reply, 1 << 20);
    rig_send(stream, path, strlen(path));
    rig_receive(stream, &reply, "\"snapshot\":true");

    create(first);
    create(second);
    int late = send_all_but(second, 'b', HALF);
    pthread_mutex_lock(&p->finishing);
    int early = send_all_but(first, 'a', 0);
    for (bool is_counted = false; !is_counted; usleep(1000)) { /* then it waits for the mutex above */
        struct upload_row row;
        rig_must(store_upload_get(rig.store, first, &row, NULL, 0, &err), &err, "store_upload_get");
        is_counted = row.received == BYTES;
        upload_row_release(&row);
    }
    CHECK(pthread_create(&thread, NULL, stop, NULL) == 0);
    rig_receive(stream, &reply, "\r\n0\r\n\r\n"); /* by now it is stopping */
    buf_release(&reply);
    close(stream);

    buf_init(&reply, 1 << 20);
    memset(bytes, 'b', sizeof bytes);
    rig_send(late, bytes, sizeof bytes);
    rig_receive(late, &reply, "the daemon is stopping");
    CHECK(rig_status(&reply) == 503 && strstr(buf_text(&reply), "the daemon is stopping"));
    CHECK(strstr(buf_text(&reply), "Retry-After: "));
    buf_release(&reply);
    close(late);

    pthread_mutex_unlock(&p->finishing);
    buf_init(&reply, 1 << 20);
    rig_receive(early, &reply, "\r\n\r\n");
    CHECK_THAT(rig_status(&reply) == 204 && strstr(buf_text(&reply), "Link: </v1/scenes/"), "%s", buf_text(&reply));
    buf_release(&reply);
    close(early);
    pthread_join(thread, NULL);
    service_free(rig.api);
    check_whole(first);
    check_whole(second);
}

int main(void) {
    rig_start(&rig, &rig_patient, 60);
    log_set_level(LOG_ERROR);
    check_start();
    check_limit();
    check_descriptors();
    check_stop_when_busy();
    check_stop();
    scheduler_free(rig.scheduler);
    store_close(rig.store);
    file_remove_tree(rig.dir, NULL);
    return check_result();
}
