/* spill.c -- see spill.h; what of the file is mapped, spill_chunks.c decides.
 *
 * Arrays in the file begin on pages of their own, one after the other; space of those given back is returned to the
 * disk but not used again. The file is mapped once, at `file.base`, so that an address tells the chunk.
 *
 *      0 ............ used ............ reserved ............ file.bytes
 *        arrays            reserved               addresses only
 */
#include "common/spill.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/spill_chunks.h"

/* Addresses for the file, as a multiple of the space that the disk has: space that is given back is reserved again at
 * other addresses. At most what a program under the thread sanitizer has room for. */
#define ADDRESSES_SHARE 8
#define ADDRESSES_MAX ((uint64_t)1 << 40)

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
    struct spill_chunks chunks;      /* has the mutex */
    uint64_t reserved, freed;        /* bytes of the file; chunks.used of them are arrays' */
    uint64_t memory, memory_claimed; /* bytes of arrays in memory; of those, and of what is reserved there */
    size_t count, capacity;
    struct array *array; /* [count] */
};

struct spill *spill_new(const char *dir, const struct spill_limits *limits) {
    struct spill *s = mem_calloc(1, sizeof *s);
    s->dir = mem_strdup(dir);
    s->limits = *limits;
    spill_chunks_init(&s->chunks);
    spill_chunks_set_budget(&s->chunks, limits->memory_bytes, 0);
    return s;
}

void spill_free(struct spill *s) {
    if (!s)
        return;
    assert(s->count == 0);
    spill_chunks_release(&s->chunks);
    if (s->file.bytes > 0)
        munmap(s->file.base, s->file.bytes);
    if (s->chunks.fd >= 0)
        close(s->chunks.fd);
    mem_free(s->array);
    mem_free(s->dir);
    mem_free(s);
}

void spill_use_file(struct spill *s, const void *at, size_t bytes) {
    spill_chunks_use(&s->chunks, (size_t)((const char *)at - s->file.base), bytes);
}

/* --- the file ------------------------------------------------------------------------------------- */

static enum status open_file(struct spill *s, struct error *err) {
    if (s->chunks.fd >= 0)
        return STATUS_OK;
    char *path =
        file_join(s->dir, ".spill.tmp-XXXXXX"); /* as a file that is left over, if we are killed before unlink */
    s->chunks.fd = mkostemp(path, O_CLOEXEC);
    enum status status =
        s->chunks.fd < 0 ? error_set_errno(err, errno, "cannot make a file for pixels in %s", s->dir) : STATUS_OK;
    if (s->chunks.fd >= 0 && unlink(path) != 0) {
        status = error_set_errno(err, errno, "cannot remove the name of %s", path);
        close(s->chunks.fd);
        s->chunks.fd = -1;
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
    bytes = (bytes / SPILL_CHUNK + 1) * SPILL_CHUNK;
    char *base = mmap(NULL, bytes + SPILL_CHUNK, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (base == MAP_FAILED)
        return error_set_errno(err, errno, "cannot find %.0f GiB of addresses for pixels", (double)bytes / MIB / 1024);
    size_t before = (SPILL_CHUNK - (uintptr_t)base % SPILL_CHUNK) % SPILL_CHUNK;
    if (before > 0)
        munmap(base, before);
    munmap(base + before + bytes, SPILL_CHUNK - before);
    spill_chunks_reserve(&s->chunks, bytes);
    s->chunks.base = s->file.base = base + before;
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

static size_t whole_pages(const struct spill *s, size_t bytes) {
    return (bytes + s->chunks.page - 1) / s->chunks.page * s->chunks.page;
}

static enum status grow_file(struct spill *s, const char *what, uint64_t more, struct error *err) {
    enum status status = open_file(s, err);
    if (status == STATUS_OK)
        status = check_room(s, what, more, err);
    if (status == STATUS_OK)
        status = take_addresses(s, err);
    if (status == STATUS_OK && more > s->file.bytes - s->reserved)
        status = error_set(err, STATUS_NO_SPACE, "%s: the addresses for pixels on the disk are used up", what);
    if (status == STATUS_OK)
        status = spill_chunks_start_keeper(&s->chunks, err);
    if (status != STATUS_OK)
        return status;
    int failure;
    do
        failure = posix_fallocate(s->chunks.fd, (off_t)s->reserved, (off_t)more);
    while (failure == EINTR);
    if (failure != 0) {
        /* What was allocated of it goes back to the disk. */
        if (ftruncate(s->chunks.fd, (off_t)s->reserved) != 0)
            s->reserved = s->chunks.used; /* nothing more is taken of it */
        error_set_errno(err, failure, "%s do not fit the memory, and the disk has no %.0f MiB for them", what,
                        (double)more / MIB);
        if (failure == EFBIG) /* a limit of the system on the size of files */
            err->status = STATUS_NO_SPACE;
        return err->status;
    }
    if (mmap(s->file.base + s->reserved, more, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, s->chunks.fd,
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
    pthread_mutex_lock(&s->chunks.mutex);
    uint64_t claimed = s->memory_claimed > s->memory ? s->memory_claimed : s->memory;
    if (bytes + later <= s->limits.memory_bytes && claimed <= s->limits.memory_bytes - bytes - later)
        s->memory_claimed = claimed + bytes;
    else
        status = grow_file(s, what, whole_pages(s, bytes) + count * s->chunks.page, err ? err : &own);
    pthread_mutex_unlock(&s->chunks.mutex);
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
    if (whole > s->reserved - s->chunks.used)
        return NULL;
    struct array a = {.base = s->file.base + s->chunks.used, .bytes = whole, .offset = (off_t)s->chunks.used};
    s->chunks.used += whole;
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
    pthread_mutex_lock(&s->chunks.mutex);
    void *taken = take_of_file(s, bytes);
    if (!taken) {
        struct array a = {.base = mem_alloc(bytes), .bytes = bytes, .offset = -1};
        s->memory += bytes;
        spill_chunks_set_budget(&s->chunks, s->limits.memory_bytes, s->memory);
        note(s, &a);
        taken = a.base;
    }
    pthread_mutex_unlock(&s->chunks.mutex);
    return taken;
}

static void release(struct spill *s, const struct array *a) {
    if (a->offset < 0) {
        mem_free(a->base);
        s->memory -= a->bytes;
        s->memory_claimed -= s->memory_claimed > a->bytes ? a->bytes : s->memory_claimed;
        spill_chunks_set_budget(&s->chunks, s->limits.memory_bytes, s->memory);
        return;
    }
    /* The addresses stay ours: the hand passes over them. */
    if (mmap(a->base, a->bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED, -1, 0) ==
        MAP_FAILED)
        mem_exhausted("the mapping of pixels");
    /* Where the file system cannot do that, the space comes back when the file is closed. */
    if (fallocate(s->chunks.fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, a->offset, (off_t)a->bytes) == 0)
        s->freed += a->bytes;
}

void spill_give(struct spill *s, void *array) {
    if (!s || !array) {
        mem_free(array);
        return;
    }
    pthread_mutex_lock(&s->chunks.mutex);
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
    pthread_mutex_unlock(&s->chunks.mutex);
}

uint64_t spill_memory_bytes(const struct spill *s) { return s->limits.memory_bytes; }

uint64_t spill_file_bytes(struct spill *s) {
    if (!s)
        return 0;
    pthread_mutex_lock(&s->chunks.mutex);
    uint64_t bytes = s->reserved - s->freed;
    pthread_mutex_unlock(&s->chunks.mutex);
    return bytes;
}
