/* daemon_kill BUILD ARCHIVE KILLS -- the daemon is killed with SIGKILL at random moments while clients
 * submit, upload, act on jobs and read the stream of events. After each kill: the database is whole,
 * the daemon is ready again soon, and everything that it had acknowledged is so; at the end: nothing
 * is there twice, and the reader of events has missed and repeated none. */
#include <pthread.h>
#include <sqlite3.h>
#include <stdatomic.h>

#include "tests/chaos/daemon.h"

#define SUBMITTERS 3
#define KEPT 200 /* jobs and scenes of one client that are looked after; older ones are deleted */
#define EVENT_MAX 4000000

enum known { GONE, THERE, CANCELLED, UNSURE };

struct made {
    long long id;
    long number;
    char sha256[65];
    enum known known;
};

struct client {
    pthread_t thread;
    int index;
    long next; /* number of the next thing that it makes */
    struct made made[KEPT];
    atomic_long acknowledged;
    unsigned random;
};

static struct daemon daemon_;
static char scene[65];
static atomic_bool stopping;
static struct client client[SUBMITTERS + 1]; /* the last one uploads */
static unsigned char *seen;                  /* [EVENT_MAX] times that an event came */
static long long last_event;
static long lost, twice, broken;

static unsigned draw(struct client *c) {
    c->random = c->random * 1664525u + 1013904223u;
    return c->random >> 8;
}

/* --- the load -------------------------------------------------------------------------------- */

static void submit(struct client *c) {
    struct buf body;
    char key[64],
        *json = mem_printf("{\"scene\":\"%s\",\"name\":\"c%d-%ld\",\"settings\":{\"texture_size\":64,"
                           "\"iterations\":3,\"texels_per_iteration\":64,\"report_samples\":1,"
                           "\"gather_samples\":16,\"gloss_passes\":1,\"texels_per_metre\":2," CLOSED_ROOM "}}",
                           scene, c->index, c->next);
    snprintf(key, sizeof key, "Idempotency-Key: c%d-%ld\r\n", c->index, c->next);
    /* Without an answer the next round sends the same again: one job comes of it. */
    int status = http_json(daemon_.port, "POST", "/v1/jobs", key, json, &body);
    struct made *m = &c->made[c->next % KEPT];
    if (status == 201 || status == 200) {
        *m = (struct made){.number = c->next, .known = THERE};
        sscanf(buf_text(&body), "{\"id\":%lld", &m->id);
        c->next++;
        c->acknowledged++;
    } else if (status != 0) {
        CHECK_THAT(status == 503, "a submission gets %d: %s", status, buf_text(&body));
    }
    buf_release(&body);
    mem_free(json);
}

static void act(struct client *c) {
    struct made *m = &c->made[draw(c) % KEPT];
    struct buf body;
    char path[64];
    if (m->known != THERE)
        return;
    bool cancels = draw(c) % 2;
    static const char *const actions[] = {"pause", "resume", "retry"};
    snprintf(path, sizeof path, "/v1/jobs/%lld/%s", m->id, cancels ? "cancel" : actions[draw(c) % 3]);
    int status = http_ask(daemon_.port, "POST", path, "", "", 0, &body);
    buf_release(&body);
    if (cancels && status != 409 && status != 503)
        m->known = status == 202 ? CANCELLED : UNSURE;
    c->acknowledged += status == 202;
}

/* The oldest makes room for the next. */
static void remove_oldest(struct client *c, const char *folder) {
    struct made *m = &c->made[c->next % KEPT];
    struct buf body;
    char path[128], id[24];
    if (m->known == GONE)
        return;
    snprintf(id, sizeof id, "%lld", m->id);
    snprintf(path, sizeof path, "/v1/%s/%s", folder, m->id ? id : m->sha256);
    int status = http_ask(daemon_.port, "DELETE", path, "", "", 0, &body);
    if (status == 409 && m->id) { /* it runs, just now */
        buf_release(&body);
        snprintf(path, sizeof path, "/v1/jobs/%lld/cancel", m->id);
        http_ask(daemon_.port, "POST", path, "", "", 0, &body);
    }
    if (status == 204 || status == 404)
        m->known = GONE;
    else if (status == 0) /* it may be gone */
        m->known = UNSURE;
    c->acknowledged += status == 204;
    buf_release(&body);
}

