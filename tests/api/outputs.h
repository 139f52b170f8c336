/* outputs.h -- for tests over rig.h: outputs of a job as its worker would leave them, and replies about them. */
#ifndef UNBAKE_TESTS_API_OUTPUTS_H
#define UNBAKE_TESTS_API_OUTPUTS_H

#include "common/sha256.h"
#include "tests/api/rig.h"

static inline void write_output(struct rig *rig, int64_t job, const char *name, const void *data, size_t length) {
    struct error err;
    char *path = mem_printf("%s/jobs/%lld/attempt-1/out/%s", rig->dir, (long long)job, name);
    char *slash = strrchr(path, '/');
    *slash = '\0';
    rig_must(file_make_dirs(path, &err), &err, "file_make_dirs");
    *slash = '/';
    rig_must(file_replace(path, data, length, &err), &err, "file_replace");
    mem_free(path);
}

static inline void announce(struct rig *rig, int64_t job, int attempt, const char *name, const void *data,
                            size_t length) {
    struct error err;
    char hex[SHA256_HEX_SIZE];
    sha256_of(data, length, hex);
    rig_must(store_output_put(rig->store, job, attempt, EVENT_OUTPUT, name, length, hex, "image/x-exr", &err), &err,
             "store_output_put");
}

static inline void field_of(const struct buf *reply, const char *name, char value[256]) {
    char *key = mem_printf("\r\n%s: ", name);
    const char *at = strstr(buf_text(reply), key);
    value[0] = '\0';
    if (at)
        snprintf(value, 256, "%.*s", (int)strcspn(at + strlen(key), "\r"), at + strlen(key));
    mem_free(key);
}

static inline void check_field(const struct buf *reply, const char *name, const char *wanted) {
    char value[256];
    field_of(reply, name, value);
    CHECK_STRING(value, wanted);
}

/* GETs a path of the job; the status must be that one. */
static inline void ask(struct rig *rig, int64_t job, const char *path, const char *fields, int status,
                       struct buf *reply) {
    char *full = mem_printf("/v1/jobs/%lld/%s", (long long)job, path);
    int found = rig_get(rig, full, fields, reply);
    CHECK_THAT(found == status, "%s (%s): %d, not %d", path, fields, found, status);
    mem_free(full);
}

#endif
