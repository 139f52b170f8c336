/* test_event_streams.c -- many clients read the stream of events of one job.
 *
 * The daemon's HTTP side is a process of its own. First silence: what a stream costs in memory. Then
 * events at a steady pace: how long until a client has one. Then a storm: events pour in while every
 * client's connection breaks off again and again, at any byte, and it comes back saying which event
 * it had last: each client has each event once. */
#include <fcntl.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>

#include "common/clock.h"
#include "common/quantile.h"
#include "tests/api/rig.h"
#include "tests/figures.h"

/* --- the server's process ---------------------------------------------------------------------- */

static long resident_kib(void) {
    long pages = 0, total;
    FILE *file = fopen("/proc/self/statm", "re");
    if (file && fscanf(file, "%ld %ld", &total, &pages) != 2)
        pages = 0;
    if (file)
        fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

static void publish(struct rig *rig, int64_t job, int attempt, long first, long count, double pause_sec) {
    for (long i = first; i < first + count; i++) {
        char data[128];
        struct error err;
        snprintf(data, sizeof data, "{\"series\":\"loss\",\"step\":%ld,\"value\":%.6f}", i, clock_sec());
        rig_must(store_event_add(rig->store, job, attempt, EVENT_METRIC, data, &err), &err, "store_event_add");
        usleep((useconds_t)(pause_sec * 1e6));
    }
}

/* Commands, one a line: "m" tells the memory, "p FIRST COUNT PAUSE" publishes, "q" ends. */
static void serve(FILE *in, FILE *out, unsigned clients) {
    struct rig rig;
    char line[128];
    long first, count;
    double pause;
    rig_start_large(&rig, &rig_patient, 15, clients * 2 + 100, clients * 2);
    int64_t job = rig_job(&rig);
    int attempt = rig_run_job(&rig, job);
    fprintf(out, "%u %lld\n", listener_port(rig.listener), (long long)job);
    fflush(out);
    while (fgets(line, sizeof line, in) && line[0] != 'q') {
        if (sscanf(line, "p %ld %ld %lf", &first, &count, &pause) == 3)
            publish(&rig, job, attempt, first, count, pause);
        fprintf(out, "%ld\n", resident_kib());
        fflush(out);
    }
    rig_stop(&rig);
    exit(0);
}

/* --- the clients ------------------------------------------------------------------------------- */

struct client {
    int fd;
    struct buf text;
    long long last_id;
    long next_step;  /* that is due */
    long drop_after; /* bytes until its connection breaks off; negative: never */
};

static struct client *client;
static int epoll_fd, port;
static long long job;
static long connection_count, gap_count, repeat_count, delivered;
static double *latency; /* of the steady pace */
static size_t latency_count, latency_max;
static unsigned random_ = 5;

static unsigned draw(unsigned limit) {
    random_ = random_ * 1664525u + 1013904223u;
    return (random_ >> 8) % limit;
}

static void open_client(struct client *c) {
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    c->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(c->fd, (struct sockaddr *)&to, sizeof to) != 0) {
        perror("connect");
        exit(1);
    }
    char *head = mem_printf("GET /v1/jobs/%lld/events HTTP/1.1\r\nHost: localhost\r\nLast-Event-ID: %lld\r\n\r\n", job,
                            c->last_id);
    rig_send(c->fd, head, strlen(head));
    mem_free(head);
    struct epoll_event event = {.events = EPOLLIN, .data.ptr = c};
    epoll_ctl(epoll_fd, EPOLL_CTL_ADD, c->fd, &event);
    buf_clear(&c->text);
    connection_count++;
}

static void take_event(struct client *c, const char *event) {
    const char *id = strstr(event, "id: "), *step = strstr(event, "\"step\":"), *value = strstr(event, "\"value\":");
    if (!id)
        return;
    c->last_id = strtoll(id + 4, NULL, 10);
    if (!step || !strstr(event, "event: metric"))
        return;
    long number = strtol(step + 7, NULL, 10);
    gap_count += number > c->next_step;
    repeat_count += number < c->next_step;
    c->next_step = number + 1;
    delivered++;
    if (latency && latency_count < latency_max)
        latency[latency_count++] = clock_sec() - strtod(value + 8, NULL);
}

static void read_client(struct client *c) {
    char chunk[65536];
    size_t want = c->drop_after >= 0 && c->drop_after < (long)sizeof chunk ? (size_t)c->drop_after : sizeof chunk;
    ssize_t got = want ? recv(c->fd, chunk, want, MSG_DONTWAIT) : 0;
    if (got > 0) {
        buf_append(&c->text, chunk, (size_t)got);
        char *at = c->text.data, *end;
        while ((end = strstr(at, "\n\n")) != NULL) {
            *end = '\0';
            take_event(c, at);
            at = end + 2;
        }
        buf_consume(&c->text, (size_t)(at - c->text.data));
        c->drop_after -= c->drop_after >= 0 ? got : 0;
    }
    if (got == 0 || c->drop_after == 0) {
        close(c->fd);
        c->drop_after = c->drop_after >= 0 ? (long)draw(30000) + 1 : -1;
        open_client(c);
    }
}

