/* scene_cache.c -- see scene_cache.h. */
#include "server/node/scene_cache.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/node/cache_eviction.h"
#include "server/node/hash.h"

#define WAIT_MS 200  /* between two tries to take a lock */
#define TRIES_MAX 20 /* of a file whose transfers are cut off without an error */

/* --- one file --------------------------------------------------------------------------------- */

static enum status read_file_entry(const cJSON *file, const char **name, uint64_t *bytes, const char **sha256,
                                   struct error *err) {
    double number;
    enum status status = json_string(file, "name", "the list of files", "", name, err);
    if (status == STATUS_OK)
        status = json_string(file, "sha256", "the list of files", "", sha256, err);
    if (status == STATUS_OK)
        status = json_number(file, "bytes", "the list of files", -1.0, &number, err);
    if (status == STATUS_OK && (!file_path_is_plain(*name) || !(number >= 0.0 && number <= 0x1p53)))
        status = error_set(err, STATUS_INPUT, "the list of files names \"%.100s\" with %g bytes", *name, number);
    *bytes = status == STATUS_OK ? (uint64_t)number : 0;
    return status;
}

/* Whether the file is there with that size and digest. STATUS_CANCELLED only. */
static enum status check_file(const char *path, uint64_t bytes, const char *sha256, const struct scene_source *source,
                              bool *is_right, struct error *err) {
    struct stat info;
    char hex[SHA256_HEX_SIZE] = "";
    enum status status = STATUS_OK;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    bool is_candidate = fd >= 0 && fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && (uint64_t)info.st_size == bytes;
    if (is_candidate)
        status = hash_file(fd, source->go_on, source->user, hex, err);
    if (fd >= 0)
        close(fd);
    *is_right = status == STATUS_OK && is_candidate && strcmp(hex, sha256) == 0;
    return status == STATUS_CANCELLED ? status : STATUS_OK; /* what cannot be read is not right */
}

