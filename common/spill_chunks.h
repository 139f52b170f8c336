/* spill_chunks.h -- which parts of a spill's file are mapped (spill.h): private to spill.c.
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
 * too. */
#ifndef UNBAKE_COMMON_SPILL_CHUNKS_H
#define UNBAKE_COMMON_SPILL_CHUNKS_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

/* A fault maps the pages around it that are in the kernel's cache: 64 KiB at most, aligned (fault_around_bytes of
 * mm/memory.c), which is what is counted and unmapped as one. */
#define SPILL_CHUNK ((size_t)64 << 10)

struct spill_chunks {
    int fd;                     /* of the file, borrowed; -1: none yet */
    char *base;                 /* where it is mapped; borrowed */
    uint64_t used;              /* bytes of the file from its beginning on that may be mapped */
    _Atomic uint8_t *state;     /* [chunks of the file] ABSENT ...; owned */
    _Atomic size_t count, most; /* that are not ABSENT, and how many may be */
    size_t hand;                /* chunk at which the next search begins */
    size_t page;                /* bytes */
    int statm;                  /* /proc/self/statm; -1: not readable */
    uint64_t base_rss;          /* bytes of other files that were mapped at the beginning: the program, its libraries */
    pthread_mutex_t mutex;      /* around all that is not atomic, and around what the owner keeps beside this */
    bool has_keeper, stopping;
    pthread_t keeper;
    pthread_cond_t stop;
};

/* Without a file, which the owner enters later, under the mutex: fd and base, used, and room for states. */
void spill_chunks_init(struct spill_chunks *c);
void spill_chunks_release(struct spill_chunks *c); /* ends the keeper, first of all */
/* Makes room for the states of a file of at most `bytes` bytes, a multiple of SPILL_CHUNK. Once. */
void spill_chunks_reserve(struct spill_chunks *c, size_t bytes);

/* Sets how many chunks may be present, by a budget of which arrays take `memory` bytes. Under the mutex, or before
 * threads. */
void spill_chunks_set_budget(struct spill_chunks *c, uint64_t budget, uint64_t memory);

/* Bytes [offset, offset + bytes) of the file are looked at or written next. Takes the mutex where chunks must go. */
void spill_chunks_use(struct spill_chunks *c, size_t offset, size_t bytes);

/* Starts the keeper, if it does not run. Under the mutex. */
enum status spill_chunks_start_keeper(struct spill_chunks *c, struct error *err);

#endif
