/* cache_eviction.c -- see cache_eviction.h. */
#include "server/node/cache_eviction.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"

struct kept {
    char *files; /* the scene's folder; owned */
    struct timespec used;
};

static int by_use(const void *a, const void *b) {
    const struct timespec *x = &((const struct kept *)a)->used, *y = &((const struct kept *)b)->used;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? -1 : 1;
    return x->tv_nsec < y->tv_nsec ? -1 : x->tv_nsec > y->tv_nsec;
}

/* The scenes, the one that was not used for longest first; the caller's. */
static struct kept *list_kept(const char *cache_dir, size_t *count) {
    char **names = NULL;
    size_t name_count = 0;
    struct error err;
    *count = 0;
    if (file_list(cache_dir, &names, &name_count, &err) != STATUS_OK)
        log_warning("%s", err.message);
    struct kept *list = mem_calloc(name_count + 1, sizeof *list);
    for (size_t i = 0; i < name_count; i++) {
        size_t length = strlen(names[i]), ending = strlen(CACHE_USE);
        struct stat info;
        char *path = file_join(cache_dir, names[i]);
        if (length > ending && strcmp(names[i] + length - ending, CACHE_USE) == 0 && lstat(path, &info) == 0)
            list[(*count)++] = (struct kept){.files = mem_strndup(path, strlen(path) - ending), .used = info.st_mtim};
        mem_free(path);
    }
    file_free_names(names, name_count);
    qsort(list, *count, sizeof *list, by_use);
    return list;
}

static void free_kept(struct kept *list, size_t count) {
    for (size_t i = 0; i < count; i++)
        mem_free(list[i].files);
    mem_free(list);
}

/* Removes the scene if nobody uses it, and its locks' files while it still has them locked. */
static bool give_up(const struct kept *kept) {
    char *use = mem_printf("%s" CACHE_USE, kept->files), *fetching = mem_printf("%s" CACHE_FETCH, kept->files);
    int fd = open(use, O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    struct error err;
    bool is_free = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0, is_gone = false;
    if (is_free) {
        is_gone = file_remove_tree(kept->files, &err) == STATUS_OK;
        if (!is_gone)
            log_warning("%s", err.message);
        else if (unlink(fetching) != 0 || unlink(use) != 0)
            log_debug("%s had no lock file left", kept->files);
    }
    if (fd >= 0)
        close(fd);
    mem_free(fetching);
    mem_free(use);
    return is_gone;
}

void cache_eviction_make_space(const char *cache_dir, uint64_t cache_bytes, uint64_t bytes) {
    size_t count;
    uint64_t kept_bytes = 0, files, size;
    if (cache_bytes == 0 || file_tree_size(cache_dir, &files, &kept_bytes, NULL) != STATUS_OK)
        return;
    struct kept *list = list_kept(cache_dir, &count);
    for (size_t i = 0; i < count && kept_bytes + bytes > cache_bytes; i++)
        if (file_tree_size(list[i].files, &files, &size, NULL) == STATUS_OK && give_up(&list[i]))
            kept_bytes -= size < kept_bytes ? size : kept_bytes;
    free_kept(list, count);
}

bool cache_eviction_evict_one(const char *cache_dir) {
    size_t count;
    bool is_gone = false;
    struct kept *list = list_kept(cache_dir, &count);
    for (size_t i = 0; i < count && !is_gone; i++)
        is_gone = give_up(&list[i]);
    free_kept(list, count);
    return is_gone;
}
