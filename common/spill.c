/* spill.c -- see spill.h.
 *
 * Arrays in the file begin on pages of their own, one after the other; space of those given back is returned to the disk
 * but not used again.
 *
 *      0 ............ used ............ reserved
 *        arrays            reserved
 *
 * The keeper is a thread beside those of parallel.h: readers are loops of any kind, of which the longest would not come to
 * ask for it (one item of a parallel loop may look at all photographs).
 */
#include "common/spill.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

/* Time between two looks at what is mapped, far below the budget and near it. A disk of 2 GB/s maps 2 MB in a
 * millisecond, the kernel's cache up to 50 MB a thread. A look takes some microseconds. */
#define TRIM_INTERVAL_MS 10
#define TRIM_INTERVAL_NEAR_MS 1
#define NEAR_SHARE 2 /* near is more than this part of the budget */
/* Unmapped at once, and the part of the budget that a trim frees: unmapped pages that are still in the kernel's cache
 * are mapped again for about a microsecond per 64 KiB. By hand. */
#define TRIM_STEP ((size_t)32 << 20)
#define TRIM_SHARE 4
/* Part of the budget that mapped pages may have in any case, however much is in memory. */
#define LEAST_SHARE 8

#define MIB 1048576.0

struct array {
    char *base;
    size_t bytes; /* in the file: whole pages */
    off_t offset; /* in the file; -1: in memory */
};

struct spill {
    char *dir;
    struct spill_limits limits;
    size_t page;
    int statm;         /* /proc/self/statm; -1: not readable */
    uint64_t base_rss; /* bytes of other files that were mapped at the beginning: the program, its libraries */
    pthread_mutex_t mutex;
    int fd;                          /* of the file; -1: none yet */
    uint64_t used, reserved, freed;  /* bytes of the file */
    uint64_t memory, memory_claimed; /* bytes of arrays in memory; of those, and of what is reserved there */
    size_t count, capacity;
    struct array *array; /* [count] */
    size_t hand;         /* array at which the next trim goes on */
    size_t hand_offset;  /* and the byte in it */
    bool has_keeper, stopping;
    pthread_t keeper;
    pthread_cond_t stop;
};

static uint64_t file_rss(const struct spill *s) {
    char text[128];
    unsigned long long all, resident, of_files;
    ssize_t length = s->statm < 0 ? -1 : pread(s->statm, text, sizeof text - 1, 0);
    if (length <= 0)
        return 0;
    text[length] = '\0';
    return sscanf(text, "%llu %llu %llu", &all, &resident, &of_files) == 3 ? of_files * s->page : 0;
}

struct spill *spill_new(const char *dir, const struct spill_limits *limits) {
    struct spill *s = mem_calloc(1, sizeof *s);
    s->dir = mem_strdup(dir);
    s->limits = *limits;
    s->page = (size_t)sysconf(_SC_PAGESIZE);
    s->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    s->base_rss = file_rss(s);
    s->fd = -1;
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_mutex_init(&s->mutex, NULL);
    pthread_cond_init(&s->stop, &monotonic);
    pthread_condattr_destroy(&monotonic);
    return s;
}

void spill_free(struct spill *s) {
    if (!s)
        return;
    assert(s->count == 0);
    pthread_mutex_lock(&s->mutex);
    s->stopping = true;
    pthread_cond_signal(&s->stop);
    pthread_mutex_unlock(&s->mutex);
    if (s->has_keeper)
        pthread_join(s->keeper, NULL);
    pthread_cond_destroy(&s->stop);
    if (s->fd >= 0)
        close(s->fd);
    if (s->statm >= 0)
        close(s->statm);
    pthread_mutex_destroy(&s->mutex);
    mem_free(s->array);
    mem_free(s->dir);
    mem_free(s);
}

/* --- the budget ----------------------------------------------------------------------------------- */

/* Unmaps the next step's worth of pages, and has the disk write what is changed of them. Returns the bytes passed over:
 * 0 at the end of the last array. */
static size_t unmap_step(struct spill *s) {
    while (s->hand < s->count && (s->array[s->hand].offset < 0 || s->hand_offset >= s->array[s->hand].bytes)) {
        s->hand++;
        s->hand_offset = 0;
    }
    if (s->hand >= s->count) {
        s->hand = 0;
        s->hand_offset = 0;
        return 0;
    }
    const struct array *a = &s->array[s->hand];
    size_t left = a->bytes - s->hand_offset, step = left < TRIM_STEP ? left : TRIM_STEP;
    madvise(a->base + s->hand_offset, step, MADV_DONTNEED);
    /* Pages that are clean by the time memory is short can be dropped without waiting for the disk. */
    (void)sync_file_range(s->fd, a->offset + (off_t)s->hand_offset, (off_t)step, SYNC_FILE_RANGE_WRITE);
    s->hand_offset += step;
    return step;
}

