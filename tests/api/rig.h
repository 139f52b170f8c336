/* rig.h -- the HTTP side in the test's own process, on a port of its own, over a store that the
 * test moves by hand: no job ever runs. And raw requests, byte for byte. */
#ifndef UNBAKE_TESTS_API_RIG_H
#define UNBAKE_TESTS_API_RIG_H

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/http/service.h"
#include "server/net/address.h"
#include "server/transport/listener.h"
#include "tests/check.h"

struct rig {
    char dir[64];
    struct store *store;
    struct scheduler *scheduler;
    struct api *api;
    struct listener *listener;
    struct proxies proxies;
};

static inline void rig_must(enum status status, const struct error *err, const char *what) {
    if (status == STATUS_OK)
        return;
    fprintf(stderr, "%s: %s\n", what, err->message);
    exit(1);
}

/* On the folder rig->dir, which may be there already. */
static inline void rig_open(struct rig *rig, const struct guard_limits *limits, double keepalive_sec,
                            unsigned connection_max, size_t stream_max) {
    struct error err;
    log_set_level(LOG_WARNING);
    rig_must(store_open(&rig->store, rig->dir, &err), &err, "store_open");
    struct scheduler_config work = {
        .data_dir = rig->dir, .max_running = 1, .checkpoint_interval_sec = 60, .stop_grace_sec = 1};
    rig_must(scheduler_new(&rig->scheduler, &work, rig->store, &err), &err, "scheduler_new");
    struct proxies *proxies = &rig->proxies; /* the test stands for many callers */
    rig_must(proxies_parse(proxies, "127.0.0.1", "X-Forwarded-For", &err), &err, "proxies_parse");
    struct api_config config = {.proxies = proxies,
                                .data_dir = rig->dir,
                                .max_attempts = 2,
                                .queue_limit = 50,
                                .max_upload_bytes = 8 << 20,
                                .max_streams = stream_max,
                                .keepalive_sec = keepalive_sec,
                                .upload_keep_ms = 3600000,
                                .server_names = "lab.example.org"};
    rig_must(service_new(&rig->api, &config, rig->store, rig->scheduler, &err), &err, "service_new");
    struct listener_config network = {.address = "127.0.0.1", .connection_max = connection_max, .limits = *limits};
    rig_must(service_listen(&rig->listener, &network, rig->api, &err), &err, "service_listen");
}

/* Room for so many connections, and event streams. */
static inline void rig_start_large(struct rig *rig, const struct guard_limits *limits, double keepalive_sec,
                                   unsigned connection_max, size_t stream_max) {
    memset(rig, 0, sizeof *rig);
    snprintf(rig->dir, sizeof rig->dir, "%s/unbake-rig-XXXXXX", check_fast_dir());
    if (!mkdtemp(rig->dir))
        CHECK_SKIP("cannot make a folder in %s", check_fast_dir());
    rig_open(rig, limits, keepalive_sec, connection_max, stream_max);
}

static inline void rig_start(struct rig *rig, const struct guard_limits *limits, double keepalive_sec) {
    rig_start_large(rig, limits, keepalive_sec, 200, 60);
}

static inline void rig_stop(struct rig *rig) {
    listener_quiesce(rig->listener);
    listener_stop(rig->listener);
    service_free(rig->api);
    scheduler_free(rig->scheduler);
    store_close(rig->store);
    file_remove_tree(rig->dir, NULL);
}

static const struct guard_limits rig_patient = {.head_sec = 60, .idle_sec = 60, .window_sec = 60};

/* --- raw requests ------------------------------------------------------------------------ */

/* A connect that a signal interrupts (libFuzzer's clock) goes on by itself; tells how it ended. */
static inline bool rig_connected(int fd) {
    struct pollfd wanted = {.fd = fd, .events = POLLOUT};
    int failed = 0;
    socklen_t size = sizeof failed;
    while (poll(&wanted, 1, 60000) < 0 && errno == EINTR)
        ;
    return getsockopt(fd, SOL_SOCKET, SO_ERROR, &failed, &size) == 0 && failed == 0;
}

