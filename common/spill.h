/* spill.h -- large arrays that lie in memory while they fit a budget, and beyond it in a file that is mapped.
 *
 * The pixels of a room's photographs may take more memory than the machine has. Readers see plain memory in both cases.
 * The decision is made when space is reserved, for the whole reservation: what fits is not slower by anything.
 *
 * The file has no name (it is removed as soon as it is open), so nothing is left of it when the process ends, however
 * it ends. Its blocks are allocated when space is reserved: a full disk is an error there, never a signal at a later
 * store. Pages of it count as this process's memory while they are mapped. Readers tell what they are about to look at
 * (spill_use); what is beyond the budget is then unmapped, least recently used first. Contents never depend on that:
 * who does not tell reads the same. The kernel keeps unmapped pages as its cache while memory is free and drops them
 * when it is not.
 *
 * A disk that fails at reading ends the process (SIGBUS), as failing memory does. */
#ifndef UNBAKE_COMMON_SPILL_H
#define UNBAKE_COMMON_SPILL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct spill; /* opaque; all functions are thread-safe */

struct spill_limits {
    uint64_t memory_bytes;    /* budget of arrays in memory and mapped pages of the file */
    uint64_t keep_free_bytes; /* space of the disk that the file leaves to others */
    uint64_t file_bytes;      /* of the file, at most; 0: no limit of its own */
};

/* Makes no file yet; `dir` (copied) is the folder for it. */
struct spill *spill_new(const char *dir, const struct spill_limits *limits);
void spill_free(struct spill *s); /* after all arrays were given back; NULL is fine */

/* Makes sure that `count` arrays of together `bytes` bytes can be taken. They go to the file if these, all that is in
 * memory and `later` bytes, which are known to follow, are beyond the budget. STATUS_NO_SPACE, with a hint, where the
 * file would be too large. `what` is for the message: "the photographs". NULL: all goes to memory. */
enum status spill_reserve(struct spill *s, const char *what, size_t count, uint64_t bytes, uint64_t later,
                          struct error *err);

/* An array with undefined contents, of what is reserved; of memory where nothing is, or where s is NULL. */
void *spill_take(struct spill *s, size_t count, size_t size);
/* Of an array from spill_take of the same s, or from mem.h; NULL is fine. */
void spill_give(struct spill *s, void *array);

/* The addresses of the file, the first member of struct spill. 0 bytes while there is none: only then base is not
 * set. */
struct spill_file {
    _Atomic size_t bytes;
    char *base;
};

void spill_use_file(struct spill *s, const void *at, size_t bytes);

/* Whether any array may be in the file. */
static inline bool spill_has_file(const struct spill *s) {
    const struct spill_file *file = (const struct spill_file *)(const void *)s;
    return s && atomic_load_explicit(&file->bytes, memory_order_acquire) > 0;
}

/* Tells that `bytes` bytes at `at`, of one array, are looked at or written next. Costs a comparison where the array is
 * in memory; s may be NULL. */
static inline void spill_use(struct spill *s, const void *at, size_t bytes) {
    const struct spill_file *file = (const struct spill_file *)(const void *)s;
    if (spill_has_file(s) && (uintptr_t)at - (uintptr_t)file->base < file->bytes)
        spill_use_file(s, at, bytes);
}

uint64_t spill_memory_bytes(const struct spill *s); /* the budget */
uint64_t spill_file_bytes(struct spill *s);         /* space of the disk that the file takes; of NULL 0 */

#endif
