/* reserve.h -- room that is kept for transactions which free space or stop work: a full disk must not hinder them.
 *
 *      room      (WAL and database have their space beforehand)   every transaction
 *       │  ▲
 *       ▼  └─ (the disk has room again)
 *      tight     (they cannot be extended)                        only those that free or stop
 *
 * 1. After each commit the write-ahead log is extended to CUSHION_BYTES beyond what it holds, and the database file to
 *    SPARE_PAGES beyond its last. Ordinary transactions are refused with STATUS_NO_SPACE as soon as that cannot be done, so what is
 *    kept is left to the others, which need no block that the disk does not have already.
 * 2. While it is tight, each commit is followed by a checkpoint, so that the same part of the log is used again.
 * 3. Where the file system cannot allocate beforehand, or writes elsewhere even then (copy on write), DATA/reserve is
 *    the second line: a file of nothing that is removed when such a transaction has failed, which is then tried again.
 *
 * Under the store's mutex, except store_reserve_spend and store_reserve_renew, which are thread-safe. */
#ifndef UNBAKE_STORE_RESERVE_H
#define UNBAKE_STORE_RESERVE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"

struct store;

struct reserve {
    char *dir;           /* of the data; owned */
    int wal_fd;          /* -1: not open yet */
    bool is_unsupported; /* the file system does not allocate beforehand */
    bool is_tight;
    int page_bytes;
    int64_t wal_frames;  /* that the log holds */
    int64_t wal_bytes;   /* that it has space for */
    int64_t page_count;  /* that the database file has space for */
};

/* After the database was opened. What cannot be had now is tried again after each commit. */
void reserve_open(struct store *store, const char *dir);
void reserve_close(struct store *store); /* after the database was closed */
void reserve_keep(struct store *store);  /* after a commit */
/* Before an ordinary transaction: STATUS_NO_SPACE while it is tight. */
enum status reserve_check(struct store *store, struct error *err);

/* False when DATA/reserve is gone already. */
bool store_reserve_spend(struct store *store);
/* Makes it anew where there is room for it. */
void store_reserve_renew(struct store *store);

#endif
