/* mem.c -- see mem.h. */
#include "common/mem.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define LARGE_ALIGNMENT ((size_t)2 << 20) /* the size of a huge page on x86-64 and aarch64 */

static void *check(void *pointer, size_t bytes) {
    if (!pointer && bytes) {
        fprintf(stderr, "out of memory: could not allocate %zu bytes\n", bytes);
        _Exit(MEM_EXIT_STATUS);
    }
    return pointer;
}

void mem_exhausted(const char *who) {
    fprintf(stderr, "out of memory: %s could not go on\n", who);
    _Exit(MEM_EXIT_STATUS);
}

bool mem_overflows(size_t count, size_t size) { return size != 0 && count > SIZE_MAX / size; }

static size_t product(size_t count, size_t size) {
    if (mem_overflows(count, size)) {
        fprintf(stderr, "out of memory: %zu x %zu bytes overflow\n", count, size);
        _Exit(MEM_EXIT_STATUS);
    }
    return count * size;
}

void *mem_alloc(size_t bytes) { return check(malloc(bytes), bytes); }

void *mem_calloc(size_t count, size_t size) { return check(calloc(count, size), product(count, size)); }

void *mem_array(size_t count, size_t size) { return mem_alloc(product(count, size)); }

void *mem_realloc_array(void *old, size_t count, size_t size) {
    size_t bytes = product(count, size);
    return check(realloc(old, bytes ? bytes : 1), bytes);
}

void *mem_calloc_large(size_t count, size_t size) {
    size_t bytes = product(count, size);
    if (bytes < LARGE_ALIGNMENT) {
        size_t rounded = (bytes + 63) & ~(size_t)63;
        void *small = check(aligned_alloc(64, rounded ? rounded : 64), rounded);
        memset(small, 0, rounded);
        return small;
    }
    if (bytes > SIZE_MAX - LARGE_ALIGNMENT)
        product(bytes, 2);
    size_t rounded = (bytes + LARGE_ALIGNMENT - 1) & ~(LARGE_ALIGNMENT - 1);
    void *large = check(aligned_alloc(LARGE_ALIGNMENT, rounded), rounded);
    madvise(large, rounded, MADV_HUGEPAGE); /* advice: a kernel without it is only slower */
    memset(large, 0, rounded);
    return large;
}

char *mem_strndup(const char *text, size_t length) {
    length = strnlen(text, length); /* as strndup: a shorter text ends it */
    char *copy = mem_alloc(length + 1);
    memcpy(copy, text, length);
    copy[length] = '\0';
    return copy;
}

char *mem_strdup(const char *text) { return mem_strndup(text, strlen(text)); }

char *mem_printf(const char *format, ...) {
    va_list args;
    va_start(args, format);
    int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    char *text = mem_alloc((size_t)(length < 0 ? 0 : length) + 1);
    text[0] = '\0';
    va_start(args, format);
    vsnprintf(text, (size_t)(length < 0 ? 0 : length) + 1, format, args);
    va_end(args);
    return text;
}

void mem_free(void *pointer) { free(pointer); }