/* One try, which goes on where the last one was cut off; *size: of what is there then. */
static enum status fetch_once(const char *part, const char *name, uint64_t bytes, const struct scene_source *source,
                              uint64_t *size, struct error *err) {
    struct stat info = {0};
    int fd = open(part, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot create %s", part);
    enum status status = STATUS_OK;
    if (fstat(fd, &info) != 0 || ((uint64_t)info.st_size > bytes && ftruncate(fd, 0) != 0))
        status = error_set_errno(err, errno, "cannot empty %s", part);
    if (status == STATUS_OK && bytes > 0 && (uint64_t)info.st_size != bytes)
        status = source->fetch(source->user, name, fd, err);
    if (status == STATUS_NO_SPACE)
        error_prefix(err, "%s", part);
    if (status == STATUS_OK && fstat(fd, &info) != 0)
        status = error_set_errno(err, errno, "cannot access %s", part);
    *size = (uint64_t)info.st_size;
    if (close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot write %s", part);
    return status;
}

enum status scene_cache_fetch_file(const char *path, const cJSON *file, const struct scene_source *source,
                                   struct error *err) {
    const char *name, *sha256;
    uint64_t bytes, size = 0;
    int wrong_count = 0;
    bool is_good = false;
    enum status status = read_file_entry(file, &name, &bytes, &sha256, err);
    char *part = mem_printf("%s.part", path);
    for (int i = 0; i < TRIES_MAX && status == STATUS_OK && !is_good && wrong_count < 2; i++) {
        status = fetch_once(part, name, bytes, source, &size, err);
        if (status != STATUS_OK || size < bytes) /* cut off: what has come may be right */
            continue;
        status = check_file(part, bytes, sha256, source, &is_good, err);
        if (status != STATUS_OK || is_good)
            continue;
        wrong_count++;
        if (unlink(part) != 0)
            status = error_set_errno(err, errno, "cannot remove %s", part);
    }
    if (status == STATUS_OK && !is_good)
        status = wrong_count > 0
                     ? error_set(err, STATUS_CORRUPT,
                                 "%s has arrived with another content than the daemon announced, twice", name)
                     : error_set(err, STATUS_UNAVAILABLE, "%s does not arrive whole", name);
    if (status == STATUS_OK && rename(part, path) != 0)
        status = error_set_errno(err, errno, "cannot rename %s", part);
    mem_free(part);
    return status;
}

/* --- a scene ---------------------------------------------------------------------------------- */

/* Waits for the lock on an open file. */
static enum status wait_for(int fd, int operation, const char *path, const struct scene_source *source,
                            struct error *err) {
    while (flock(fd, operation | LOCK_NB) != 0) {
        if (errno != EWOULDBLOCK && errno != EINTR)
            return error_set_errno(err, errno, "cannot lock %s", path);
        if (!source->go_on(source->user, err))
            return STATUS_CANCELLED;
        poll(NULL, 0, WAIT_MS);
    }
    return STATUS_OK;
}

/* Opens and locks PATH; whoever removes a scene removes its locks' files too: then they are made anew. */
static enum status lock(const char *path, int operation, const struct scene_source *source, int *out,
                        struct error *err) {
    for (;;) {
        struct stat here, there;
        int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd < 0)
            return error_set_errno(err, errno, "cannot open %s", path);
        enum status status = wait_for(fd, operation, path, source, err);
        bool is_same =
            status == STATUS_OK && fstat(fd, &here) == 0 && stat(path, &there) == 0 && here.st_ino == there.st_ino;
        if (is_same) {
            *out = fd;
            return STATUS_OK;
        }
        close(fd);
        if (status != STATUS_OK)
            return status;
    }
}

static enum status make_parent(const char *path, struct error *err) {
    char *dir = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    enum status status = file_make_dirs(dir, err);
    mem_free(dir);
    return status;
}

/* The bytes of the listed files that are not right here; their indices are marked in missing[]. */
static enum status look(const char *files, const cJSON *list, bool *missing, uint64_t *bytes,
                        const struct scene_source *source, struct error *err) {
    const cJSON *file;
    size_t i = 0;
    *bytes = 0;
    cJSON_ArrayForEach(file, list) {
        const char *name, *sha256;
        uint64_t size;
        enum status status = read_file_entry(file, &name, &size, &sha256, err);
        if (status != STATUS_OK)
            return status;
        if (!source->go_on(source->user, err))
            return STATUS_CANCELLED;
        bool is_right;
        char *path = file_join(files, name);
        status = check_file(path, size, sha256, source, &is_right, err);
        missing[i++] = !is_right;
        *bytes += is_right ? 0 : size;
        mem_free(path);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Fetches the files that are marked. */
static enum status fetch(const char *files, const cJSON *list, const bool *missing, const struct scene_source *source,
                         struct error *err) {
    const cJSON *file;
    enum status status = STATUS_OK;
    size_t i = 0;
    cJSON_ArrayForEach(file, list) {
        if (missing[i++] && status == STATUS_OK) {
            const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(file, "name"));
            char *path = file_join(files, name);
            status = make_parent(path, err);
            if (status == STATUS_OK)
                status = scene_cache_fetch_file(path, file, source, err);
            mem_free(path);
        }
    }
    return status;
}

/* With the lock for fetching. Another may have fetched it while this one waited for the lock: it is looked at only
 * now. */
static enum status complete(struct cached_scene *scene, const char *cache_dir, uint64_t cache_bytes, const cJSON *list,
                            const struct scene_source *source, struct error *err) {
    bool *missing = mem_calloc((size_t)cJSON_GetArraySize(list) + 1, sizeof *missing);
    uint64_t bytes;
    enum status status = look(scene->files, list, missing, &bytes, source, err);
    if (status == STATUS_OK && bytes > 0)
        cache_eviction_make_space(cache_dir, cache_bytes, bytes);
    if (status == STATUS_OK)
        status = fetch(scene->files, list, missing, source, err);
    while (status == STATUS_NO_SPACE && cache_eviction_evict_one(cache_dir)) /* the disk is smaller than was thought */
        status = fetch(scene->files, list, missing, source, err);
    scene->fetched_bytes = bytes;
    mem_free(missing);
    return status;
}

/* Makes the folder, and looks whose it is. */
static enum status make_cache(const char *cache_dir, struct error *err) {
    struct stat own, above;
    enum status status = file_make_dirs(cache_dir, err);
    if (status != STATUS_OK)
        return status;
    char *parent = mem_printf("%s/..", cache_dir);
    if (lstat(cache_dir, &own) != 0 || stat(parent, &above) != 0)
        status = error_set_errno(err, errno, "cannot access %s", cache_dir);
    else if ((above.st_mode & S_IWOTH) && own.st_uid != geteuid() && own.st_uid != 0)
        status =
            error_set(err, STATUS_INPUT, "%s belongs to another user (%u), who may have made it to change scenes there",
                      cache_dir, (unsigned)own.st_uid);
    mem_free(parent);
    return status == STATUS_INPUT ? error_hint(err, "--cache DIR (the key cache of the executor's file) names another")
                                  : status;
}

/* The scene's two locks and its folder; what an earlier call has locked stays so. */
static enum status begin(struct cached_scene *scene, const char *use, const char *fetching,
                         const struct scene_source *source, int *fetch_fd, struct error *err) {
    enum status status = scene->use_fd < 0 ? lock(use, LOCK_SH, source, &scene->use_fd, err) : STATUS_OK;
    if (status == STATUS_OK && *fetch_fd < 0)
        status = lock(fetching, LOCK_EX, source, fetch_fd, err);
    return status == STATUS_OK ? file_make_dirs(scene->files, err) : status;
}

enum status scene_cache_take(struct cached_scene *scene, const char *cache_dir, uint64_t cache_bytes,
                             const char *scene_id, const cJSON *list, const struct scene_source *source,
                             struct error *err) {
    int fetch_fd = -1;
    *scene = (struct cached_scene){.files = file_join(cache_dir, scene_id), .use_fd = -1};
    char *use = mem_printf("%s" CACHE_USE, scene->files), *fetching = mem_printf("%s" CACHE_FETCH, scene->files);
    enum status status = make_cache(cache_dir, err);
    if (status == STATUS_OK)
        status = begin(scene, use, fetching, source, &fetch_fd, err);
    while (status == STATUS_NO_SPACE && cache_eviction_evict_one(cache_dir)) /* even a name takes space */
        status = begin(scene, use, fetching, source, &fetch_fd, err);
    if (status == STATUS_OK)
        status = complete(scene, cache_dir, cache_bytes, list, source, err);
    if (status == STATUS_OK)
        futimens(scene->use_fd, NULL); /* only the order in which scenes are given up hangs on it */
    if (fetch_fd >= 0)
        close(fetch_fd);
    mem_free(fetching);
    mem_free(use);
    return status;
}

void cached_scene_release(struct cached_scene *scene) {
    if (scene->use_fd >= 0)
        close(scene->use_fd);
    mem_free(scene->files);
    *scene = (struct cached_scene){.use_fd = -1};
}