static void upload(struct client *c) {
    struct buf body;
    size_t length = 1000 + draw(c) % 200000;
    char *bytes = mem_alloc(length);
    memset(bytes, (int)(c->next % 251), length);
    memcpy(bytes, &c->next, sizeof c->next);
    int status = http_ask(daemon_.port, "POST", "/v1/scenes", "", bytes, length, &body);
    struct made *m = &c->made[c->next % KEPT];
    if (status == 201 || status == 200) {
        *m = (struct made){.number = c->next++, .known = THERE};
        sscanf(strstr(buf_text(&body), "\"id\":\"") + 6, "%64[0-9a-f]", m->sha256);
        c->acknowledged++;
    }
    buf_release(&body);
    mem_free(bytes);
}

static void *load(void *user) {
    struct client *c = user;
    bool uploads = c->index == SUBMITTERS;
    while (!atomic_load(&stopping)) {
        remove_oldest(c, uploads ? "scenes" : "jobs");
        if (c->made[c->next % KEPT].known == GONE) {
            if (uploads)
                upload(c);
            else
                submit(c);
        }
        for (unsigned i = draw(c) % 4; i > 0 && !uploads && !atomic_load(&stopping); i--)
            act(c);
    }
    return NULL;
}

/* Reads the stream until it breaks. */
static void *read_events(void *user) {
    (void)user;
    struct buf text;
    char chunk[16384];
    ssize_t got;
    int fd = http_connect(daemon_.port);
    if (fd < 0)
        return NULL;
    char *head = mem_printf("GET /v1/events?after=%lld HTTP/1.1\r\nHost: localhost\r\n\r\n", last_event);
    http_send(fd, head, strlen(head));
    mem_free(head);
    buf_init(&text, (size_t)64 << 20);
    while ((got = recv(fd, chunk, sizeof chunk, 0)) > 0) {
        buf_append(&text, chunk, (size_t)got);
        char *at = text.data, *end;
        while ((end = strstr(at, "\n\n")) != NULL) {
            *end = '\0';
            const char *id = strstr(at, "id: ");
            if (id && strstr(at, "event: ") && !strstr(at, "event: resync")) {
                long long number = strtoll(id + 4, NULL, 10);
                if (number <= last_event || number >= EVENT_MAX) {
                    fprintf(stderr, "event %lld after %lld\n", number, last_event);
                    twice++;
                } else {
                    seen[number]++;
                    last_event = number;
                }
            }
            at = end + 2;
        }
        buf_consume(&text, (size_t)(at - text.data));
    }
    buf_release(&text);
    close(fd);
    return NULL;
}

static long count_acknowledged(void) {
    long sum = 0;
    for (int i = 0; i <= SUBMITTERS; i++)
        sum += atomic_load(&client[i].acknowledged);
    return sum;
}

/* --- the checks ------------------------------------------------------------------------------ */

static void check_integrity(void) {
    sqlite3 *db = NULL;
    sqlite3_stmt *stmt = NULL;
    char *path = file_join(daemon_.data, "state.db");
    bool whole = sqlite3_open(path, &db) == SQLITE_OK &&
                 sqlite3_prepare_v2(db, "PRAGMA integrity_check", -1, &stmt, NULL) == SQLITE_OK &&
                 sqlite3_step(stmt) == SQLITE_ROW && strcmp((const char *)sqlite3_column_text(stmt, 0), "ok") == 0;
    broken += !whole;
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    mem_free(path);
}

static bool is_as_acknowledged(const struct client *c, const struct made *m) {
    struct buf body;
    char path[128], id[24], name[64];
    if (m->known == UNSURE)
        return true;
    snprintf(id, sizeof id, "%lld", m->id);
    snprintf(path, sizeof path, "/v1/%s/%s", m->id ? "jobs" : "scenes", m->id ? id : m->sha256);
    snprintf(name, sizeof name, "\"name\":\"c%d-%ld\"", c->index, m->number);
    int status = http_get(daemon_.port, path, &body);
    const char *text = buf_text(&body);
    bool so = m->known == GONE ? status == 404 : status == 200;
    if (m->known != GONE && m->id)
        so = so && strstr(text, name);
    if (m->known == CANCELLED)
        so = so && strstr(text, "\"state\":\"cancelled\"");
    if (!so)
        fprintf(stderr, "%s: %d, known as %d: %.200s\n", path, status, (int)m->known, text);
    buf_release(&body);
    return so;
}

