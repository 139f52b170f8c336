/* spill_chunks.c -- see spill_chunks.h. */
#include "common/spill_chunks.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "common/mem.h"

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

enum { ABSENT, MAPPED, USED };

/* Bytes of files that the kernel counts as this process's; 0 where it does not tell. */
static uint64_t resident_bytes(const struct spill_chunks *c) {
    char text[128];
    unsigned long long all, resident, of_files;
    ssize_t length = c->statm < 0 ? -1 : pread(c->statm, text, sizeof text - 1, 0);
    if (length <= 0)
        return 0;
    text[length] = '\0';
    return sscanf(text, "%llu %llu %llu", &all, &resident, &of_files) == 3 ? of_files * c->page : 0;
}

void spill_chunks_init(struct spill_chunks *c) {
    pthread_condattr_t monotonic;
    *c = (struct spill_chunks){.fd = -1, .page = (size_t)sysconf(_SC_PAGESIZE)};
    c->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    c->base_rss = resident_bytes(c);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_mutex_init(&c->mutex, NULL);
    pthread_cond_init(&c->stop, &monotonic);
    pthread_condattr_destroy(&monotonic);
}

void spill_chunks_release(struct spill_chunks *c) {
    pthread_mutex_lock(&c->mutex);
    c->stopping = true;
    pthread_cond_signal(&c->stop);
    pthread_mutex_unlock(&c->mutex);
    if (c->has_keeper)
        pthread_join(c->keeper, NULL);
    pthread_cond_destroy(&c->stop);
    pthread_mutex_destroy(&c->mutex);
    if (c->statm >= 0)
        close(c->statm);
    mem_free((void *)c->state);
}

void spill_chunks_reserve(struct spill_chunks *c, size_t bytes) {
    c->state = mem_calloc(bytes / SPILL_CHUNK, sizeof *c->state);
}

void spill_chunks_set_budget(struct spill_chunks *c, uint64_t budget, uint64_t memory) {
    uint64_t least = budget / MIN_SHARE, left = budget > memory + least ? budget - memory : least;
    c->most = left / SPILL_CHUNK > MIN_CHUNKS ? left / SPILL_CHUNK : MIN_CHUNKS;
}

/* Unmaps chunks [first, end), which are ABSENT, and has the disk write what is changed of them: pages that are clean by
 * the time memory is short can be dropped without waiting. */
static void unmap(struct spill_chunks *c, size_t first, size_t end) {
    madvise(c->base + first * SPILL_CHUNK, (end - first) * SPILL_CHUNK, MADV_DONTNEED);
    (void)sync_file_range(c->fd, (off_t)(first * SPILL_CHUNK), (off_t)((end - first) * SPILL_CHUNK),
                          SYNC_FILE_RANGE_WRITE);
}

/* Moves the hand over one chunk; whether that is ABSENT by it. */
static bool pass(struct spill_chunks *c, size_t chunk) {
    uint8_t used = USED, mapped = MAPPED;
    if (atomic_load_explicit(&c->state[chunk], memory_order_relaxed) == ABSENT ||
        atomic_compare_exchange_strong(&c->state[chunk], &used, MAPPED) ||
        !atomic_compare_exchange_strong(&c->state[chunk], &mapped, ABSENT))
        return false;
    c->count--;
    return true;
}

/* Until `goal` chunks are left. Two turns leave none; a third is for those used meanwhile. */
static void free_chunks(struct spill_chunks *c, size_t goal) {
    size_t all = (c->used + SPILL_CHUNK - 1) / SPILL_CHUNK;
    for (size_t passed = 0; c->count > goal && passed < 3 * all;) {
        size_t first = c->hand < all ? c->hand : 0, end = first;
        while (end < all && c->count > goal && pass(c, end))
            end++;
        if (end > first)
            unmap(c, first, end);
        c->hand = end + 1; /* that one was not unmapped */
        passed += end + 1 - first;
    }
}

/* Starts to read a chunk that becomes used, in one piece; the next one as well where the one before is there: readers
 * of rows come to it. */
static void read_ahead(const struct spill_chunks *c, size_t chunk) {
    size_t count = chunk > 0 && atomic_load_explicit(&c->state[chunk - 1], memory_order_relaxed) != ABSENT ? 2 : 1;
    madvise(c->base + chunk * SPILL_CHUNK, count * SPILL_CHUNK, MADV_WILLNEED); /* no more than advice: it may fail */
}

void spill_chunks_use(struct spill_chunks *c, size_t offset, size_t bytes) {
    size_t first = offset / SPILL_CHUNK, last = (offset + (bytes > 0 ? bytes - 1 : 0)) / SPILL_CHUNK;
    for (size_t i = first; i <= last; i++) {
        if (atomic_load_explicit(&c->state[i], memory_order_relaxed) == USED ||
            atomic_exchange(&c->state[i], USED) != ABSENT)
            continue;
        read_ahead(c, i);
        if (++c->count <= c->most)
            continue;
        pthread_mutex_lock(&c->mutex);
        if (c->count > c->most)
            free_chunks(c, c->most - c->most / FREED_SHARE);
        pthread_mutex_unlock(&c->mutex);
    }
}

/* Unmaps all, counted or not, while the kernel counts more than the budget and a part. */
static void trim(struct spill_chunks *c) {
    uint64_t most = c->base_rss + c->most * SPILL_CHUNK;
    if (resident_bytes(c) <= most + most / KEEPER_SHARE)
        return;
    for (size_t first = 0, step = KEEPER_STEP / SPILL_CHUNK; first * SPILL_CHUNK < c->used && resident_bytes(c) > most;
         first += step) {
        size_t all = (c->used + SPILL_CHUNK - 1) / SPILL_CHUNK, end = first + step < all ? first + step : all;
        for (size_t i = first; i < end; i++)
            c->count -= atomic_exchange(&c->state[i], ABSENT) != ABSENT;
        unmap(c, first, end);
    }
}

static void *keep(void *argument) {
    struct spill_chunks *c = argument;
    struct timespec next;
    pthread_mutex_lock(&c->mutex);
    while (!c->stopping) {
        clock_gettime(CLOCK_MONOTONIC, &next);
        next.tv_nsec += KEEPER_INTERVAL_MS * 1000000L;
        next.tv_sec += next.tv_nsec / 1000000000L;
        next.tv_nsec %= 1000000000L;
        pthread_cond_timedwait(&c->stop, &c->mutex, &next);
        trim(c);
    }
    pthread_mutex_unlock(&c->mutex);
    return NULL;
}

enum status spill_chunks_start_keeper(struct spill_chunks *c, struct error *err) {
    sigset_t all, old;
    if (c->has_keeper)
        return STATUS_OK;
    sigfillset(&all); /* signals are the main thread's business */
    pthread_sigmask(SIG_SETMASK, &all, &old);
    int failure = pthread_create(&c->keeper, NULL, keep, c);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    c->has_keeper = failure == 0;
    return failure == 0 ? STATUS_OK : error_set_errno(err, failure, "cannot start the thread that keeps memory small");
}
