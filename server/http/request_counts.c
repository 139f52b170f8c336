/* request_counts.c -- see request_counts.h. The number of labels is bounded whatever clients send: requests without a
 * route share a row, and a status that this daemon never sends counts as 0. */
#include "server/http/request_counts.h"

#include <stdatomic.h>

#include "common/mem.h"
#include "server/http/routes.h"

static const int codes[] = {0,   200, 201, 202, 204, 206, 304, 400, 401, 403, 404, 405, 408, 409, 410, 411,
                            412, 413, 414, 415, 416, 417, 422, 423, 428, 429, 431, 460, 500, 503, 507};
#define CODES (sizeof codes / sizeof *codes)

struct request_counts {
    size_t route_count;            /* the last row is for requests without a route */
    atomic_ullong (*count)[CODES]; /* [route_count + 1]; owned */
};

struct request_counts *request_counts_new(void) {
    struct request_counts *t = mem_calloc(1, sizeof *t);
    routes_table(&t->route_count);
    t->count = mem_calloc(t->route_count + 1, sizeof *t->count);
    return t;
}

void request_counts_free(struct request_counts *t) {
    if (t)
        mem_free(t->count);
    mem_free(t);
}

void request_counts_add(struct request_counts *t, const struct request *r, int status) {
    size_t row = r->route ? (size_t)(r->route - routes_table(&(size_t){0})) : t->route_count, code = 0;
    for (size_t i = 0; i < CODES; i++)
        if (codes[i] == status)
            code = i;
    atomic_fetch_add(&t->count[row][code], 1);
}

void request_counts_print(struct request_counts *t, const char *name, struct buf *b) {
    static const char *const methods[] = {
        [METHOD_GET] = "GET",       [METHOD_POST] = "POST",       [METHOD_PATCH] = "PATCH",
        [METHOD_DELETE] = "DELETE", [METHOD_OPTIONS] = "OPTIONS", [METHOD_PUT] = "PUT"};
    size_t count;
    const struct route *table = routes_table(&count);
    for (size_t row = 0; row <= count; row++)
        for (size_t i = 0; i < CODES; i++) {
            unsigned long long n = atomic_load(&t->count[row][i]);
            if (n == 0)
                continue;
            buf_printf(b, "%s{method=\"%s\",route=\"%s\",code=\"%d\"} %llu\n", name,
                       row < count ? methods[table[row].method] : "other", row < count ? table[row].pattern : "none",
                       codes[i], n);
        }
}