/* All jobs: names are unique. And of every event that is stored, the reader has had one. */
static void check_whole(void) {
    sqlite3 *db = NULL;
    sqlite3_stmt *stmt = NULL;
    char *path = file_join(daemon_.data, "state.db");
    sqlite3_open(path, &db);
    sqlite3_prepare_v2(db, "SELECT count(*) - count(DISTINCT name) FROM jobs", -1, &stmt, NULL);
    CHECK(sqlite3_step(stmt) == SQLITE_ROW);
    twice += (long)sqlite3_column_int64(stmt, 0);
    sqlite3_finalize(stmt);
    long missed = 0, stored = 0, repeated = 0;
    sqlite3_prepare_v2(db, "SELECT id FROM events WHERE id <= ?", -1, &stmt, NULL);
    sqlite3_bind_int64(stmt, 1, last_event);
    for (; sqlite3_step(stmt) == SQLITE_ROW; stored++)
        missed += !seen[sqlite3_column_int64(stmt, 0)];
    for (long i = 0; i < EVENT_MAX; i++)
        repeated += seen[i] > 1;
    CHECK_THAT(missed == 0 && repeated == 0, "%ld of %ld events missed, %ld repeated", missed, stored, repeated);
    sqlite3_finalize(stmt);
    sqlite3_close(db);
    mem_free(path);
}

/* Counts what was acknowledged and is not so: the newest changes of each client, or all that are kept. */
static void check_acknowledged(bool all) {
    for (int i = 0; i <= SUBMITTERS; i++)
        for (long k = 0; k < (all ? KEPT : 6); k++) {
            const struct client *c = &client[i];
            const struct made *m = &c->made[(c->next + KEPT - 1 - k) % KEPT];
            if (m->id || m->sha256[0])
                lost += !is_as_acknowledged(c, m);
        }
}

int main(int argc, char **argv) {
    long kills = argc == 4 ? strtol(argv[3], NULL, 10) : 0, acknowledged = 0;
    if (kills <= 0)
        return 2;
    double *ready = mem_calloc((size_t)kills, sizeof *ready);
    seen = mem_calloc(EVENT_MAX, 1);
    daemon_init(&daemon_, argv[1]);
    const char *settings[] = {"min_free_mib=0", "max_running=1", "queue_limit=100000", "log_level=warning",
                              "checkpoint_interval_sec=0.2"};
    memcpy(daemon_.settings, settings, sizeof settings);
    daemon_start(&daemon_);
    daemon_scene(&daemon_, argv[2], scene);
    unsigned random = 4711;
    for (int i = 0; i <= SUBMITTERS; i++)
        client[i] = (struct client){.index = i, .random = (unsigned)i * 77 + 1};
    for (long kill_count = 0; kill_count < kills; kill_count++) {
        pthread_t reader;
        atomic_store(&stopping, false);
        pthread_create(&reader, NULL, read_events, NULL);
        for (int i = 0; i <= SUBMITTERS; i++)
            pthread_create(&client[i].thread, NULL, load, &client[i]);
        /* Not before something was acknowledged in this life, however slow the machine is. */
        for (long before = count_acknowledged(); count_acknowledged() < before + 2; usleep(1000))
            continue;
        random = random * 1664525u + 1013904223u;
        usleep(5000 + (random >> 8) % (kill_count % 8 ? 120000 : 500000));
        daemon_signal(&daemon_, SIGKILL);
        atomic_store(&stopping, true);
        for (int i = 0; i <= SUBMITTERS; i++)
            pthread_join(client[i].thread, NULL);
        pthread_join(reader, NULL);
        if (kill_count % 100 == 99)
            printf("%ld kills\n", kill_count + 1), fflush(stdout);
        check_integrity();
        ready[kill_count] = daemon_start(&daemon_);
        check_acknowledged(kill_count % 50 == 0);
    }
    pthread_t reader; /* what has not been read yet */
    pthread_create(&reader, NULL, read_events, NULL);
    usleep(1500000);
    daemon_signal(&daemon_, SIGTERM);
    pthread_join(reader, NULL);
    check_whole();
    acknowledged = count_acknowledged();
    double median = percentile(ready, (size_t)kills, 0.5);
    printf("%ld kills, %ld acknowledged changes, events up to %lld; ready again after %.3f s (median), %.3f s (99 %%), "
           "%.3f s (worst)\n",
           kills, acknowledged, last_event, median, percentile(ready, (size_t)kills, 0.99),
           percentile(ready, (size_t)kills, 1.0));
    figure("kills of the daemon under load", (double)kills, 2000, "higher");
    figure("kills of the daemon: acknowledged changes lost", (double)lost, 0, "lower");
    figure("kills of the daemon: jobs or events twice", (double)twice, 0, "lower");
    figure("kills of the daemon: failed integrity checks", (double)broken, 0, "lower");
    figure("kills of the daemon: seconds to ready, 99 %", percentile(ready, (size_t)kills, 0.99), 1, "lower");
    CHECK(lost == 0 && twice == 0 && broken == 0 && acknowledged > kills);
    daemon_remove(&daemon_);
    mem_free(ready);
    return check_result();
}
