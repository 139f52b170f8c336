/* export_rig.h -- hears what an export announces. */
#ifndef UNBAKE_TESTS_UNIT_EXPORT_RIG_H
#define UNBAKE_TESTS_UNIT_EXPORT_RIG_H

#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/export/outputs.h"
#include "tests/check.h"

struct announced {
    const char *dir;
    int previews, outputs;
    char last[64];
    bool refuse;
};

/* The file is there, whole and under its final name, when it is announced. */
static inline enum status hear(void *user, const char *type, const char *name, const char *content_type,
                               struct error *err) {
    struct announced *a = user;
    struct stat info;
    char *path = file_join(a->dir, name);
    CHECK_THAT(stat(path, &info) == 0 && info.st_size > 0, "%s", name);
    CHECK(strchr(content_type, '/') != NULL);
    mem_free(path);
    a->previews += strcmp(type, EVENT_PREVIEW) == 0;
    a->outputs += strcmp(type, EVENT_OUTPUT) == 0;
    snprintf(a->last, sizeof a->last, "%s", name);
    return a->refuse ? error_set(err, STATUS_CANCELLED, "enough") : STATUS_OK;
}

#endif
