/* test_scene_cache.c -- scenes on a node's disk: fetched once for all, what is damaged or half there is made good, what
 * is in use stays, the rest goes, the oldest first. */
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/node/cache_eviction.h"
#include "server/node/scene_cache.h"
#include "tests/check.h"
#include "tests/system_faults.h"

#define SCENE_A "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define SCENE_B "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
#define SCENE_C "cccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccccc"
#define BYTES 30000

static struct error err;
static char dir[] = "/tmp/unbake-test-cache-XXXXXX";

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

/* The daemon: every file has the same letter BYTES times; some go wrong. */
struct store {
    long fetches;
    uint64_t bytes; /* sent */
    int break_at;   /* bytes of the first fetch, which then fails; 0: none */
    int wrong;      /* fetches that have another content */
    int full;       /* fetches that meet a full disk */
    bool is_stopped;
};

static char letter_of(const char *name) { return name[strlen(name) - 1]; }

static enum status send_rest(void *user, const char *name, int fd, struct error *why) {
    struct store *s = user;
    struct stat info;
    char content[BYTES];
    s->fetches++;
    memset(content, s->wrong > 0 ? '?' : letter_of(name), BYTES);
    s->wrong -= s->wrong > 0;
    if (s->full > 0) {
        s->full--;
        return error_set(why, STATUS_NO_SPACE, "full");
    }
    CHECK(fstat(fd, &info) == 0 && info.st_size < BYTES);
    size_t end = s->break_at ? (size_t)s->break_at : BYTES, more = end - (size_t)info.st_size;
    CHECK(pwrite(fd, content + info.st_size, more, info.st_size) == (ssize_t)more);
    s->bytes += more;
    if (!s->break_at)
        return STATUS_OK;
    s->break_at = 0;
    return error_set(why, STATUS_UNAVAILABLE, "broken");
}

static bool go_on(void *user, struct error *why) {
    if (((struct store *)user)->is_stopped)
        error_set(why, STATUS_CANCELLED, "stopped");
    return !((struct store *)user)->is_stopped;
}

static cJSON *list_of(const char *const *names, size_t count) {
    cJSON *list = cJSON_CreateArray();
    for (size_t i = 0; i < count; i++) {
        char content[BYTES], hex[SHA256_HEX_SIZE];
        cJSON *file = cJSON_CreateObject();
        memset(content, letter_of(names[i]), BYTES);
        sha256_of(content, BYTES, hex);
        json_add_string(file, "name", names[i]);
        json_add_int(file, "bytes", BYTES);
        json_add_string(file, "sha256", hex);
        cJSON_AddItemToArray(list, file);
    }
    return list;
}

/* Takes a scene of two files. */
static enum status take(struct store *s, const char *id, uint64_t bound, struct cached_scene *scene) {
    static const char *const names[] = {"a", "images/deep/b"};
    const struct scene_source source = {.user = s, .fetch = send_rest, .go_on = go_on};
    cJSON *list = list_of(names, 2);
    enum status status = scene_cache_take(scene, dir, bound, id, list, &source, &err);
    cJSON_Delete(list);
    return status;
}

static enum status use(struct store *s, const char *id, uint64_t bound) {
    struct cached_scene scene;
    enum status status = take(s, id, bound, &scene);
    cached_scene_release(&scene);
    return status;
}

static bool has(const char *name) { return file_is_in(dir, name); }

static void test_faults(void) {
    struct store s = {0};
    char *b = file_join(dir, SCENE_A "/images/deep/b");
    OK(use(&s, SCENE_A, 0));
    CHECK(s.fetches == 2 && s.bytes == 2 * BYTES);
    OK(use(&s, SCENE_A, 0));
    CHECK(s.fetches == 2);
    OK(file_replace(b, "x", 1, &err)); /* damaged: of another size, then of the same */
    OK(use(&s, SCENE_A, 0));
    CHECK(s.fetches == 3);
    int fd = open(b, O_WRONLY);
    CHECK(pwrite(fd, "x", 1, 100) == 1);
    close(fd);
    OK(use(&s, SCENE_A, 0));
    CHECK(s.fetches == 4);

    /* Half of it comes; the rest is asked for the next time. */
    CHECK(unlink(b) == 0);
    s = (struct store){.break_at = 1000};
    CHECK(use(&s, SCENE_A, 0) == STATUS_UNAVAILABLE);
    OK(use(&s, SCENE_A, 0));
    CHECK(s.bytes == BYTES);
    /* It comes wrong: once more, then that is said. */
    CHECK(unlink(b) == 0);
    s = (struct store){.wrong = 1};
    OK(use(&s, SCENE_A, 0));
    CHECK(s.fetches == 2);
    CHECK(unlink(b) == 0);
    s = (struct store){.wrong = 2};
    CHECK(use(&s, SCENE_A, 0) == STATUS_CORRUPT);
    CHECK(access(b, F_OK) != 0);
    s = (struct store){.is_stopped = true};
    CHECK(use(&s, SCENE_A, 0) == STATUS_CANCELLED);
    mem_free(b);
}