static inline struct sockaddr_in rig_address(const struct listener *listener) {
    return (struct sockaddr_in){
        .sin_family = AF_INET, .sin_port = htons(listener_port(listener)), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
}

static inline int rig_connect(const struct rig *rig) {
    struct sockaddr_in to = rig_address(rig->listener);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    struct timeval patience = {.tv_sec = 60};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (connect(fd, (struct sockaddr *)&to, sizeof to) != 0 && !(errno == EINTR && rig_connected(fd))) {
        perror("connect");
        exit(1);
    }
    return fd;
}

static inline void rig_send(int fd, const void *data, size_t length) {
    const char *at = data;
    while (length > 0) {
        ssize_t sent = send(fd, at, length, MSG_NOSIGNAL);
        if (sent <= 0)
            return; /* the daemon has had enough: what it said tells why */
        at += sent;
        length -= (size_t)sent;
    }
}

/* Reads into *out until the other side closes, or `until` (if not NULL) has come, as it must. */
static inline void rig_receive(int fd, struct buf *out, const char *until) {
    char chunk[16384];
    while (!until || !strstr(buf_text(out), until)) {
        ssize_t got = recv(fd, chunk, sizeof chunk, 0);
        if (got <= 0) {
            CHECK_THAT(!until, "\"%s\" never came: %s", until, buf_text(out));
            return;
        }
        buf_append(out, chunk, (size_t)got);
    }
}

/* Status of a reply; 0 where there is none. */
static inline int rig_status(const struct buf *reply) {
    int status = 0;
    return sscanf(buf_text(reply), "HTTP/1.1 %d", &status) == 1 ? status : 0;
}

/* A request on a connection of its own; the whole reply goes to *reply (initialised here). */
static inline int rig_ask(const struct rig *rig, const void *request, size_t length, struct buf *reply) {
    int fd = rig_connect(rig);
    buf_init(reply, (size_t)64 << 20);
    rig_send(fd, request, length);
    rig_receive(fd, reply, NULL);
    close(fd);
    return rig_status(reply);
}

/* "GET path" with further fields (each "Name: value\r\n"), as rig_ask. */
static inline int rig_get(const struct rig *rig, const char *path, const char *fields, struct buf *reply) {
    char *text = mem_printf("GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%s\r\n", path, fields);
    int status = rig_ask(rig, text, strlen(text), reply);
    mem_free(text);
    return status;
}

/* The reply's body. */
static inline const char *rig_body(const struct buf *reply) {
    const char *gap = strstr(buf_text(reply), "\r\n\r\n");
    return gap ? gap + 4 : "";
}

/* --- the store, by hand ------------------------------------------------------------------ */

#define RIG_SCENE "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"

/* A scene that is ready, there once. */
static inline void rig_scene(struct rig *rig) {
    struct error err;
    bool existed;
    rig_must(store_scene_add(rig->store, RIG_SCENE, "room", 10, 0, &existed, &err), &err, "store_scene_add");
    if (!existed)
        rig_must(store_scene_ready(rig->store, RIG_SCENE, NULL, "{}", &err), &err, "store_scene_ready");
}

/* A queued job on it. */
static inline int64_t rig_job(struct rig *rig) {
    struct error err;
    bool replayed;
    int64_t id;
    rig_scene(rig);
    struct job_new job = {.scene_id = RIG_SCENE, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 2};
    rig_must(store_job_add(rig->store, &job, 1000, &id, &replayed, &err), &err, "store_job_add");
    return id;
}

static inline int rig_run_job(struct rig *rig, int64_t id) {
    struct error err;
    int attempt;
    rig_must(store_job_start(rig->store, id, "process", &attempt, &err), &err, "store_job_start");
    return attempt;
}

#endif
