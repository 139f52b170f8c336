/* config.c -- see config.h. */
#include "server/config.h"

#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/assignment.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "server/executor/sites.h"
#include "server/net/address.h"

#define FILE_MAX_BYTES ((size_t)1 << 20) /* of a configuration file */
#define DEFAULT "default"                /* where an option is from that was not set */

#define TEXT(name, value, help)                                                                                        \
    { #name, CONFIG_TEXT, "", 0, 0, value, help, offsetof(struct config, name) }
#define INT(name, unit, low, high, value, help)                                                                        \
    { #name, CONFIG_INT, unit, low, high, value, help, offsetof(struct config, name) }
#define REAL(name, unit, low, high, value, help)                                                                       \
    { #name, CONFIG_REAL, unit, low, high, value, help, offsetof(struct config, name) }
#define BOOL(name, value, help)                                                                                        \
    { #name, CONFIG_BOOL, "", 0, 1, value, help, offsetof(struct config, name) }

static const struct config_option table[] = {
    TEXT(data_dir, "/var/lib/unbaked",
         "Folder of everything that the daemon keeps. One daemon a folder; a local disk."),
    TEXT(listen, "127.0.0.1:7117", "Address and port for HTTP. Port 0 takes a free one."),
    TEXT(access, "auto",
         "Who may use the daemon: auto (anybody on loopback until there is a token), tokens, or open (loopback only)."),
    TEXT(tls_certificate, "", "PEM file of the certificate chain for HTTPS. Empty: plain HTTP."),
    TEXT(tls_key, "", "PEM file of the certificate's key. SIGHUP reads both files again."),
    TEXT(server_names, "", "Host names besides localhost that the daemon answers for, as a proxy passes them on."),
    TEXT(trusted_proxies, "",
         "Addresses or networks of proxies in front, 10.0.0.0/8: their word on where a request comes from counts."),
    TEXT(proxy_field, "X-Forwarded-For", "The field in which they say so: X-Forwarded-For or Forwarded."),
    TEXT(log_level, "info", "error, warning, info or debug; the log goes to stderr."),
    TEXT(log_format, "text", "text, logfmt or json: how a line of the log is written."),
    TEXT(
        executors, "process",
        "Where jobs run, the first that has a place first: process (this machine), and names of files in executors_dir."),
    TEXT(executors_dir, "/etc/unbaked/executors.d",
         "Folder of NAME.conf, by which a cluster's scheduler is talked to."),
    INT(max_running, "jobs", 1, 64, "1", "Jobs that run at the same time on this machine."),
    INT(max_checks, "scenes", 1, 64, "2",
        "Scenes that are checked at the same time; of one user one fewer, where there are several."),
    INT(small_renders, "renders", 0, 64, "1",
        "Small renders that run at the same time, besides max_running jobs. 0: they wait with the other jobs."),
    INT(small_render_threads, "threads", 0, 1024, "0", "Threads shared by the small renders. 0: one a processor."),
    INT(small_render_paths, "paths", 0, 1000000000000, "20000000",
        "Pixels times samples times pictures up to which a render is small."),
    INT(render_part_paths, "paths", 0, 1000000000000, "500000000",
        "Pixels times samples times pictures of a part of a larger render. 0: it is not split."),
    INT(threads, "threads", 0, 1024, "0", "Threads shared by the running jobs. 0: one a processor."),
    INT(max_attempts, "attempts", 1, 100, "3", "Crashes after which a job is given up."),
    INT(queue_limit, "jobs", 1, 1000000, "1000", "Jobs that may wait; more are refused with 429."),
    INT(user_max_running, "jobs", 0, 4096, "0",
        "Jobs of one user that run at the same time, or wait in a cluster; each part of a render counts. 0: no limit."),
    INT(user_queue_limit, "jobs", 0, 1000000, "100",
        "Jobs of one user that may wait; more are refused with 429. 0: no limit."),
    INT(user_max_jobs, "jobs", 0, 1000000, "0",
        "Jobs that one user may keep, with those that have ended; more are refused with 507. 0: no limit."),
    INT(user_max_mib, "MiB", 0, 1073741824, "0",
        "What one user may take of the disk: scenes, jobs, unfinished uploads; more is refused with 507. 0: no limit."),
    INT(user_max_percent, "%", 0, 100, "50",
        "The same as a share of the whole disk, as it is when the daemon starts; the smaller one counts. 0: no limit."),
    INT(worker_memory_mib, "MiB", 0, 16777216, "0", "Memory that a job may use. 0: no limit."),
    INT(jobs_memory_mib, "MiB", 0, 16777216, "0",
        "Memory for all running jobs together; one that is foretold to need more than is left waits. 0: what is free when none runs."),
    INT(photograph_memory_mib, "MiB", 0, 16777216, "0",
        "Memory for pixels of photographs in a job; what is more lies on the disk while it runs. 0: half of worker_memory_mib, or of what is free."),
    REAL(checkpoint_interval_sec, "s", 0.1, 86400, "60",
         "Time between a job's checkpoints; up to five times as long on a slow disk."),
    REAL(checkpoint_keep_hours, "h", 0, 100000, "168",
         "Time that the checkpoint of a job which succeeded is kept, so that it can be extended."),
    INT(events_per_job, "events", 100, 10000000, "20000", "Newest events of a job that are kept."),
    REAL(event_keep_hours, "h", 1, 1000000, "720",
         "Time after a job's end for which its events are kept; the last one stays."),
    REAL(stop_grace_sec, "s", 1, 3600, "30", "Time that a job has to write its checkpoint when it is stopped."),
    BOOL(webhook_private, "no", "Let webhooks call private and loopback addresses."),
    BOOL(sandbox, "yes", "Keep jobs from the network and from files that are not theirs."),
    INT(max_upload_mib, "MiB", 1, 16777216, "65536", "Largest upload; a larger one is refused with 413."),
    INT(min_free_mib, "MiB", 0, 16777216, "1024",
        "Space of the disk that uploads leave free; below it they are refused with 507."),
    INT(low_disk_mib, "MiB", 0, 16777216, "512",
        "Free space of the disk below which jobs stop at a checkpoint and wait for more. 0: never."),
    INT(admin_free_mib, "MiB", 0, 16777216, "1024",
        "Space besides min_free_mib that is kept for admins: others' uploads and jobs are refused with 507 below both."),
    INT(user_pledge_percent, "%", 0, 100, "50",
        "Share of the free space that one user's unfinished uploads may hold before they arrive; more is refused with 507. 0: all."),
    INT(user_max_uploads, "uploads", 0, 10000, "50",
        "Unfinished uploads of one user, in parts or in one request; more are refused with 429. 0: no limit."),
    INT(user_max_checks, "scenes", 0, 10000, "50",
        "Scenes of one user that wait to be checked, unfinished uploads included; more are refused with 429. 0: no limit."),
    REAL(
        upload_start_minutes, "min", 0.001, 1440, "10",
        "Time for which an upload holds space for what is still to come while nothing of it arrives; one without a byte is removed then."),
    REAL(upload_keep_hours, "h", 0.0001, 87600, "24",
         "Time after its last byte for which an unfinished upload can be resumed."),
    REAL(job_keep_days, "days", 0, 36500, "0",
         "Time after its end for which a job and its outputs are kept. 0: for ever."),
    REAL(scene_keep_days, "days", 0, 36500, "0", "Time after its last use for which a scene is kept. 0: for ever."),
    REAL(collect_interval_sec, "s", 0.1, 86400, "60", "Time between two looks for what has expired."),
    INT(max_connections, "connections", 8, 100000, "1000",
        "Open HTTP connections; a twentieth is kept for loopback, others are refused with 503."),
    INT(address_max_connections, "connections", 0, 100000, "200",
        "Open connections of one address, loopback and trusted proxies aside; more are refused with 429. 0: no limit."),
    INT(max_streams, "streams", 1, 100000, "500",
        "Open event streams, one in ten kept for admins; more are refused with 503."),
    INT(user_max_streams, "streams", 0, 100000, "50",
        "Open event streams of one user; more are refused with 429. 0: no limit."),
    REAL(head_timeout_sec, "s", 1, 600, "10", "Time for the whole head of a request to arrive."),
    REAL(idle_timeout_sec, "s", 1, 3600, "30",
         "Silence after which a connection is closed; time for a whole body that is no upload."),
    INT(body_min_bytes_per_sec, "bytes/s", 0, 1073741824, "1024",
        "A body or a reply that moves more slowly over idle_timeout_sec is cut off. 0: any speed will do."),
    REAL(keepalive_sec, "s", 1, 300, "15", "Longest silence in an event stream."),
};
#define TABLE_COUNT (sizeof table / sizeof *table)

const struct config_option *config_table(size_t *count) {
    *count = TABLE_COUNT;
    return table;
}

static void *member(struct config *c, const struct config_option *option) { return (char *)c + option->offset; }

static const struct config_option *find(const char *name) {
    for (size_t i = 0; i < TABLE_COUNT; i++)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

/* The number that is all of `text`, or NAN. */
static double read_number(const char *text) {
    char *end;
    double value = strtod(text, &end);
    return *text && *end == '\0' && isfinite(value) ? value : NAN;
}

static void set_number(struct config *c, const struct config_option *option, const char *value, const char *where,
                       struct buf *problems) {
    double number = read_number(value);
    bool is_whole = option->type == CONFIG_INT;
    if (!(number >= option->minimum && number <= option->maximum) || (is_whole && number != floor(number)))
        buf_printf(problems, "%s: %s must be a %snumber from %.15g to %.15g%s%s, not \"%s\"\n", where, option->name,
                   is_whole ? "whole " : "", option->minimum, option->maximum, *option->unit ? " " : "", option->unit,
                   value);
    else if (is_whole)
        *(int64_t *)member(c, option) = (int64_t)number;
    else
        *(double *)member(c, option) = number;
}

static void set_bool(struct config *c, const struct config_option *option, const char *value, const char *where,
                     struct buf *problems) {
    if (strcmp(value, "yes") == 0 || strcmp(value, "no") == 0)
        *(bool *)member(c, option) = value[0] == 'y';
    else
        buf_printf(problems, "%s: %s must be yes or no, not \"%s\"\n", where, option->name, value);
}

void config_set(struct config *c, const char *name, const char *value, const char *where, struct buf *problems) {
    const struct config_option *option = find(name);
    if (!option) {
        struct nearest nearest;
        nearest_init(&nearest, name);
        for (size_t i = 0; i < TABLE_COUNT; i++)
            nearest_offer(&nearest, table[i].name);
        nearest_tell(&nearest, where, "option", problems);
        return;
    }
    char **origin = &c->where[option - table];
    mem_free(*origin);
    *origin = mem_strdup(where);
    if (option->type == CONFIG_BOOL) {
        set_bool(c, option, value, where, problems);
    } else if (option->type != CONFIG_TEXT) {
        set_number(c, option, value, where, problems);
    } else {
        char **text = member(c, option);
        mem_free(*text);
        *text = mem_strdup(value);
    }
}

_Static_assert(TABLE_COUNT <= CONFIG_OPTIONS_MAX, "struct config has a place for each option's origin");

void config_init(struct config *c) {
    struct buf none;
    memset(c, 0, sizeof *c);
    buf_init(&none, 4096);
    for (size_t i = 0; i < TABLE_COUNT; i++)
        config_set(c, table[i].name, table[i].default_text, DEFAULT, &none);
    buf_release(&none); /* a test holds the defaults against their ranges */
}

void config_release(struct config *c) {
    for (size_t i = 0; i < TABLE_COUNT; i++) {
        mem_free(c->where[i]);
        if (table[i].type == CONFIG_TEXT)
            mem_free(*(char **)member(c, &table[i]));
    }
}

static void read_line(struct config *c, char *line, const char *where, bool *seen, struct buf *problems) {
    line[strcspn(line, "#")] = '\0';
    char *name, *value;
    bool is_one = assignment_split(line, &name, &value);
    if (!is_one && *name != '\0')
        buf_printf(problems, "%s: \"%.100s\" is not of the form name = value\n", where, name);
    if (!is_one)
        return;
    const struct config_option *option = find(name);
    if (option && seen[option - table])
        buf_printf(problems, "%s: %s is given twice\n", where, name);
    else
        config_set(c, name, value, where, problems);
    if (option)
        seen[option - table] = true;
}

enum status config_read(struct config *c, const char *path, struct buf *problems, struct error *err) {
    struct buf text;
    bool seen[TABLE_COUNT] = {false};
    buf_init(&text, FILE_MAX_BYTES);
    enum status status = file_read(path, &text, err);
    const char *nul = status == STATUS_OK && text.length > 0 ? memchr(text.data, '\0', text.length) : NULL;
    if (nul) {
        size_t line = 1;
        for (const char *at = text.data; at < nul; at++)
            line += *at == '\n';
        status = error_set(err, STATUS_INPUT, "%s:%zu: is not a text file: there is a NUL byte", path, line);
    }
    char *rest = status == STATUS_OK && text.length > 0 ? text.data : NULL;
    for (size_t number = 1; rest; number++) {
        char *line = strsep(&rest, "\n");
        char *where = mem_printf("%s:%zu", path, number);
        read_line(c, line, where, seen, problems);
        mem_free(where);
    }
    buf_release(&text);
    return status;
}

enum status config_address(const char *listen, char address[CONFIG_ADDRESS_SIZE], uint16_t *port, bool *is_loopback,
                           struct error *err) {
    const char *colon = strrchr(listen, ':');
    size_t length = colon ? (size_t)(colon - listen) : 0;
    const char *host = listen;
    bool is_v6 = length > 2 && host[0] == '[' && host[length - 1] == ']';
    if (is_v6) {
        host++;
        length -= 2;
    }
    double number = colon ? read_number(colon + 1) : NAN;
    bool is_good =
        length > 0 && length < CONFIG_ADDRESS_SIZE && number >= 0 && number <= 65535 && number == floor(number);
    struct in_addr v4;
    struct in6_addr v6;
    snprintf(address, CONFIG_ADDRESS_SIZE, "%.*s", is_good ? (int)length : 0, host);
    if (!is_v6 && strcmp(address, "localhost") == 0)
        snprintf(address, CONFIG_ADDRESS_SIZE, "127.0.0.1");
    if (!is_good || inet_pton(is_v6 ? AF_INET6 : AF_INET, address, is_v6 ? (void *)&v6 : &v4) != 1)
        return error_set(err, STATUS_INPUT, "listen must be like 127.0.0.1:7117 or [::1]:7117, not \"%s\"", listen);
    *port = (uint16_t)number;
    *is_loopback = is_v6 ? IN6_IS_ADDR_LOOPBACK(&v6) : ntohl(v4.s_addr) >> 24 == 127;
    return STATUS_OK;
}

/* Where an option was set. */
static const char *origin(const struct config *c, const char *name) { return c->where[find(name) - table]; }

static bool is_set(const struct config *c, const char *name) { return strcmp(origin(c, name), DEFAULT) != 0; }

static void check_word(const struct config *c, const char *name, const char *value, const char *const *words,
                       struct buf *problems) {
    for (size_t i = 0; words[i]; i++)
        if (strcmp(words[i], value) == 0)
            return;
    buf_printf(problems, "%s: %s must be", origin(c, name), name);
    for (size_t i = 0; words[i]; i++)
        buf_printf(problems, "%s %s", i == 0 ? "" : words[i + 1] ? "," : " or", words[i]);
    buf_printf(problems, ", not \"%s\"\n", value);
}

static void check_proxies(const struct config *c, struct buf *problems) {
    struct proxies proxies;
    struct error err;
    if (proxies_parse(&proxies, c->trusted_proxies, c->proxy_field, &err) != STATUS_OK)
        buf_printf(problems, "%s: %s\n", origin(c, proxies.field ? "trusted_proxies" : "proxy_field"), err.message);
}

void config_check(const struct config *c, struct buf *problems) {
    static const char *const levels[] = {"error", "warning", "info", "debug", NULL};
    static const char *const formats[] = {"text", "logfmt", "json", NULL};
    static const char *const accesses[] = {"auto", "tokens", "open", NULL};
    char address[CONFIG_ADDRESS_SIZE];
    uint16_t port;
    bool is_loopback;
    struct error err;
    struct sites sites;
    if (config_address(c->listen, address, &port, &is_loopback, &err) != STATUS_OK)
        buf_printf(problems, "%s: %s%s%s\n", origin(c, "listen"), err.message, *err.hint ? "; " : "", err.hint);
    check_word(c, "access", c->access, accesses, problems);
    check_word(c, "log_level", c->log_level, levels, problems);
    check_word(c, "log_format", c->log_format, formats, problems);
    check_proxies(c, problems);
    sites_read(&sites, c->executors, c->executors_dir, problems);
    sites_release(&sites);
    if (*c->data_dir == '\0')
        buf_printf(problems, "%s: data_dir must name a folder\n", origin(c, "data_dir"));
    if ((*c->tls_certificate != '\0') != (*c->tls_key != '\0'))
        buf_printf(problems, "%s: tls_certificate and tls_key go together: one of them is missing\n",
                   origin(c, *c->tls_key ? "tls_key" : "tls_certificate"));
    if (c->max_streams >= c->max_connections)
        buf_printf(problems, "%s: max_streams (%lld) must be less than max_connections (%lld)\n",
                   origin(c, is_set(c, "max_streams") ? "max_streams" : "max_connections"), (long long)c->max_streams,
                   (long long)c->max_connections);
}
