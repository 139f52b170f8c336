/* test_uploads.c -- many real clients send rooms at once through a proxy that drops connections in
 * the middle of bodies. In the first round only that, and every byte must cross the proxy once; in
 * the second connections are reset and the daemon is killed, too. In the end every room is there,
 * byte for byte. */
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>

#include "client/pack.h"
#include "common/rng.h"
#include "common/sha256.h"
#include "tests/chaos/daemon.h"

#define READ_BYTES 65536 /* of the proxy, at once */
#define CLIENTS_MAX 100
#define OWN_BYTES 65536 /* of each room; the rest is the same for all */

struct proxy {
    atomic_int daemon_port;
    int listener, port;
    atomic_bool is_rough;     /* connections are reset, not ended */
    double mean_budget;       /* bytes of a body that a connection carries before it is dropped */
    atomic_ullong body_bytes; /* of PATCH requests, on the way to the daemon */
    atomic_uint drops, connections;
    atomic_uint open;
};

/* --- the proxy ------------------------------------------------------------------------------ */

struct link {
    struct proxy *proxy;
    int client, server;
    struct buf head;    /* of the request that is coming */
    uint64_t body_left; /* of it */
    bool is_patch;
    uint64_t budget;
};

/* What the client sent: cut to what may still pass, false when that is all. Counts bodies. */
static bool let_through(struct link *l, const char *data, size_t *length) {
    size_t passed = 0;
    while (passed < *length) {
        if (l->body_left > 0) {
            uint64_t part = *length - passed < l->body_left ? *length - passed : l->body_left;
            if (l->is_patch && part > l->budget)
                part = l->budget;
            l->body_left -= part;
            passed += part;
            if (!l->is_patch)
                continue;
            l->budget -= part;
            atomic_fetch_add(&l->proxy->body_bytes, part);
            if (l->budget == 0 && l->body_left > 0) {
                *length = passed;
                return false;
            }
            continue;
        }
        buf_append(&l->head, data + passed, 1);
        passed++;
        if (l->head.length < 4 || memcmp(l->head.data + l->head.length - 4, "\r\n\r\n", 4) != 0)
            continue;
        const char *announced = strcasestr(buf_text(&l->head), "\r\nContent-Length:");
        l->body_left = announced ? strtoull(announced + 17, NULL, 10) : 0;
        l->is_patch = strncmp(buf_text(&l->head), "PATCH ", 6) == 0;
        buf_clear(&l->head);
    }
    return true;
}

static void reset(int fd) {
    struct linger none = {.l_onoff = 1};
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &none, sizeof none);
}

/* Ends the connection in the middle of a body. */
static void drop_link(struct link *l) {
    char chunk[4096];
    atomic_fetch_add(&l->proxy->drops, 1);
    if (atomic_load(&l->proxy->is_rough)) {
        reset(l->client);
        reset(l->server);
        return;
    }
    /* The daemon gets all that has passed; only then does the client learn of it. */
    shutdown(l->server, SHUT_WR);
    while (recv(l->server, chunk, sizeof chunk, 0) > 0)
        ;
}

static void *carry(void *user) {
    struct link *l = user;
    char *chunk = mem_alloc(READ_BYTES);
    l->server = http_connect(atomic_load(&l->proxy->daemon_port));
    buf_init(&l->head, 1 << 20);
    while (l->server >= 0) {
        struct pollfd ends[2] = {{.fd = l->client, .events = POLLIN}, {.fd = l->server, .events = POLLIN}};
        if (poll(ends, 2, 120000) <= 0)
            break;
        if (ends[1].revents) {
            ssize_t got = recv(l->server, chunk, READ_BYTES, 0);
            if (got <= 0 || !http_send(l->client, chunk, (size_t)got))
                break;
        }
        if (ends[0].revents) {
            ssize_t got = recv(l->client, chunk, READ_BYTES, 0);
            size_t length = got > 0 ? (size_t)got : 0;
            if (length == 0)
                break;
            bool all = let_through(l, chunk, &length);
            if (!http_send(l->server, chunk, length))
                break;
            if (!all) {
                drop_link(l);
                break;
            }
        }
    }
    close(l->client);
    if (l->server >= 0)
        close(l->server);
    atomic_fetch_sub(&l->proxy->open, 1);
    buf_release(&l->head);
    mem_free(chunk);
    mem_free(l);
    return NULL;
}

