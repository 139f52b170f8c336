/* connection_counts.c -- see connection_counts.h. */
#include "server/net/connection_counts.h"

#include <pthread.h>
#include <string.h>

#include "common/mem.h"

#define KEPT_SHARE 20 /* one connection in 20 is kept for loopback */
#define KEPT_MIN 2    /* and this many at least, however few there may be in all */

struct connection_counts {
    size_t most, of_one; /* limit for all but loopback; for one address */
    const struct proxies *proxies;
    pthread_mutex_t mutex; /* guards what follows */
    size_t all;            /* connections */
    size_t count, room;
    struct place {
        struct address from;
        size_t connections;
    } * place; /* [room], of which count are in use; few enough for a linear search */
};

struct connection_counts *connection_counts_new(size_t connection_max, size_t of_one, const struct proxies *proxies) {
    struct connection_counts *c = mem_calloc(1, sizeof *c);
    size_t kept = connection_max / KEPT_SHARE > KEPT_MIN ? connection_max / KEPT_SHARE : KEPT_MIN;
    c->most = connection_max > kept ? connection_max - kept : 1;
    c->of_one = of_one;
    c->proxies = proxies;
    pthread_mutex_init(&c->mutex, NULL);
    return c;
}

void connection_counts_free(struct connection_counts *c) {
    if (!c)
        return;
    pthread_mutex_destroy(&c->mutex);
    mem_free(c->place);
    mem_free(c);
}

static bool is_v4(const struct address *a) {
    static const unsigned char mapped[12] = {[10] = 0xff, [11] = 0xff};
    return memcmp(a->bytes, mapped, sizeof mapped) == 0;
}

static bool is_loopback(const struct address *a) {
    static const struct address six = {.bytes = {[15] = 1}};
    return is_v4(a) ? a->bytes[12] == 127 : memcmp(a, &six, sizeof six) == 0;
}

static struct address key_of(const struct address *from) {
    struct address key = *from;
    if (!is_v4(from))
        memset(key.bytes + 8, 0, 8);
    return key;
}

static struct place *find(struct connection_counts *c, const struct address *key) {
    for (size_t i = 0; i < c->count; i++)
        if (memcmp(&c->place[i].from, key, sizeof *key) == 0)
            return &c->place[i];
    return NULL;
}

static bool is_bound(const struct connection_counts *c, const struct address *from) {
    return !is_loopback(from) && !(c->proxies && proxies_trust(c->proxies, from));
}

enum connection_answer connection_counts_enter(struct connection_counts *c, const struct address *from) {
    struct address key = key_of(from);
    enum connection_answer answer = CONNECTION_OK;
    pthread_mutex_lock(&c->mutex);
    struct place *p = find(c, &key);
    if (is_bound(c, from) && c->all >= c->most)
        answer = CONNECTION_FULL;
    else if (is_bound(c, from) && p && c->of_one > 0 && p->connections >= c->of_one)
        answer = CONNECTION_ADDRESS_FULL;
    if (answer == CONNECTION_OK && !p) {
        if (c->count == c->room) {
            c->room = c->room ? 2 * c->room : 64;
            c->place = mem_realloc_array(c->place, c->room, sizeof *c->place);
        }
        p = &c->place[c->count++];
        *p = (struct place){.from = key};
    }
    if (answer == CONNECTION_OK) {
        p->connections++;
        c->all++;
    }
    pthread_mutex_unlock(&c->mutex);
    return answer;
}

void connection_counts_leave(struct connection_counts *c, const struct address *from) {
    struct address key = key_of(from);
    pthread_mutex_lock(&c->mutex);
    struct place *p = find(c, &key);
    if (p) {
        c->all--;
        if (--p->connections == 0)
            *p = c->place[--c->count];
    }
    pthread_mutex_unlock(&c->mutex);
}
