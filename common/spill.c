/* spill.c -- see spill.h.
 *
 * Arrays in the file begin on pages of their own, one after the other; space of those given back is returned to the
 * disk but not used again. The file is mapped once, at `file.base`, so that an address tells the chunk.
 *
 *      0 ............ used ............ reserved ............ file.bytes
 *        arrays            reserved               addresses only
 *
 * A chunk is ABSENT, MAPPED or USED:
 *
 *      ABSENT --use--> USED --the hand passes--> MAPPED --the hand passes again--> ABSENT
 *                       ^-----------use------------'
 *
 * (second chance, or CLOCK; Corbato 1968). Whoever makes one more than the budget present moves the hand, until an
 * eighth of the budget is free. A chunk is unmapped after it is ABSENT; readers that are still in it only fault its
 * pages in again, so no pin is needed and contents never depend on the hand. What is mapped that way, or by readers
 * that do not call spill_use, is not counted: a thread, the keeper, looks at what the kernel counts and unmaps that
 * too.
 */
#include "common/spill.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

/* A fault maps the pages around it that are in the kernel's cache: 64 KiB at most, aligned (fault_around_bytes of
 * mm/memory.c), which is what is counted and unmapped as one. */
#define CHUNK ((size_t)64 << 10)
/* Readers go on with at least so many chunks, however small the budget: one per array and row that a few threads
 * read. */
#define MIN_CHUNKS 64
/* Part of the budget that the hand frees at a time, so that threads interrupt each other seldom. Moves time only. */
#define FREED_SHARE 8
/* Part of the budget that mapped pages may have in any case, however much is in memory. */
#define MIN_SHARE 8
/* The keeper's: time between two looks, and the part of the budget beyond it that it leaves alone. */
#define KEEPER_INTERVAL_MS 10
#define KEEPER_SHARE 16
#define KEEPER_STEP ((size_t)32 << 20) /* unmapped at once; moves time only */
/* Addresses for the file, as a multiple of the space that the disk has: space that is given back is reserved again at
 * other addresses. At most what a program under the thread sanitizer has room for. */
#define ADDRESSES_SHARE 8
#define ADDRESSES_MAX ((uint64_t)1 << 40)

enum { ABSENT, MAPPED, USED };

#define MIB 1048576.0 /* bytes */

struct array {
    char *base;
    size_t bytes; /* in the file: whole pages */
    off_t offset; /* in the file; -1: in memory */
};

