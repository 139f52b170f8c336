/* worker_log.h -- the file to which workers' output is appended: kept short, and its end quoted. */
#ifndef UNBAKE_JOB_WORKER_LOG_H
#define UNBAKE_JOB_WORKER_LOG_H

#include <sys/types.h>

#include "common/error.h"

/* Opens the log for appending, cut to its tail once it is large; *fd is the caller's, close-on-exec. `start` is where
 * what is appended from now on begins. */
enum status worker_log_open(const char *path, int *fd, off_t *start, struct error *err);

/* Appends what the file `from` has, at most `limit` bytes of it, and removes that file. Nothing is done where it is not
 * there. */
enum status worker_log_take(const char *path, const char *from, size_t limit, struct error *err);

/* The end of what was appended since `start`, at most `limit` bytes, from a whole line on if possible, joined into one
 * line of ASCII; the caller's (mem_free), "" if none. */
char *worker_log_tail(const char *path, off_t start, size_t limit);

#endif
