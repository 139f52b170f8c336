/* command.h -- one command of a site: a child process with a deadline, whose output is heard. */
#ifndef UNBAKE_EXECUTOR_COMMAND_H
#define UNBAKE_EXECUTOR_COMMAND_H

#include <stdatomic.h>

#include "common/buf.h"
#include "common/error.h"

#define COMMAND_OUTPUT_MAX ((size_t)16 << 20) /* bytes; ten thousand jobs are about 1 MiB */

/* Runs argv (its first word is looked for in PATH) with `input` ("" if NULL) on its standard input, and waits, but not
 * longer than deadline_sec, nor after *stop (NULL: never) is set: then it is killed with all that it has started,
 * STATUS_UNAVAILABLE. STATUS_OK: it has ended with status 0, and `output` (initialised by the caller) has what it
 * wrote. Otherwise the message says what it was and the last line that it wrote to its standard error. Thread-safe. */
enum status command_run(char *const argv[], const char *input, double deadline_sec, const atomic_bool *stop,
                        struct buf *output, struct error *err);

#endif