static void *accept_all(void *user) {
    struct proxy *p = user;
    int fd;
    while ((fd = accept4(p->listener, NULL, NULL, SOCK_CLOEXEC)) >= 0) {
        struct link *l = mem_calloc(1, sizeof *l);
        pthread_t thread;
        unsigned number = atomic_fetch_add(&p->connections, 1);
        float share = rng_to_float(rng_mix32(number));
        *l = (struct link){.proxy = p, .client = fd, .budget = 1 + (uint64_t)(2.0 * (double)share * p->mean_budget)};
        atomic_fetch_add(&p->open, 1);
        if (pthread_create(&thread, NULL, carry, l) == 0) {
            pthread_detach(thread);
        } else {
            atomic_fetch_sub(&p->open, 1);
            close(fd);
            mem_free(l);
        }
    }
    return NULL;
}

static void proxy_start(struct proxy *p, const struct daemon *d, double mean_budget) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    pthread_t thread;
    atomic_store(&p->daemon_port, d->port);
    p->mean_budget = mean_budget;
    p->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(bind(p->listener, (struct sockaddr *)&address, size) == 0 && listen(p->listener, 512) == 0);
    CHECK(getsockname(p->listener, (struct sockaddr *)&address, &size) == 0);
    p->port = ntohs(address.sin_port);
    CHECK(pthread_create(&thread, NULL, accept_all, p) == 0);
    pthread_detach(thread);
}

/* --- rooms and clients ---------------------------------------------------------------------- */

static void write_random(const char *path, uint64_t bytes, uint64_t seed) {
    FILE *file = fopen(path, "we");
    uint64_t words[1024];
    CHECK(file != NULL);
    for (uint64_t at = 0; file && at < bytes; at += sizeof words) {
        for (size_t i = 0; i < 1024; i++)
            words[i] = rng_mix64(seed ^ rng_mix64(at + i));
        CHECK(fwrite(words, 1, sizeof words, file) == sizeof words);
    }
    CHECK(file && fclose(file) == 0);
}

static void room_path(const struct daemon *d, int round, int i, char path[128]) {
    snprintf(path, 128, "%s/room-%d-%03d", d->dir, round, i);
}

static void make_rooms(const struct daemon *d, int round, int count, uint64_t bytes) {
    char common[128], path[128], file[160];
    struct error err;
    snprintf(common, sizeof common, "%s/common", d->dir);
    if (access(common, F_OK) != 0)
        write_random(common, bytes - OWN_BYTES, 1);
    for (int i = 0; i < count; i++) {
        room_path(d, round, i, path);
        CHECK(file_make_dirs(path, &err) == STATUS_OK);
        snprintf(file, sizeof file, "%s/own.bin", path);
        write_random(file, OWN_BYTES, rng_key(7, (uint64_t)round, (uint64_t)i));
        snprintf(file, sizeof file, "%s/rest.bin", path);
        CHECK(symlink(common, file) == 0);
    }
}

static pid_t start_client(const struct daemon *d, const char *build, int port, const char *room, int number) {
    char program[512], server[64], log[128];
    snprintf(program, sizeof program, "%s/unbake", build);
    snprintf(server, sizeof server, "http://127.0.0.1:%d", port);
    snprintf(log, sizeof log, "%s/client-%03d", d->dir, number);
    pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (!freopen(log, "w", stderr) || !freopen("/dev/null", "w", stdout))
            _exit(126);
        execl(program, "unbake", "submit", room, "--quiet", "--server", server, "--retry", "600", (char *)NULL);
        _exit(127);
    }
    return pid;
}

/* The room must be on the server under its hash, and what is there have that hash. */
static bool is_stored(const struct daemon *d, const char *room) {
    struct pack *pack;
    struct error err;
    uint64_t length;
    char wanted[SHA256_HEX_SIZE], found[SHA256_HEX_SIZE], path[256];
    if (pack_open(&pack, room, &err) != STATUS_OK)
        return false;
    enum status status = pack_measure(pack, NULL, NULL, &length, wanted, &err);
    pack_close(pack);
    snprintf(path, sizeof path, "%s/scenes/%s/archive", d->data, wanted);
    return status == STATUS_OK && sha256_of_file(path, found, &err) == STATUS_OK && strcmp(found, wanted) == 0;
}

