/* source_rig.h -- a bundle of files in memory, and what the source of that name reads of it. */
#ifndef UNBAKE_TESTS_UNIT_SOURCE_RIG_H
#define UNBAKE_TESTS_UNIT_SOURCE_RIG_H

#include "common/mem.h"
#include "server/ingest/source/sources.h"
#include "tests/check.h"

#define SOURCE_RIG_FILES 64

struct source_rig {
    const char *name; /* of the source that must recognise the files */
    struct listed_file file[SOURCE_RIG_FILES];
    size_t count;
    struct listing listing;
    struct source_match match;
    struct frames t;
    struct findings findings;
    char *problems; /* as text */
};

static inline void source_rig_start(struct source_rig *r, const char *name) { *r = (struct source_rig){.name = name}; }

static inline void source_rig_put_bytes(struct source_rig *r, const char *path, const void *data, size_t size) {
    size_t i = 0;
    while (i < r->count && strcmp(r->file[i].path, path) != 0)
        i++;
    if (i == r->count) {
        if (r->count == SOURCE_RIG_FILES)
            abort();
        r->file[r->count++].path = mem_strdup(path);
    }
    char *copy = mem_alloc(size + 1);
    memcpy(copy, data, size);
    mem_free((void *)(uintptr_t)r->file[i].content);
    r->file[i].content = copy;
    r->file[i].bytes = size;
}

static inline void source_rig_put(struct source_rig *r, const char *path, const char *text) {
    source_rig_put_bytes(r, path, text, strlen(text));
}

static inline void source_rig_drop(struct source_rig *r, const char *path) {
    for (size_t i = 0; i < r->count; i++) {
        if (strcmp(r->file[i].path, path) == 0) {
            mem_free(r->file[i].path);
            mem_free((void *)(uintptr_t)r->file[i].content);
            r->file[i] = r->file[--r->count];
            return;
        }
    }
}

static inline void source_rig_clear(struct source_rig *r) {
    frames_release(&r->t);
    cJSON_Delete(r->findings.problems);
    findings_release(&r->findings);
    mem_free(r->problems);
    r->problems = NULL;
    source_match_release(&r->match);
    listing_release(&r->listing);
}

/* Reads the files; false when they are of no source. */
static inline bool source_rig_read(struct source_rig *r) {
    struct error err = {.message = ""};
    source_rig_clear(r);
    listing_of_memory(&r->listing, r->file, r->count);
    r->findings.problems = cJSON_CreateArray();
    r->match = sources_find(&r->listing, NULL);
    if (!r->match.source)
        return false;
    CHECK_STRING(r->match.source->name, r->name);
    struct source_place place = {&r->listing, r->match.base, r->match.found};
    enum status status = r->match.source->read(&place, &r->t, &r->findings, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    r->problems = json_text(r->findings.problems);
    return true;
}

/* A problem that says so. */
static inline void source_rig_refused(struct source_rig *r, const char *part) {
    CHECK(source_rig_read(r));
    CHECK_THAT(r->problems && strstr(r->problems, part), "wanted \"%s\": %s", part, r->problems);
}

static inline bool source_rig_warned(const struct source_rig *r, const char *part) {
    for (size_t i = 0; i < r->findings.warning_count && i < FINDINGS_MAX; i++)
        if (strstr(r->findings.warning[i], part))
            return true;
    return false;
}

static inline void source_rig_stop(struct source_rig *r) {
    source_rig_clear(r);
    while (r->count > 0)
        source_rig_drop(r, r->file[0].path);
}

#endif