/* A list that would lead out of the folder. */
static void test_names(void) {
    static const char *const bad[] = {"../a", "/etc/a", "images/../../a", "a//b", "", ".", "x/./a"};
    struct store s = {0};
    const struct scene_source source = {.user = &s, .fetch = send_rest, .go_on = go_on};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct cached_scene scene;
        char content[1] = "", hex[SHA256_HEX_SIZE];
        cJSON *list = cJSON_CreateArray(), *file = cJSON_CreateObject();
        sha256_of(content, 0, hex);
        json_add_string(file, "name", bad[i]);
        json_add_int(file, "bytes", 0);
        json_add_string(file, "sha256", hex);
        cJSON_AddItemToArray(list, file);
        CHECK_THAT(scene_cache_take(&scene, dir, 0, SCENE_C, list, &source, &err) == STATUS_INPUT, "%s", bad[i]);
        cached_scene_release(&scene);
        cJSON_Delete(list);
    }
}

/* Somebody else has made the cache's folder where everybody may make one. */
static void test_owner(void) {
    struct store s = {0};
    struct cached_scene scene;
    const struct scene_source source = {.user = &s, .fetch = send_rest, .go_on = go_on};
    char *open_dir = file_join(dir, "open"), *theirs = file_join(open_dir, "scenes");
    cJSON *list = cJSON_CreateArray();
    OK(file_make_dirs(theirs, &err));
    CHECK(chmod(open_dir, 01777) == 0);
    OK(scene_cache_take(&scene, theirs, 0, SCENE_A, list, &source, &err));
    cached_scene_release(&scene);
    if (chown(theirs, 12345, (gid_t)-1) == 0) { /* root only */
        CHECK(scene_cache_take(&scene, theirs, 0, SCENE_A, list, &source, &err) == STATUS_INPUT);
        CHECK_THAT(strstr(err.message, "belongs to another user (12345)"), "%s", err.message);
        cached_scene_release(&scene);
        CHECK(chmod(open_dir, 0755) == 0); /* there its owner was trusted to make it */
        OK(scene_cache_take(&scene, theirs, 0, SCENE_A, list, &source, &err));
        cached_scene_release(&scene);
    }
    OK(file_remove_tree(open_dir, &err));
    cJSON_Delete(list);
    mem_free(theirs);
    mem_free(open_dir);
}

static void set_age(const char *id, time_t age_sec) {
    char *name = mem_printf("%s/%s" CACHE_USE, dir, id);
    const struct timespec times[2] = {{.tv_sec = time(NULL) - age_sec}, {.tv_sec = time(NULL) - age_sec}};
    CHECK(utimensat(AT_FDCWD, name, times, 0) == 0);
    mem_free(name);
}

static void test_room(void) {
    struct store s = {0};
    struct cached_scene held;
    uint64_t two = 4 * BYTES + 4 * 16384; /* two scenes, with what the file system takes for their folders */
    OK(take(&s, SCENE_A, two, &held));
    OK(use(&s, SCENE_B, two));
    set_age(SCENE_A, 1000);
    set_age(SCENE_B, 10);
    OK(use(&s, SCENE_C, two)); /* the oldest is in use */
    CHECK(has(SCENE_A) && !has(SCENE_B) && has(SCENE_C) && !has(SCENE_B CACHE_USE) && !has(SCENE_B CACHE_FETCH));
    cached_scene_release(&held);
    OK(use(&s, SCENE_B, two));
    CHECK(!has(SCENE_A) && has(SCENE_B) && has(SCENE_C));
    /* A full disk is met while it is fetched. */
    set_age(SCENE_C, 100);
    s = (struct store){.full = 1};
    OK(use(&s, SCENE_A, 0));
    CHECK(has(SCENE_A) && has(SCENE_B) && !has(SCENE_C));
    /* So full that not even a lock has room. */
    s = (struct store){0};
    set_age(SCENE_B, 100);
    system_faults_arm_only("open", 2, false);
    OK(use(&s, SCENE_C, 0));
    CHECK(system_faults_lift() && has(SCENE_A) && !has(SCENE_B) && has(SCENE_C));
    set_age(SCENE_C, 1000);
    CHECK(cache_eviction_evict_one(dir));
    OK(use(&s, SCENE_B, 0));
    s = (struct store){.full = 99};
    CHECK(use(&s, SCENE_C, 0) == STATUS_NO_SPACE);
    CHECK(!has(SCENE_A) && !has(SCENE_B));
}

/* Processes that come at once fetch it once; others remove it meanwhile, and nobody sees half a scene. */
static void test_together(void) {
    for (int i = 0; i < 6; i++)
        if (fork() == 0) {
            struct store s = {0};
            struct cached_scene scene;
            for (int k = 0; k < 30; k++) {
                if (i >= 4) {
                    cache_eviction_evict_one(dir);
                    continue;
                }
                OK(take(&s, SCENE_A, 0, &scene));
                char *path = file_join(scene.files, "images/deep/b");
                struct stat info;
                CHECK(stat(path, &info) == 0 && info.st_size == BYTES);
                usleep(1000);
                CHECK(stat(path, &info) == 0);
                mem_free(path);
                cached_scene_release(&scene);
            }
            _exit(check_result());
        }
    for (int i = 0; i < 6; i++) {
        int status = 1;
        CHECK(wait(&status) > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
}

int main(void) {
    if (!mkdtemp(dir))
        return 1;
    test_faults();
    test_names();
    test_owner();
    test_room();
    test_together();
    OK(file_remove_tree(dir, &err));
    return check_result();
}