/* Returns the time until it is to be called again, ms. */
static long trim(struct spill *s) {
    uint64_t budget = s->limits.memory_bytes, least = budget / LEAST_SHARE;
    budget = budget > s->memory + least ? budget - s->memory : least;
    uint64_t mapped = file_rss(s), goal = s->base_rss + budget;
    if (mapped <= goal)
        return mapped > goal - budget / NEAR_SHARE ? TRIM_INTERVAL_NEAR_MS : TRIM_INTERVAL_MS;
    goal -= budget / TRIM_SHARE;
    uint64_t all = s->used, passed = 0;
    bool wrapped = false;
    while (passed <= all && file_rss(s) > goal) {
        size_t step = unmap_step(s);
        passed += step;
        if (step == 0 && wrapped)
            break;
        wrapped = wrapped || step == 0;
    }
    return TRIM_INTERVAL_NEAR_MS;
}

static void *keep(void *argument) {
    struct spill *s = argument;
    struct timespec next;
    long interval_ms = TRIM_INTERVAL_MS;
    pthread_mutex_lock(&s->mutex);
    while (!s->stopping) {
        clock_gettime(CLOCK_MONOTONIC, &next);
        next.tv_nsec += interval_ms * 1000000L;
        next.tv_sec += next.tv_nsec / 1000000000L;
        next.tv_nsec %= 1000000000L;
        pthread_cond_timedwait(&s->stop, &s->mutex, &next);
        interval_ms = trim(s);
    }
    pthread_mutex_unlock(&s->mutex);
    return NULL;
}

static enum status start_keeper(struct spill *s, struct error *err) {
    sigset_t all, old;
    if (s->has_keeper)
        return STATUS_OK;
    sigfillset(&all); /* signals are the main thread's business */
    pthread_sigmask(SIG_SETMASK, &all, &old);
    int failure = pthread_create(&s->keeper, NULL, keep, s);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    s->has_keeper = failure == 0;
    return failure == 0 ? STATUS_OK : error_set_errno(err, failure, "cannot start the thread that keeps memory small");
}

/* --- the file ------------------------------------------------------------------------------------- */

static enum status open_file(struct spill *s, struct error *err) {
    if (s->fd >= 0)
        return STATUS_OK;
    char *path =
        file_join(s->dir, ".spill.tmp-XXXXXX"); /* as a file that is left over, if we are killed before unlink */
    s->fd = mkostemp(path, O_CLOEXEC);
    enum status status =
        s->fd < 0 ? error_set_errno(err, errno, "cannot make a file for pixels in %s", s->dir) : STATUS_OK;
    if (s->fd >= 0 && unlink(path) != 0) {
        status = error_set_errno(err, errno, "cannot remove the name of %s", path);
        close(s->fd);
        s->fd = -1;
    }
    mem_free(path);
    return status;
}

/* What the file may grow by: the least that its own limit, if there is one, and the disk leave. */
static enum status check_room(const struct spill *s, const char *what, uint64_t more, struct error *err) {
    uint64_t taken = s->reserved - s->freed, room;
    enum status status = STATUS_OK;
    if (s->limits.file_bytes > 0 && taken + more > s->limits.file_bytes) {
        error_set(err, STATUS_NO_SPACE,
                  "%s take %.0f MiB of the disk while the job runs, beside %.0f MiB that it has; %.0f MiB are left of "
                  "what its owner may keep",
                  what, (double)more / MIB, (double)taken / MIB,
                  s->limits.file_bytes > taken ? (double)(s->limits.file_bytes - taken) / MIB : 0.0);
        return error_hint(err, "Delete jobs or scenes that you do not need, or use smaller photographs.");
    }
    status = file_free_bytes(s->dir, &room, err);
    if (status == STATUS_OK && (room < s->limits.keep_free_bytes || room - s->limits.keep_free_bytes < more)) {
        error_set(err, STATUS_NO_SPACE,
                  "%s do not fit the memory and take %.0f MiB of the disk while the job runs; %.0f MiB are free, of "
                  "which %.0f MiB are kept",
                  what, (double)more / MIB, (double)room / MIB, (double)s->limits.keep_free_bytes / MIB);
        return error_hint(err, "Free space of the disk, give jobs more memory, or use smaller photographs.");
    }
    return status;
}

