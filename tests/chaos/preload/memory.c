/* memory.c -- preloaded into the daemon, and so into its workers: their n-th allocation finds no memory;
 * see faults.h. Over glibc's own allocator, by the names that it keeps for such libraries. */
#include <malloc.h>
#include <stdlib.h>

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

static bool fails(void) {
    if (!faults_strikes(faults, role))
        return false;
    errno = ENOMEM;
    return true;
}

void *malloc(size_t bytes) {
    return fails() ? NULL : __libc_malloc(bytes);
}

void *calloc(size_t count, size_t size) {
    return fails() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t bytes) {
    return fails() ? NULL : __libc_realloc(old, bytes);
}

void *reallocarray(void *old, size_t count, size_t size) {
    size_t bytes;
    return __builtin_mul_overflow(count, size, &bytes) ? NULL : realloc(old, bytes);
}

void *memalign(size_t alignment, size_t bytes) {
    return fails() ? NULL : __libc_memalign(alignment, bytes);
}

void *aligned_alloc(size_t alignment, size_t bytes) {
    return memalign(alignment, bytes);
}

int posix_memalign(void **out, size_t alignment, size_t bytes) {
    void *made = memalign(alignment, bytes);
    if (!made && bytes)
        return ENOMEM;
    *out = made;
    return 0;
}
