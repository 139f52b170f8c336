/* event_rig.h -- event streams of jobs. */
#ifndef UNBAKE_TESTS_API_EVENT_RIG_H
#define UNBAKE_TESTS_API_EVENT_RIG_H

#include "tests/api/rig.h"

static inline int open_stream(const struct rig *rig, int64_t job, const char *query, const char *fields) {
    int fd = rig_connect(rig);
    char *text =
        mem_printf("GET /v1/jobs/%lld/events%s HTTP/1.1\r\nHost: localhost\r\n%s\r\n", (long long)job, query, fields);
    rig_send(fd, text, strlen(text));
    mem_free(text);
    return fd;
}

static inline void add_metric(struct rig *rig, int64_t job, int attempt, int step) {
    char data[64];
    struct error err;
    snprintf(data, sizeof data, "{\"series\":\"loss\",\"step\":%d,\"value\":0.5}", step);
    rig_must(store_event_add(rig->store, job, attempt, EVENT_METRIC, data, &err), &err, "store_event_add");
}

#endif
