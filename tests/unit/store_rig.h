/* store_rig.h -- for tests of the store: a folder of their own, scenes, jobs, a count of events. */
#ifndef UNBAKE_TESTS_STORE_RIG_H
#define UNBAKE_TESTS_STORE_RIG_H

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/store/store.h"
#include "tests/check.h"

#define SCENE_A "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define SCENE_B "abbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
#define SCENE_C "aaaacccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc"

static struct error err;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
#define IS(call, wanted) CHECK_THAT((call) == (wanted), "%s", err.message)

static inline char *fresh_dir(void) {
    char *dir = mem_printf("%s/unbake-test-store-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        exit(1);
    return dir;
}

static inline void drop_dir(char *dir) {
    OK(file_remove_tree(dir, &err));
    mem_free(dir);
}

static inline void add_ready_scene(struct store *store, const char *id) {
    bool existed;
    OK(store_scene_add(store, id, "room", 10, 0, &existed, &err));
    OK(store_scene_ready(store, id, NULL, "{}", &err));
}

static inline int64_t add_job(struct store *store, const char *scene, int priority) {
    struct job_new new = {
        .scene_id = scene, .name = "n", .labels = "{}", .settings = "{}", .priority = priority, .max_attempts = 2};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    CHECK(!replayed);
    return id;
}

static int64_t event_count;
static char last_event[256];
static inline void count_event(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    (void)user, (void)id, (void)at_ms, (void)attempt, (void)type;
    event_count++;
    snprintf(last_event, sizeof last_event, "%s", data);
}

static inline int64_t events_of(struct store *store, int64_t id) {
    event_count = 0;
    OK(store_event_list(store, id, 0, 1000, count_event, NULL, &err));
    return event_count;
}

/* What a reader that keeps the last id has seen; ids must grow. */
struct replay {
    int64_t last;
    size_t count, progress_count;
};

static inline void replay_one(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    struct replay *replay = user;
    (void)data;
    CHECK(id > replay->last && at_ms > 0 && attempt >= 0);
    replay->last = id;
    replay->count++;
    replay->progress_count += strcmp(type, EVENT_PROGRESS) == 0;
}

#endif
