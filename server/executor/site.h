/* site.h -- executors.d/NAME.conf: how a site's scheduler is talked to.
 *
 *      # a comment (only at the beginning of a line)
 *      key = value
 *          which goes on in lines that begin with a blank
 *      [script]
 *      all lines that follow, up to the end of the file: what `submit` gets on its standard input
 *
 * Commands are lists of words (template.h), never given to a shell. The site knows an attempt by its {name}, which is
 * drawn at random and never used twice: an id that a command invents, repeats or loses does no harm. */
#ifndef UNBAKE_EXECUTOR_SITE_H
#define UNBAKE_EXECUTOR_SITE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"
#include "server/executor/template.h"

/* What a state of the site's means. */
enum site_state {
    SITE_UNKNOWN,  /* a word that the file does not list */
    SITE_WAITING,  /* it has not begun */
    SITE_RUNNING,  /* it runs, or begins, or is about to end */
    SITE_ENDED,    /* it runs no more, for whatever reason */
    SITE_MEMORY,   /* the site has ended it, since it took too much memory */
    SITE_PREEMPTED /* the site has ended it for reasons of its own: for others, for the time, for a broken node */
};

/* Bytes of all ids, with commas, as one word of a command line: Linux takes 131,072 for a word. */
#define SITE_IDS_BYTES 100000

struct site {
    char name[32];                             /* of the file without ".conf": lower-case letters, digits, - */
    char user[64];                             /* under which this process calls the site's commands */
    char *where;                               /* the file; all texts are owned */
    char **submit, **status, **cancel, **info; /* words; info may be NULL */
    char *submit_id;                           /* pattern of the line of submit's output that has the id; "": none */
    char *status_line;                         /* pattern of the lines of status' output */
    char *states[SITE_PREEMPTED + 1];          /* words, separated by blanks */
    char *url, *ca, *node, *cache, *partition, *shared, *script;
    double max_running, threads, memory_mib, memory_percent, time_min, status_sec, deadline_sec, lease_sec;
};

/* Reads the file. Each fault appends a line to *problems. The status is about the file itself; *site needs site_release
 * in any case. */
enum status site_read(struct site *site, const char *name, const char *path, struct buf *problems, struct error *err);
void site_release(struct site *site);

/* Whether it may be the name of an executor. */
bool site_name_is_good(const char *name);

enum site_state site_state_of(const struct site *site, const char *word);

/* What the placeholders stand for in one attempt. */
struct site_job {
    const char *name;    /* the site's name of it */
    const char *id;      /* the site's; "" where it is not known */
    const char *ids;     /* of all, with commas */
    const char *token;   /* the secret; only for the script */
    const char *command; /* what the script runs; NULL: `NODE node URL ...` */
    int64_t job_id;
    int attempt;
    double memory_bytes; /* 0: not foretold */
};
/* MiB that are asked for. */
long site_memory_mib(const struct site *site, double memory_bytes);
/* A command with its placeholders in place; the caller's (words_free). */
char **site_words(const struct site *site, char *const *words, const struct site_job *job);
char *site_script(const struct site *site, const struct site_job *job); /* the caller's (mem_free) */

#endif