/* Until all clients have `step`, or for so many seconds. */
static void pump(int clients, long step, double seconds) {
    struct epoll_event events[256];
    double end = clock_sec() + seconds;
    for (;;) {
        int count = epoll_wait(epoll_fd, events, 256, 50);
        for (int i = 0; i < count; i++)
            read_client(events[i].data.ptr);
        int behind = 0;
        for (int i = 0; i < clients && !behind; i++)
            behind = client[i].next_step < step;
        if (!behind || clock_sec() > end)
            return;
    }
}

static long command(FILE *to, FILE *from, const char *text) {
    char line[64] = "";
    fprintf(to, "%s\n", text);
    fflush(to);
    return fgets(line, sizeof line, from) ? strtol(line, NULL, 10) : -1;
}

/* Has the server publish `count` events, and the clients read until they have them all. */
static void publish_to(FILE *to, FILE *from, int clients, long first, long count, double pause_sec, double most_sec) {
    char text[64];
    fprintf(to, "p %ld %ld %g\n", first, count, pause_sec);
    fflush(to);
    pump(clients, first + count, most_sec);
    fgets(text, sizeof text, from);
}

/* Events at a steady pace: seconds until a client has one, half of them and 99 %. */
static void keep_pace(FILE *to, FILE *from, int clients, long count, double *median, double *late) {
    latency_max = (size_t)clients * (size_t)count;
    latency = mem_calloc(latency_max, sizeof *latency);
    publish_to(to, from, clients, 0, count, 0.1, (double)count * 0.1 + 60.0);
    CHECK_THAT(latency_count == latency_max, "%zu of %zu events came", latency_count, latency_max);
    *median = quantile_double(latency, latency_count, 0.5);
    *late = quantile_double(latency, latency_count, 0.99);
    mem_free(latency);
    latency = NULL;
}

/* Events pour in while connections break off: returns the seconds that it took. */
static double storm(FILE *to, FILE *from, int clients, long first, long count) {
    delivered = 0;
    for (int i = 0; i < clients; i++)
        client[i].drop_after = (long)draw(30000) + 1;
    double start = clock_sec();
    publish_to(to, from, clients, first, count, 0.001, 600.0);
    double took = clock_sec() - start;
    for (int i = 0; i < clients; i++)
        CHECK_THAT(client[i].next_step == first + count, "client %d has %ld of %ld", i, client[i].next_step,
                   first + count);
    CHECK_THAT(gap_count == 0 && repeat_count == 0, "%ld gaps, %ld repeated", gap_count, repeat_count);
    CHECK(delivered == (long)clients * count);
    return took;
}

static void open_clients(int clients) {
    epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    client = mem_calloc((size_t)clients, sizeof *client);
    for (int i = 0; i < clients; i++) {
        buf_init(&client[i].text, 1 << 22);
        client[i].drop_after = -1;
        open_client(&client[i]);
    }
    pump(clients, 1, 1.0); /* the snapshots */
}

/* Starts the server's process, which says its port and job; its number, or -1. */
static pid_t start_server(int clients, FILE **to, FILE **from) {
    int down[2], up[2];
    char text[64];
    if (pipe(down) != 0 || pipe(up) != 0)
        return -1;
    pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        close(down[1]);
        close(up[0]);
        serve(fdopen(down[0], "r"), fdopen(up[1], "w"), (unsigned)clients);
    }
    *to = fdopen(down[1], "w");
    *from = fdopen(up[0], "r");
    return fgets(text, sizeof text, *from) && sscanf(text, "%d %lld", &port, &job) == 2 ? pid : -1;
}

int main(void) {
    int clients = (int)figures_count("UNBAKE_CLIENTS", 100, 1000);
    long paced = figures_count("UNBAKE_EVENTS", 20, 300), stormy = figures_count("UNBAKE_STORM", 200, 1000);
    struct rlimit limit;
    FILE *to, *from;
    double median, late;
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    if (limit.rlim_max < (rlim_t)clients * 2 + 200)
        CHECK_SKIP("only %ld descriptors", (long)limit.rlim_max);
    pid_t pid = start_server(clients, &to, &from);
    if (pid < 0)
        return 1;
    long empty_kib = command(to, from, "m");
    open_clients(clients);
    long idle_kib = command(to, from, "m");
    keep_pace(to, from, clients, paced, &median, &late);
    double took = storm(to, from, clients, paced, stormy);
    long busy_kib = command(to, from, "m");
    printf(
        "%d clients: %.1f MiB before, %.1f MiB idle, %.1f MiB after; events after %.1f ms (median), %.1f ms (99 %%); "
        "storm: %ld events in %.0f s over %ld connections\n",
        clients, (double)empty_kib / 1024, (double)idle_kib / 1024, (double)busy_kib / 1024, median * 1e3, late * 1e3,
        delivered, took, connection_count);
    figure("event streams: clients", clients, 1000, "higher");
    figure("event streams: ms until a client has an event, 99 %", late * 1e3, 100, "lower");
    figure("event streams: MiB of the process, all idle", (double)idle_kib / 1024, 60, "lower");
    figure("event streams: events delivered in a storm of reconnects", (double)delivered, 1e6, "higher");
    figure("event streams: gaps in the storm", (double)gap_count, 0, "lower");
    figure("event streams: events twice in the storm", (double)repeat_count, 0, "lower");
    fprintf(to, "q\n");
    fflush(to);
    waitpid(pid, NULL, 0);
    return check_result();
}