struct spill {
    struct spill_file file; /* first: see spill_use */
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
    struct array *array;         /* [count] */
    _Atomic uint8_t *state;      /* [file.bytes / CHUNK] ABSENT ...; owned */
    _Atomic size_t chunks, most; /* that are not ABSENT, and how many may be */
    size_t hand;                 /* chunk at which the next search begins */
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

/* After what is in memory has changed. */
static void set_most(struct spill *s) {
    uint64_t budget = s->limits.memory_bytes, least = budget / MIN_SHARE;
    budget = budget > s->memory + least ? budget - s->memory : least;
    s->most = budget / CHUNK > MIN_CHUNKS ? budget / CHUNK : MIN_CHUNKS;
}

struct spill *spill_new(const char *dir, const struct spill_limits *limits) {
    struct spill *s = mem_calloc(1, sizeof *s);
    s->dir = mem_strdup(dir);
    s->limits = *limits;
    s->page = (size_t)sysconf(_SC_PAGESIZE);
    s->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    s->base_rss = file_rss(s);
    s->fd = -1;
    set_most(s);
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
    if (s->file.bytes > 0)
        munmap(s->file.base, s->file.bytes);
    if (s->fd >= 0)
        close(s->fd);
    if (s->statm >= 0)
        close(s->statm);
    mem_free((void *)s->state);
    pthread_mutex_destroy(&s->mutex);
    mem_free(s->array);
    mem_free(s->dir);
    mem_free(s);
}

/* --- the budget ----------------------------------------------------------------------------------- */

/* Unmaps chunks [first, end), which are ABSENT, and has the disk write what is changed of them: pages that are clean by
 * the time memory is short can be dropped without waiting. */
static void unmap(struct spill *s, size_t first, size_t end) {
    madvise(s->file.base + first * CHUNK, (end - first) * CHUNK, MADV_DONTNEED);
    (void)sync_file_range(s->fd, (off_t)(first * CHUNK), (off_t)((end - first) * CHUNK), SYNC_FILE_RANGE_WRITE);
}

/* Moves the hand over one chunk; whether that is ABSENT by it. */
static bool pass(struct spill *s, size_t chunk) {
    uint8_t used = USED, mapped = MAPPED;
    if (atomic_load_explicit(&s->state[chunk], memory_order_relaxed) == ABSENT ||
        atomic_compare_exchange_strong(&s->state[chunk], &used, MAPPED) ||
        !atomic_compare_exchange_strong(&s->state[chunk], &mapped, ABSENT))
        return false;
    s->chunks--;
    return true;
}

/* Until `goal` chunks are left. Two turns leave none; a third is for those used meanwhile. */
static void free_chunks(struct spill *s, size_t goal) {
    size_t all = (s->used + CHUNK - 1) / CHUNK;
    for (size_t passed = 0; s->chunks > goal && passed < 3 * all;) {
        size_t first = s->hand < all ? s->hand : 0, end = first;
        while (end < all && s->chunks > goal && pass(s, end))
            end++;
        if (end > first)
            unmap(s, first, end);
        s->hand = end + 1; /* that one was not unmapped */
        passed += end + 1 - first;
    }
}

/* Starts to read a chunk that becomes used, in one piece; the next one as well where the one before is there: readers
 * of rows come to it. */
static void read_ahead(const struct spill *s, size_t chunk) {
    size_t count = chunk > 0 && atomic_load_explicit(&s->state[chunk - 1], memory_order_relaxed) != ABSENT ? 2 : 1;
    madvise(s->file.base + chunk * CHUNK, count * CHUNK, MADV_WILLNEED); /* no more than advice: it may fail */
}

void spill_use_file(struct spill *s, const void *at, size_t bytes) {
    size_t first = (size_t)((const char *)at - s->file.base) / CHUNK;
    size_t last = ((size_t)((const char *)at - s->file.base) + (bytes > 0 ? bytes - 1 : 0)) / CHUNK;
    for (size_t i = first; i <= last; i++) {
        if (atomic_load_explicit(&s->state[i], memory_order_relaxed) == USED ||
            atomic_exchange(&s->state[i], USED) != ABSENT)
            continue;
        read_ahead(s, i);
        if (++s->chunks <= s->most)
            continue;
        pthread_mutex_lock(&s->mutex);
        if (s->chunks > s->most)
            free_chunks(s, s->most - s->most / FREED_SHARE);
        pthread_mutex_unlock(&s->mutex);
    }
}

/* Unmaps all, counted or not, while the kernel counts more than the budget and a part. */
static void trim(struct spill *s) {
    uint64_t most = s->base_rss + s->most * CHUNK;
    if (file_rss(s) <= most + most / KEEPER_SHARE)
        return;
    for (size_t first = 0, step = KEEPER_STEP / CHUNK; first * CHUNK < s->used && file_rss(s) > most; first += step) {
        size_t all = (s->used + CHUNK - 1) / CHUNK, end = first + step < all ? first + step : all;
        for (size_t i = first; i < end; i++)
            s->chunks -= atomic_exchange(&s->state[i], ABSENT) != ABSENT;
        unmap(s, first, end);
    }
}

static void *keep(void *argument) {
    struct spill *s = argument;
    struct timespec next;
    pthread_mutex_lock(&s->mutex);
    while (!s->stopping) {
        clock_gettime(CLOCK_MONOTONIC, &next);
        next.tv_nsec += KEEPER_INTERVAL_MS * 1000000L;
        next.tv_sec += next.tv_nsec / 1000000000L;
        next.tv_nsec %= 1000000000L;
        pthread_cond_timedwait(&s->stop, &s->mutex, &next);
        trim(s);
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

/* Addresses for all that the file may ever be. */
static enum status take_addresses(struct spill *s, struct error *err) {
    uint64_t room;
    enum status status = s->file.bytes > 0 ? STATUS_OK : file_free_bytes(s->dir, &room, err);
    if (status != STATUS_OK || s->file.bytes > 0)
        return status;
    size_t bytes = (size_t)(room < ADDRESSES_MAX / ADDRESSES_SHARE ? ADDRESSES_SHARE * room : ADDRESSES_MAX);
    bytes = (bytes / CHUNK + 1) * CHUNK;
    char *base = mmap(NULL, bytes + CHUNK, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (base == MAP_FAILED)
        return error_set_errno(err, errno, "cannot find %.0f GiB of addresses for pixels", (double)bytes / MIB / 1024);
    size_t before = (CHUNK - (uintptr_t)base % CHUNK) % CHUNK;
    if (before > 0)
        munmap(base, before);
    munmap(base + before + bytes, CHUNK - before);
    s->state = mem_calloc(bytes / CHUNK, sizeof *s->state);
    s->file.base = base + before;
    atomic_store_explicit(&s->file.bytes, bytes, memory_order_release); /* readers may be at work already */
    return STATUS_OK;
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

static size_t whole_pages(const struct spill *s, size_t bytes) { return (bytes + s->page - 1) / s->page * s->page; }

static enum status grow_file(struct spill *s, const char *what, uint64_t more, struct error *err) {
    enum status status = open_file(s, err);
    if (status == STATUS_OK)
        status = check_room(s, what, more, err);
    if (status == STATUS_OK)
        status = take_addresses(s, err);
    if (status == STATUS_OK && more > s->file.bytes - s->reserved)
        status = error_set(err, STATUS_NO_SPACE, "%s: the addresses for pixels on the disk are used up", what);
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
    if (mmap(s->file.base + s->reserved, more, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, s->fd,
             (off_t)s->reserved) == MAP_FAILED)
        mem_exhausted("the mapping of pixels");
    /* We say what is read (read_ahead). The kernel reads up to its read_ahead_kb, of some machines 8 MiB, around each
     * fault, of which a look-up in a photograph wants some rows. */
    madvise(s->file.base + s->reserved, more, MADV_RANDOM);
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
        status = grow_file(s, what, whole_pages(s, bytes) + count * s->page, err ? err : &own);
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
    size_t whole = whole_pages(s, bytes);
    if (whole > s->reserved - s->used)
        return NULL;
    struct array a = {.base = s->file.base + s->used, .bytes = whole, .offset = (off_t)s->used};
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
        set_most(s);
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
        set_most(s);
        return;
    }
    /* The addresses stay ours: the hand passes over them. */
    if (mmap(a->base, a->bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED, -1, 0) ==
        MAP_FAILED)
        mem_exhausted("the mapping of pixels");
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
