/* test_slow_clients.c -- a crowd that is slow on purpose: heads, bodies, parts of uploads and replies
 * at a byte a second. A good client beside it is served at once, and the crowd is closed in time. */
#include <errno.h>
#include <linux/sockios.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/ioctl.h>
#include <sys/resource.h>

#include "common/clock.h"
#include "tests/api/rig.h"
#include "tests/figures.h"

#define CROWD_MAX 1000
#define OUTPUT_BYTES ((size_t)32 << 20) /* more than the kernel buffers for one connection */

enum kind { HEAD, BODY, PART, READER, KIND_COUNT };

struct slow {
    int fd;
    enum kind kind;
    double closed_at; /* since it connected; 0: not yet */
};

struct good {
    struct rig *rig;
    atomic_bool stop;
    double *latency; /* [capacity] */
    size_t count, capacity;
};

static double began;

/* Asks every 10 ms, on a connection of its own each time. */
static void *ask_again_and_again(void *user) {
    struct good *g = user;
    while (!atomic_load(&g->stop) && g->count < g->capacity) {
        struct buf reply;
        double at = clock_sec();
        CHECK(rig_get(g->rig, "/healthz", "", &reply) == 200);
        g->latency[g->count++] = clock_sec() - at;
        buf_release(&reply);
        usleep(10000);
    }
    return NULL;
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* An output that is too large to be sent without being read. */
static int64_t make_output(struct rig *rig) {
    struct error err;
    int64_t job = rig_job(rig);
    int attempt = rig_run_job(rig, job);
    char *dir = mem_printf("%s/jobs/%lld/attempt-1/out", rig->dir, (long long)job), *path = file_join(dir, "large");
    rig_must(file_make_dirs(dir, &err), &err, "file_make_dirs");
    FILE *file = fopen(path, "w");
    CHECK(file && ftruncate(fileno(file), (off_t)OUTPUT_BYTES) == 0 && fclose(file) == 0);
    char hex[65];
    memset(hex, '0', 64);
    hex[64] = '\0';
    rig_must(store_output_put(rig->store, job, attempt, EVENT_OUTPUT, "large", OUTPUT_BYTES, hex,
                              "application/octet-stream", &err),
             &err, "store_output_put");
    mem_free(path);
    mem_free(dir);
    return job;
}

static void make_upload(struct rig *rig, char path[128]) {
    static const char request[] = "POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                                  "Tus-Resumable: 1.0.0\r\nUpload-Length: 1000000\r\nContent-Length: 0\r\n\r\n";
    struct buf reply;
    CHECK(rig_ask(rig, request, sizeof request - 1, &reply) == 201);
    const char *location = strstr(buf_text(&reply), "Location: ");
    CHECK(location && sscanf(location, "Location: %127[^\r]", path) == 1);
    buf_release(&reply);
}

static void attack(struct slow *s, const struct rig *rig, enum kind kind, int64_t job, const char *upload) {
    char *text = NULL;
    int little = 4096;
    switch (kind) {
    case HEAD: text = mem_strdup("GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: "); break;
    case BODY:
        text = mem_strdup("POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                          "Content-Length: 100000\r\n\r\n ");
        break;
    case PART:
        text = mem_printf("PATCH %s HTTP/1.1\r\nHost: localhost\r\nTus-Resumable: 1.0.0\r\nUpload-Offset: 0\r\n"
                          "Content-Type: application/offset+octet-stream\r\nContent-Length: 100000\r\n\r\n",
                          upload);
        break;
    default: text = mem_printf("GET /v1/jobs/%lld/outputs/large HTTP/1.1\r\nHost: localhost\r\n\r\n", (long long)job);
    }
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_port = htons(listener_port(rig->listener)),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    *s = (struct slow){.fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), .kind = kind};
    if (kind == READER)
        setsockopt(s->fd, SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
    CHECK(connect(s->fd, (struct sockaddr *)&to, sizeof to) == 0);
    rig_send(s->fd, text, strlen(text));
    mem_free(text);
}

static int state_of(int fd) {
    struct tcp_info info = {0};
    socklen_t size = sizeof info;
    return getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? info.tcpi_state : 0;
}

/* One more byte of each; what was closed is noted. True while some are open. */
static bool drip(struct slow *crowd, int count) {
    bool open = false;
    for (int i = 0; i < count; i++) {
        struct slow *s = &crowd[i];
        char byte = ' ';
        if (s->closed_at > 0)
            continue;
        ssize_t done;
        if (s->kind == READER) {
            /* The end would show only behind all that was sent: the kernel knows it before. */
            done = recv(s->fd, &byte, 1, MSG_DONTWAIT);
            if (state_of(s->fd) != TCP_ESTABLISHED)
                done = 0;
        } else {
            done = send(s->fd, s->kind == HEAD ? "a" : " ", 1, MSG_NOSIGNAL | MSG_DONTWAIT);
            if (done > 0)
                done = recv(s->fd, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0 ? 0 : 1;
        }
        if (done == 0 || (done < 0 && errno != EAGAIN && errno != EWOULDBLOCK))
            s->closed_at = clock_sec() - began;
        else
            open = true;
    }
    return open;
}

/* Bytes of replies that wait unsent in the kernel: in all, and of the worst connection. */
static long unsent_bytes(long *worst) {
    long sum = 0;
    for (int fd = 3; fd < 3 * CROWD_MAX; fd++) {
        int waiting = 0;
        if (state_of(fd) != TCP_ESTABLISHED || ioctl(fd, SIOCOUTQNSD, &waiting) != 0)
            continue;
        sum += waiting;
        *worst = waiting > *worst ? waiting : *worst;
    }
    return sum;
}

int main(void) {
    struct rig rig;
    struct rlimit files;
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    setrlimit(RLIMIT_NOFILE, &files);
    int count = (int)figures_count("UNBAKE_CLIENTS", 100, CROWD_MAX);
    count = count < CROWD_MAX ? count : CROWD_MAX;
    struct guard_limits limits = {.head_sec = 5, .idle_sec = 5, .window_sec = 5, .body_bytes_per_sec = 1024};
    rig_start_large(&rig, &limits, 15, 3000, 60);
    int64_t job = make_output(&rig);
    char upload[128] = "";
    make_upload(&rig, upload);
    struct slow *crowd = mem_calloc((size_t)count, sizeof *crowd);
    struct good good = {.rig = &rig, .capacity = 5000};
    good.latency = mem_calloc(good.capacity, sizeof *good.latency);
    pthread_t thread;
    pthread_create(&thread, NULL, ask_again_and_again, &good);
    began = clock_sec();
    for (int i = 0; i < count; i++)
        attack(&crowd[i], &rig, (enum kind)(i % KIND_COUNT), job, upload);
    double deadline = clock_sec() + 60;
    long unsent = 0, worst = 0;
    while (drip(crowd, count) && clock_sec() < deadline) {
        long now = unsent_bytes(&worst);
        unsent = now > unsent ? now : unsent;
        usleep(500000);
    }
    atomic_store(&good.stop, true);
    pthread_join(thread, NULL);

    static const char *const names[] = {"heads", "bodies", "parts of uploads", "replies"};
    double last[KIND_COUNT] = {0};
    int open = 0;
    for (int i = 0; i < count; i++) {
        open += crowd[i].closed_at == 0;
        last[crowd[i].kind] = fmax(last[crowd[i].kind], crowd[i].closed_at > 0 ? crowd[i].closed_at : 60);
        close(crowd[i].fd);
    }
    for (int i = 0; i < KIND_COUNT; i++) {
        printf("slow %s were closed within %.1f s\n", names[i], last[i]);
        /* A wall clock decides nothing here: 10 s are the goal on a quiet machine. */
        CHECK_THAT(last[i] < 60, "slow %s are still open", names[i]);
    }
    qsort(good.latency, good.count, sizeof *good.latency, by_size);
    CHECK(good.count > 20);
    CHECK_THAT(worst > 0 && worst < 1 << 20, "%ld bytes wait in the kernel for one reader", worst);
    figure("MiB that wait in the kernel for slow readers", (double)unsent / (1 << 20), 100, "lower");
    figure("slow clients still open after 60 s", open, 0, "lower");
    figure("seconds until the last slow client is closed", fmax(fmax(last[0], last[1]), fmax(last[2], last[3])), 10,
           "lower");
    figure("a good client's 99th percentile beside them, ms", 1e3 * good.latency[good.count * 99 / 100], 50, "lower");
    figure("the same, median, ms", 1e3 * good.latency[good.count / 2], 50, "lower");
    mem_free(good.latency);
    mem_free(crowd);
    rig_stop(&rig);
    return check_result();
}
