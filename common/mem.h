/* mem.h -- allocation that cannot fail: out of memory ends the process with a message.
 *
 * Sizes that come from input must be capped by the reader first; the array forms check the
 * product for overflow. Free everything here with mem_free (plain free works too). */
#ifndef UNBAKE_COMMON_MEM_H
#define UNBAKE_COMMON_MEM_H

#include <stdbool.h>
#include <stddef.h>

/* Exit status of a process that ran out of memory (the daemon tells it from a crash). */
#define MEM_EXIT_STATUS 71

void *mem_alloc(size_t bytes);               /* contents undefined */
void *mem_calloc(size_t count, size_t size); /* zeroed */
void *mem_array(size_t count, size_t size);  /* contents undefined, overflow checked */
void *mem_realloc_array(void *old, size_t count, size_t size);
/* As mem_calloc, aligned to 64 bytes and backed by transparent huge pages where the kernel
 * offers them: for arrays of many megabytes that are read at random. */
void *mem_calloc_large(size_t count, size_t size);
char *mem_strdup(const char *text);
char *mem_strndup(const char *text, size_t length); /* at most `length` bytes of text */
/* A formatted string of its own; never NULL. */
char *mem_printf(const char *format, ...) __attribute__((format(printf, 1, 2)));
void mem_free(void *pointer);

/* Ends the process likewise, for a library that reported out of memory. */
void mem_exhausted(const char *who) __attribute__((noreturn));

/* True when count * size does not fit size_t. */
bool mem_overflows(size_t count, size_t size);

#endif