/* All clients at once; `kills` of the daemon while they send. The seconds that it took. */
static double run_round(struct daemon *d, struct proxy *p, const char *build, int round, int count, int kills) {
    pid_t clients[CLIENTS_MAX];
    double began = clock_sec();
    for (int i = 0; i < count; i++) {
        char path[128];
        room_path(d, round, i, path);
        clients[i] = start_client(d, build, p->port, path, i);
    }
    for (int k = 0; k < kills; k++) {
        unsigned drops = atomic_load(&p->drops);
        /* Each life lets some bodies pass. */
        for (int wait = 0; wait < 400 && atomic_load(&p->drops) < drops + 2; wait++)
            usleep(10000);
        daemon_signal(d, SIGKILL);
        daemon_start(d);
        atomic_store(&p->daemon_port, d->port);
    }
    for (int i = 0; i < count; i++) {
        int status = 0;
        CHECK(waitpid(clients[i], &status, 0) == clients[i]);
        /* 4: the job was refused, since the room had been found to be none by then. */
        CHECK_THAT(WIFEXITED(status) && (WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == 4),
                   "client %d ended with %d", i, status);
    }
    double took = clock_sec() - began;
    while (atomic_load(&p->open) > 0)
        usleep(10000);
    return took;
}

/* Rooms of a round that the daemon does not have as they were sent. */
static int count_wrong(const struct daemon *d, int round, int count) {
    char path[128];
    int wrong = 0;
    for (int i = 0; i < count; i++) {
        room_path(d, round, i, path);
        wrong += !is_stored(d, path);
    }
    return wrong;
}

/* Bytes that are sent for the first room of the first round; every room's stream has the same length. */
static uint64_t measure_room(const struct daemon *d) {
    struct pack *pack;
    struct error err;
    char path[128], sha256[SHA256_HEX_SIZE];
    uint64_t length = 0;
    room_path(d, 1, 0, path);
    CHECK(pack_open(&pack, path, &err) == STATUS_OK &&
          pack_measure(pack, NULL, NULL, &length, sha256, &err) == STATUS_OK);
    pack_close(pack);
    return length;
}

int main(void) {
    struct daemon d;
    struct proxy p = {0};
    const char *build = getenv("UNBAKE_BUILD") ? getenv("UNBAKE_BUILD") : "build";
    int count = (int)figures_count("UNBAKE_CLIENTS", 10, CLIENTS_MAX);
    uint64_t bytes = (uint64_t)figures_count("UNBAKE_MEGABYTES", 2, 100) * 1000000;
    int kills = (int)figures_count("UNBAKE_KILLS", 2, 20), others = count / 5 > 2 ? count / 5 : count;
    count = count < CLIENTS_MAX ? count : CLIENTS_MAX;
    signal(SIGPIPE, SIG_IGN);
    daemon_init(&d, build);
    d.settings[0] = "min_free_mib=1";
    d.settings[1] = "low_disk_mib=0";
    d.settings[2] = "log_level=warning";
    /* libmicrohttpd 0.9.75 overlooks that a client has gone, until this: */
    d.settings[3] = getenv("UNBAKE_LONG") ? "idle_timeout_sec=10" : "idle_timeout_sec=6";
    daemon_start(&d);
    proxy_start(&p, &d, 0.75 * (double)bytes);
    make_rooms(&d, 1, count, bytes);
    double took = run_round(&d, &p, build, 1, count, 0);
    int wrong = count_wrong(&d, 1, count);
    uint64_t whole = measure_room(&d) * (uint64_t)count;
    unsigned drops = atomic_load(&p.drops);
    uint64_t sent = atomic_load(&p.body_bytes);
    printf("%d uploads of %llu MB at once, %u connections dropped, %.1f s, %.0f MB/s\n", count,
           (unsigned long long)(bytes / 1000000), drops, took, (double)whole / took / 1e6);
    CHECK_THAT(drops > 0, "no connection was dropped");
    /* A client that asks while the end of its dropped body is still being written goes on too early and is refused,
     * once it has sent what the proxy reads at once. All drops together must not lose more. */
    CHECK_THAT(sent >= whole && sent - whole <= READ_BYTES, "%llu bytes were sent, of %llu", (unsigned long long)sent,
               (unsigned long long)whole);
    figure("uploads over dropped connections that differ from what was sent", wrong, 0, "lower");
    figure("bytes sent twice over dropped connections, per cent", 100.0 * ((double)sent / (double)whole - 1.0), 0,
           "lower");

    atomic_store(&p.is_rough, true);
    make_rooms(&d, 2, others, bytes);
    took = run_round(&d, &p, build, 2, others, kills);
    int lost = count_wrong(&d, 2, others);
    printf("%d more, %u connections reset, the daemon killed %d times, %.1f s\n", others, atomic_load(&p.drops) - drops,
           kills, took);
    figure("uploads over resets and kills of the daemon that differ from what was sent", lost, 0, "lower");
    CHECK_THAT(wrong == 0 && lost == 0, "%d and %d rooms differ", wrong, lost);
    daemon_remove(&d);
    return check_result();
}
