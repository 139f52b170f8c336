/* memory.c -- preloaded into the daemon, and so into its workers: their n-th allocation finds no memory;
 * see faults.h. It notes which calls led to it, and, while none is to fail, to each. Over glibc's own
 * allocator, by the names that it keeps for such libraries. */
#include <dlfcn.h>
#include <malloc.h>
#include <stdlib.h>
#include <unwind.h>

#include "tests/chaos/faults.h"

extern void *__libc_malloc(size_t bytes);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *old, size_t bytes);
extern void *__libc_memalign(size_t alignment, size_t bytes);

static struct faults *faults;
static int role;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("UNBAKE_FAULTS");
    char folder[512];
    role = faults_role(folder, sizeof folder);
    faults = path ? faults_map(path) : NULL;
}

static _Unwind_Reason_Code add_call(struct _Unwind_Context *call, void *user) {
    uint64_t *hash = user;
    uintptr_t at = (uintptr_t)_Unwind_GetIP(call);
    struct dl_find_object module;
    if (_dl_find_object((void *)at, &module) == 0)
        at -= (uintptr_t)module.dlfo_map_start; /* the same in the next process */
    *hash = (*hash ^ at) * UINT64_C(0x9e3779b97f4a7c15);
    *hash ^= *hash >> 32;
    return _URC_NO_REASON;
}

/* A hash of the calls that are under way. Allocates nothing. */
static uint64_t hash_calls(void) {
    uint64_t hash = 1;
    _Unwind_Backtrace(add_call, &hash);
    return hash;
}

static bool fails(void) {
    long n = faults_count(faults, role), at = n > 0 ? atomic_load(&faults->fail_at) : 0;
    if (n > 0 && n <= FAULTS_CALLS_MAX && (at == 0 || at == n))
        faults->calls[at == n ? 0 : n - 1] = hash_calls(); /* here alone: the place is part of it */
    if (!faults_strikes(faults, n))
        return false;
    errno = ENOMEM;
    return true;
}

void *malloc(size_t bytes) { return fails() ? NULL : __libc_malloc(bytes); }

void *calloc(size_t count, size_t size) { return fails() ? NULL : __libc_calloc(count, size); }

void *realloc(void *old, size_t bytes) { return fails() ? NULL : __libc_realloc(old, bytes); }

void *reallocarray(void *old, size_t count, size_t size) {
    size_t bytes;
    return __builtin_mul_overflow(count, size, &bytes) ? NULL : realloc(old, bytes);
}

void *memalign(size_t alignment, size_t bytes) { return fails() ? NULL : __libc_memalign(alignment, bytes); }

void *aligned_alloc(size_t alignment, size_t bytes) { return memalign(alignment, bytes); }

int posix_memalign(void **out, size_t alignment, size_t bytes) {
    void *made = memalign(alignment, bytes);
    if (!made && bytes)
        return ENOMEM;
    *out = made;
    return 0;
}
