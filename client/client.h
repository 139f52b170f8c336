/* client.h -- what every command gets, and how it reports and exits. */
#ifndef UNBAKE_CLIENT_CLIENT_H
#define UNBAKE_CLIENT_CLIENT_H

#include <stdbool.h>
#include <stdint.h>

#include "client/format.h"
#include "client/terminal.h"
#include "common/error.h"
#include "common/json.h"
#include "common/options.h"
#include "common/request.h"

/* Exit statuses: part of the interface, listed in the help and in README.md. */
enum client_exit {
    CLIENT_OK = 0,
    CLIENT_JOB_FAILED = 1,    /* the job that was watched failed or was cancelled */
    CLIENT_USAGE = 2,         /* the command line is at fault */
    CLIENT_NOT_FOUND = 3,     /* no such job, scene or output */
    CLIENT_REFUSED = 4,       /* the server refused and said why */
    CLIENT_UNREACHABLE = 5,   /* no answer from the server, after several tries */
    CLIENT_CONFLICT = 6,      /* the current state of the job or scene forbids it */
    CLIENT_LOCAL = 7,         /* a file here cannot be read or written */
    CLIENT_JOB_CANCELLED = 8, /* `wait`: no job failed, but one was cancelled */
    CLIENT_TIME_OVER = 9,     /* `wait`: the time was over before the jobs were */
    CLIENT_INTERRUPTED = 130  /* Ctrl-C; a submitted job goes on */
};

#define CLIENT_RETRY_SEC 3.0 /* how long an unreachable server is tried, unless --retry says otherwise */

struct client {
    struct http_request *request;
    struct terminal out; /* stdout: results */
    struct terminal err; /* stderr: progress of transfers, messages */
    enum client_format format;
    bool json; /* format is not FORMAT_TEXT */
    bool quiet;
    double retry_sec; /* --retry; negative: each command's own default */
};

struct command {
    const char *name;
    const char *arguments; /* "JOB [NAME...]"; "" if it takes none */
    const char *summary;   /* one line */
    const char *details;   /* for --help; "" if the summary says all */
    const char *examples;  /* lines, each ending in a newline */
    size_t words_min, words_max;
    const struct command_option *options; /* ends with a NULL name */
    int (*run)(struct client *c, const struct options *o);
};

/* In the order of the help; *count entries. */
const struct command *command_table(size_t *count);
/* The options that every command takes. */
extern const struct command_option command_shared_options[];
const struct command *command_find(const char *name);
/* Whether it asks no server: c->request is NULL then. */
bool command_is_local(const struct command *command);
/* Exit statuses for the help; ends with a NULL meaning. */
extern const struct command_exit {
    int status;
    const char *meaning;
} command_exit_statuses[];
const char *command_option_help(const struct command_option *option);
extern const char *const command_job_states[], *const command_job_kinds[]; /* end with NULL */
/* Writes the help of the program (command NULL) or of one command. */
void command_help(const struct command *command, FILE *out);

/* Reports an error on stderr (one JSON object with --json), with hint and invalid parameters; returns the exit
 * status. reply may be NULL. */
int client_fail(struct client *c, const struct reply *reply, const struct error *err);
/* Prints "unbake: " and a sentence to stderr unless --quiet or --json. */
void client_note(struct client *c, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Prints a sentence to stdout, with control characters removed: it contains text of the server's. */
void client_say(struct client *c, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Prints "name       value" to stdout, with control characters removed; nothing if the value is "". */
void field_print(struct client *c, const char *name, const char *value);

/* A line of JSON to stdout; of an array with FORMAT_JSONL a line an item. */
void client_print_json(struct client *c, const cJSON *value);

/* The job's number from a word: the number itself, or `last` for the newest job. */
enum status client_job_id(struct client *c, const char *word, int64_t *id, struct reply *reply, struct error *err);
/* GET /v1/jobs/ID. */
enum status client_job_get(struct client *c, int64_t id, struct reply *reply, struct error *err);
/* Collects `items` over all pages of a list ("/v1/jobs?state=failed"), at most `limit` (0: all). */
enum status client_list(struct client *c, const char *path, size_t limit, cJSON **items, struct reply *reply,
                        struct error *err);

/* Members of a reply; "" or `fallback` where absent, null or of another type. */
const char *member_text(const cJSON *object, const char *key);
double member_number(const cJSON *object, const char *key, double fallback);
int64_t member_whole(const cJSON *object, const char *key, int64_t fallback); /* exact beyond 2^53 too */
const cJSON *member_items(const cJSON *object, const char *key);              /* an array or NULL */
const char *member_name(const cJSON *member);                                 /* "" for an item of an array */

/* Unix time of an RFC 3339 time in UTC ("2024-05-06T07:08:09.123Z"); NaN for anything else. */
double time_parse(const char *text);
/* Seconds from then to now, at least 0; NaN where time_parse returns NaN. */
double time_since(const char *text);

#endif
