/* config.h -- the daemon's configuration: one table of options, from which files and command
 * lines are read, --help is printed and config/unbaked.conf is checked by a test.
 *
 * A file holds lines "name = value"; # begins a comment. All problems are found at once. */
#ifndef UNBAKE_SERVER_CONFIG_H
#define UNBAKE_SERVER_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"

enum option_type { CONFIG_TEXT, CONFIG_INT, CONFIG_REAL, CONFIG_BOOL };

struct config_option {
    const char *name;
    enum option_type type;
    const char *unit;        /* "s", "MiB", ...; "" where there is none */
    double minimum, maximum; /* inclusive, for numbers */
    const char *default_text;
    const char *help; /* one sentence or two */
    size_t offset;    /* of the member in struct config */
};

#define CONFIG_OPTIONS_MAX 128 /* rows of the table, at most */

struct config {
    char *where[CONFIG_OPTIONS_MAX]; /* by the table: where it was set, "unbaked.conf:12"; owned; NULL: default */
    char *listen, *access, *tls_certificate, *tls_key, *server_names; /* owned */
    char *trusted_proxies, *proxy_field;                              /* owned */
    char *executors, *executors_dir;                                  /* owned */
    char *data_dir, *log_level, *log_format;                          /* owned */
    int64_t max_running, max_checks, threads, max_attempts, queue_limit, worker_memory_mib, jobs_memory_mib;
    int64_t small_renders, small_render_threads, small_render_paths, render_part_paths;
    int64_t photograph_memory_mib;
    int64_t user_max_running, user_queue_limit, user_max_jobs, user_max_mib, user_max_percent;
    int64_t user_max_streams, user_max_uploads, user_max_checks, user_pledge_percent, admin_free_mib;
    int64_t max_upload_mib, min_free_mib, low_disk_mib;
    int64_t max_connections, address_max_connections, max_streams, body_min_bytes_per_sec;
    int64_t events_per_job;
    double event_keep_hours;
    double checkpoint_interval_sec, checkpoint_keep_hours, stop_grace_sec;
    double upload_start_minutes, upload_keep_hours, job_keep_days, scene_keep_days, collect_interval_sec;
    double head_timeout_sec, idle_timeout_sec, keepalive_sec;
    bool webhook_private;
    bool sandbox;
};

const struct config_option *config_table(size_t *count); /* in the order of config/unbaked.conf */

void config_init(struct config *c); /* all defaults */
void config_release(struct config *c);

/* Sets one option from text. `where` begins a message about it ("unbaked.conf:12"). A fault
 * appends one line to *problems and leaves the option as it was. */
void config_set(struct config *c, const char *name, const char *value, const char *where, struct buf *problems);
/* Reads a file; faults append a line each. The status is about the file itself. */
enum status config_read(struct config *c, const char *path, struct buf *problems, struct error *err);
/* What concerns several options, or needs more than a range. Appends a line a fault, which begins with where
 * the option was set. */
void config_check(const struct config *c, struct buf *problems);

#define CONFIG_ADDRESS_SIZE 64 /* bytes of the address without its port, with the NUL */
/* Takes `listen` apart: "127.0.0.1:7117", "[::1]:0", "localhost:7117", "0.0.0.0:443". STATUS_INPUT
 * when it is no such thing. */
enum status config_address(const char *listen, char address[CONFIG_ADDRESS_SIZE], uint16_t *port, bool *is_loopback,
                           struct error *err);

#endif
