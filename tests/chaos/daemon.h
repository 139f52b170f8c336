/* daemon.h -- for long tests: the real daemon as a child, and requests to it. */
#ifndef UNBAKE_TESTS_CHAOS_DAEMON_H
#define UNBAKE_TESTS_CHAOS_DAEMON_H

#include <arpa/inet.h>
#include <limits.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdint.h>
#include <strings.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>

#include "common/buf.h"
#include "common/clock.h"
#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/figures.h"

/* A setting of jobs: no surface is sought that a scan lacks. In the closed room of api/client.sh there is none, and the
 * search would be most of a small job's work. */
#define CLOSED_ROOM "\"holes\":\"keep\""

struct daemon {
    char dir[64], data[96], port_file[96], log[96];
    const char *binary;
    const char *settings[16]; /* "name=value"; ends with NULL */
    const char *preload;      /* a library; NULL: none */
    const char *ready_path;   /* 200 there when it is up; NULL: /readyz */
    pid_t pid;
    int port;
};

static inline void daemon_init(struct daemon *d, const char *build) {
    static char binary[512];
    memset(d, 0, sizeof *d);
    snprintf(binary, sizeof binary, "%s/unbaked", build);
    d->binary = binary;
    snprintf(d->dir, sizeof d->dir, "/tmp/unbake-chaos-XXXXXX");
    if (!mkdtemp(d->dir))
        CHECK_SKIP("cannot make a folder in /tmp");
    snprintf(d->data, sizeof d->data, "%s/data", d->dir);
    snprintf(d->port_file, sizeof d->port_file, "%s/port", d->dir);
    snprintf(d->log, sizeof d->log, "%s/log", d->dir);
}

/* In a child, before it executes a program: slips the library under it; NULL: none. */
static inline void preload_set(const char *library) {
    if (!library)
        return;
    setenv("LD_PRELOAD", library, 1);
    /* The address sanitizer wants to come first, and does well second. Its own exit status is no
     * worker's. */
    setenv("ASAN_OPTIONS", "verify_asan_link_order=0:exitcode=99", 1);
}

/* The absolute path of a library that was built of tests/chaos/preload/. */
static inline void preload_find(const char *build, const char *name, char path[PATH_MAX]) {
    char *relative = mem_printf("%s/tests/chaos/preload/%s.so", build, name);
    if (!realpath(relative, path))
        exit(1);
    mem_free(relative);
}

static inline int http_connect(int port) {
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), one = 1;
    struct timeval patience = {.tv_sec = 60};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    if (connect(fd, (struct sockaddr *)&to, sizeof to) == 0)
        return fd;
    close(fd);
    return -1;
}

static inline bool http_send(int fd, const void *data, size_t length) {
    for (const char *at = data; length > 0;) {
        ssize_t sent = send(fd, at, length, MSG_NOSIGNAL);
        if (sent <= 0)
            return false;
        at += sent;
        length -= (size_t)sent;
    }
    return true;
}

/* One request on a connection of its own. The status, 0 where no whole reply came; its head and body go
 * to *head and *body (initialised here). `fields` are whole lines. */
static inline int http_exchange(int port, const char *method, const char *path, const char *fields, const void *data,
                                size_t length, struct buf *head, struct buf *body) {
    struct buf reply;
    char chunk[16384];
    ssize_t got = -1;
    int status = 0, fd = http_connect(port);
    buf_init(head, (size_t)1 << 20);
    buf_init(body, (size_t)64 << 20);
    if (fd < 0)
        return 0;
    char *request =
        mem_printf("%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: %zu\r\n%s\r\n", method,
                   path, length, fields);
    buf_init(&reply, (size_t)64 << 20);
    if (http_send(fd, request, strlen(request)) && http_send(fd, data, length))
        while ((got = recv(fd, chunk, sizeof chunk, 0)) > 0)
            buf_append(&reply, chunk, (size_t)got);
    close(fd);
    mem_free(request);
    const char *gap = strstr(buf_text(&reply), "\r\n\r\n"),
               *announced = strcasestr(buf_text(&reply), "\r\nContent-Length:");
    if (gap && sscanf(buf_text(&reply), "HTTP/1.1 %d", &status) == 1) {
        size_t rest = reply.length - (size_t)(gap + 4 - buf_text(&reply));
        if (announced && announced < gap && strtoull(announced + 17, NULL, 10) != rest)
            status = 0; /* cut off */
        buf_append(head, buf_text(&reply), (size_t)(gap + 2 - buf_text(&reply)));
        buf_append(body, gap + 4, rest);
    }
    buf_release(&reply);
    return status;
}