static enum status grow_file(struct spill *s, const char *what, uint64_t more, struct error *err) {
    enum status status = open_file(s, err);
    if (status == STATUS_OK)
        status = check_room(s, what, more, err);
    if (status == STATUS_OK)
        status = start_keeper(s, err);
    if (status != STATUS_OK)
        return status;
    int failure;
    do
        failure = posix_fallocate(s->fd, (off_t)s->reserved, (off_t)more);
    while (failure == EINTR);
    if (failure != 0) {
        /* What was allocated of it goes back to the disk. */
        if (ftruncate(s->fd, (off_t)s->reserved) != 0)
            s->reserved = s->used; /* nothing more is taken of it */
        error_set_errno(err, failure, "%s do not fit the memory, and the disk has no %.0f MiB for them", what,
                        (double)more / MIB);
        if (failure == EFBIG) /* a limit of the system on the size of files */
            err->status = STATUS_NO_SPACE;
        return err->status;
    }
    s->reserved += more;
    return STATUS_OK;
}

enum status spill_reserve(struct spill *s, const char *what, size_t count, uint64_t bytes, uint64_t later,
                          struct error *err) {
    struct error own;
    enum status status = STATUS_OK;
    if (!s || count == 0)
        return STATUS_OK;
    pthread_mutex_lock(&s->mutex);
    uint64_t claimed = s->memory_claimed > s->memory ? s->memory_claimed : s->memory;
    if (bytes + later <= s->limits.memory_bytes && claimed <= s->limits.memory_bytes - bytes - later)
        s->memory_claimed = claimed + bytes;
    else
        status = grow_file(s, what, bytes + count * s->page, err ? err : &own);
    pthread_mutex_unlock(&s->mutex);
    return status;
}

/* --- arrays --------------------------------------------------------------------------------------- */

static void note(struct spill *s, const struct array *a) {
    if (s->count == s->capacity) {
        s->capacity = s->capacity ? 2 * s->capacity : 64;
        s->array = mem_realloc_array(s->array, s->capacity, sizeof *s->array);
    }
    s->array[s->count++] = *a;
}

/* An array of what is reserved in the file; NULL where that is not enough. */
static void *take_of_file(struct spill *s, size_t bytes) {
    size_t whole = (bytes + s->page - 1) / s->page * s->page;
    if (whole > s->reserved - s->used)
        return NULL;
    struct array a = {.bytes = whole, .offset = (off_t)s->used};
    a.base = mmap(NULL, whole, PROT_READ | PROT_WRITE, MAP_SHARED, s->fd, a.offset);
    if (a.base == MAP_FAILED)
        mem_exhausted("the mapping of pixels");
    s->used += whole;
    note(s, &a);
    return a.base;
}

void *spill_take(struct spill *s, size_t count, size_t size) {
    if (!s)
        return mem_array(count, size);
    if (mem_overflows(count, size) || count * size > SIZE_MAX / 2)
        mem_exhausted("the pixels");
    size_t bytes = count * size;
    bytes = bytes > 0 ? bytes : 1;
    pthread_mutex_lock(&s->mutex);
    void *taken = take_of_file(s, bytes);
    if (!taken) {
        struct array a = {.base = mem_alloc(bytes), .bytes = bytes, .offset = -1};
        s->memory += bytes;
        note(s, &a);
        taken = a.base;
    }
    pthread_mutex_unlock(&s->mutex);
    return taken;
}

static void release(struct spill *s, const struct array *a) {
    if (a->offset < 0) {
        mem_free(a->base);
        s->memory -= a->bytes;
        s->memory_claimed -= s->memory_claimed > a->bytes ? a->bytes : s->memory_claimed;
        return;
    }
    munmap(a->base, a->bytes);
    /* Where the file system cannot do that, the space comes back when the file is closed. */
    if (fallocate(s->fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, a->offset, (off_t)a->bytes) == 0)
        s->freed += a->bytes;
}

void spill_give(struct spill *s, void *array) {
    if (!s || !array) {
        mem_free(array);
        return;
    }
    pthread_mutex_lock(&s->mutex);
    size_t i = s->count;
    while (i > 0 && s->array[i - 1].base != array)
        i--;
    if (i > 0) {
        struct array a = s->array[i - 1];
        s->array[i - 1] = s->array[--s->count];
        s->hand = 0;
        s->hand_offset = 0;
        release(s, &a);
    } else {
        mem_free(array);
    }
    pthread_mutex_unlock(&s->mutex);
}

uint64_t spill_memory_bytes(const struct spill *s) { return s->limits.memory_bytes; }

uint64_t spill_file_bytes(struct spill *s) {
    if (!s)
        return 0;
    pthread_mutex_lock(&s->mutex);
    uint64_t bytes = s->reserved - s->freed;
    pthread_mutex_unlock(&s->mutex);
    return bytes;
}