static inline int http_ask(int port, const char *method, const char *path, const char *fields, const void *data,
                           size_t length, struct buf *body) {
    struct buf head;
    int status = http_exchange(port, method, path, fields, data, length, &head, body);
    buf_release(&head);
    return status;
}

static inline int http_get(int port, const char *path, struct buf *body) {
    return http_ask(port, "GET", path, "", "", 0, body);
}

/* POST or PATCH of JSON. */
static inline int http_json(int port, const char *method, const char *path, const char *fields, const char *json,
                            struct buf *body) {
    char *all = mem_printf("Content-Type: application/json\r\n%s", fields);
    int status = http_ask(port, method, path, all, json, strlen(json), body);
    mem_free(all);
    return status;
}

/* Starts it and waits until it says that it is ready; the seconds that took. */
static inline double daemon_start(struct daemon *d) {
    const char *argv[48] = {d->binary, "--data", d->data, "--listen", "127.0.0.1:0", "--port-file", d->port_file};
    int count = 7;
    for (size_t i = 0; d->settings[i]; i++) {
        argv[count++] = "--set";
        argv[count++] = d->settings[i];
    }
    unlink(d->port_file);
    double start = clock_sec();
    pid_t parent = getpid();
    d->pid = fork();
    if (d->pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent)
            _exit(1);
        if (!freopen(d->log, "a", stderr) || !freopen("/dev/null", "w", stdout))
            _exit(126);
        preload_set(d->preload);
        execv(d->binary, (char *const *)(uintptr_t)argv);
        _exit(127);
    }
    for (;;) {
        struct buf body;
        FILE *file = fopen(d->port_file, "re");
        int ready = 0;
        if (file && fscanf(file, "%d", &d->port) == 1) {
            ready = http_get(d->port, d->ready_path ? d->ready_path : "/readyz", &body) == 200;
            buf_release(&body);
        }
        if (file)
            fclose(file);
        if (ready)
            return clock_sec() - start;
        if (waitpid(d->pid, NULL, WNOHANG) == d->pid || clock_sec() - start > 120.0) {
            fprintf(stderr, "the daemon does not start; its log is %s\n", d->log);
            exit(1);
        }
        usleep(2000);
    }
}

static inline void daemon_signal(struct daemon *d, int number) {
    kill(d->pid, number);
    waitpid(d->pid, NULL, 0);
    d->pid = 0;
}

static inline void daemon_remove(struct daemon *d) {
    if (d->pid > 0)
        daemon_signal(d, SIGTERM);
    if (check_failed_count == 0)
        file_remove_tree(d->dir, NULL);
    else
        fprintf(stderr, "kept: %s\n", d->dir);
}

/* Posts an archive and waits until it is checked; the id. */
static inline void daemon_scene(struct daemon *d, const char *archive, char id[65]) {
    struct buf bytes, body;
    struct error err;
    buf_init(&bytes, (size_t)64 << 20);
    if (file_read(archive, &bytes, &err) != STATUS_OK ||
        http_ask(d->port, "POST", "/v1/scenes", "", bytes.data, bytes.length, &body) != 201 ||
        sscanf(strstr(buf_text(&body), "\"id\":\"") + 6, "%64[0-9a-f]", id) != 1) {
        fprintf(stderr, "the room cannot be sent\n");
        exit(1);
    }
    buf_release(&bytes);
    for (bool ready = false; !ready; usleep(20000)) {
        char path[96];
        buf_release(&body);
        snprintf(path, sizeof path, "/v1/scenes/%s", id);
        http_get(d->port, path, &body);
        ready = strstr(buf_text(&body), "\"state\":\"ready\"") != NULL;
        if (strstr(buf_text(&body), "\"state\":\"rejected\"")) {
            fprintf(stderr, "the room is rejected: %s\n", buf_text(&body));
            exit(1);
        }
    }
    buf_release(&body);
}

static inline int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts; the value below which `share` of them lie. */
static inline double percentile(double *values, size_t count, double share) {
    qsort(values, count, sizeof *values, compare_doubles);
    return count ? values[(size_t)((double)(count - 1) * share)] : 0.0;
}

#endif
