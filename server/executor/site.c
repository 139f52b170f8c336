/* site.c -- see site.h. */
#include "server/executor/site.h"

#include <math.h>
#include <pwd.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/assignment.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/nearest.h"

#define FILE_MAX_BYTES ((size_t)1 << 20) /* of an executor's file */
#define PLACEHOLDER_COUNT 20             /* of the table of placeholders */

enum key_type { KEY_WORDS, KEY_TEXT, KEY_NUMBER };

/* Where nothing is given, `fallback` counts; NULL: it must be. */
static const struct key {
    const char *name;
    enum key_type type;
    double minimum, maximum; /* of numbers; whole ones */
    const char *fallback;
    size_t offset;
} keys[] = {
#define WORDS(name, fallback)                                                                                          \
    { #name, KEY_WORDS, 0, 0, fallback, offsetof(struct site, name) }
#define TEXT(name, fallback)                                                                                           \
    { #name, KEY_TEXT, 0, 0, fallback, offsetof(struct site, name) }
#define STATES(name, state, fallback)                                                                                  \
    { #name, KEY_TEXT, 0, 0, fallback, offsetof(struct site, states) + (state) * sizeof(char *) }
#define NUMBER(name, low, high, fallback)                                                                              \
    { #name, KEY_NUMBER, low, high, fallback, offsetof(struct site, name) }
    WORDS(submit, NULL),
    WORDS(status, NULL),
    WORDS(cancel, NULL),
    WORDS(info, ""),
    TEXT(submit_id, ""),
    TEXT(status_line, NULL),
    STATES(waiting, SITE_WAITING, NULL),
    STATES(running, SITE_RUNNING, NULL),
    STATES(ended, SITE_ENDED, ""),
    STATES(memory, SITE_MEMORY, ""),
    STATES(preempted, SITE_PREEMPTED, ""),
    TEXT(url, NULL),                /* of the daemon, as nodes reach it */
    TEXT(ca, ""),                   /* file on the nodes: certificates to trust instead of the system's */
    TEXT(node, "unbaked"),          /* the program on the nodes */
    TEXT(cache, "/var/tmp/unbake"), /* folder of scenes on the nodes */
    TEXT(partition, ""),
    TEXT(shared, ""), /* a folder that is the same here and there; only for tests of the site */
    NUMBER(max_running, 1, 4096, "64"),
    NUMBER(threads, 1, 1024, "4"),
    NUMBER(memory_mib, 64, 16777216, "8192"), /* where nothing is foretold */
    NUMBER(memory_percent, 100, 1000, "125"), /* of what is foretold */
    NUMBER(time_min, 1, 525600, "1440"),
    NUMBER(status_sec, 1, 3600, "15"),
    NUMBER(deadline_sec, 1, 600, "60"), /* of a command */
    NUMBER(lease_sec, 1, 3600, "60"),
};
#define KEY_COUNT (sizeof keys / sizeof *keys)

static void *member(struct site *site, const struct key *key) { return (char *)site + key->offset; }

bool site_name_is_good(const char *name) {
    size_t length = strlen(name);
    return length > 0 && length < sizeof((struct site *)0)->name && strcmp(name, "process") != 0 && name[0] != '-' &&
           strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789-") == length;
}

/* --- reading ------------------------------------------------------------------------------- */

static void set_number(double *to, const struct key *key, const char *value, const char *where, struct buf *problems) {
    char *end;
    double number = strtod(value, &end);
    if (*value == '\0' || *end || !(number >= key->minimum && number <= key->maximum) || number != floor(number))
        buf_printf(problems, "%s: %s must be a whole number from %.0f to %.0f, not \"%s\"\n", where, key->name,
                   key->minimum, key->maximum, value);
    else
        *to = number;
}

static void set(struct site *site, const struct key *key, const char *value, const char *where, struct buf *problems) {
    struct error err;
    if (key->type == KEY_NUMBER) {
        set_number(member(site, key), key, value, where, problems);
    } else if (key->type == KEY_TEXT) {
        char **text = member(site, key);
        mem_free(*text);
        *text = mem_strdup(value);
    } else if (*value) {
        char ***words = member(site, key);
        words_free(*words);
        *words = NULL;
        if (words_parse(value, words, &err) != STATUS_OK)
            buf_printf(problems, "%s: %s %s\n", where, key->name, err.message);
    }
}

static void unknown_key(const char *name, const char *where, struct buf *problems) {
    struct nearest nearest;
    nearest_init(&nearest, name);
    for (size_t i = 0; i < KEY_COUNT; i++)
        nearest_offer(&nearest, keys[i].name);
    nearest_tell(&nearest, where, "key", problems);
}

/* One key with its whole value. */
static void read_entry(struct site *site, char *entry, const char *where, bool *seen, struct buf *problems) {
    char *name, *value;
    if (!assignment_split(entry, &name, &value)) {
        buf_printf(problems, "%s: \"%s\" is not of the form key = value\n", where, name);
        return;
    }
    for (size_t i = 0; i < KEY_COUNT; i++) {
        if (strcmp(keys[i].name, name) != 0)
            continue;
        if (seen[i])
            buf_printf(problems, "%s: %s is given twice\n", where, name);
        seen[i] = true;
        set(site, &keys[i], value, where, problems);
        return;
    }
    unknown_key(name, where, problems);
}

/* Reads entries up to "[script]"; *rest is what follows that line, or NULL. */
static void read_entries(struct site *site, const char *path, char **rest, bool *seen, struct buf *problems) {
    struct buf entry;
    size_t number = 0, begun = 0;
    buf_init(&entry, FILE_MAX_BYTES);
    for (bool is_last = false; !is_last;) {
        char *line = *rest ? strsep(rest, "\n") : NULL;
        number++;
        is_last = !line || strncmp(line, "[script]", 8) == 0;
        bool goes_on = !is_last && (*line == ' ' || *line == '\t') && entry.length > 0;
        if (!is_last && *line == '#')
            continue;
        if (!goes_on && entry.length > 0 && *assignment_trim(entry.data)) {
            char *where = mem_printf("%s:%zu", path, begun);
            read_entry(site, entry.data, where, seen, problems);
            mem_free(where);
        }
        if (!goes_on) {
            buf_clear(&entry);
            begun = number;
        }
        if (!is_last)
            buf_printf(&entry, "%s%s", goes_on ? " " : "", assignment_trim(line));
    }
    buf_release(&entry);
}

/* --- placeholders -------------------------------------------------------------------------- */

/* Texts that values point to. */
struct numbers {
    char job[24], attempt[16], memory[24], threads[16], minutes[16], seconds[16];
};

static size_t placeholders(const struct site *s, const struct site_job *job, struct numbers *n,
                           struct placeholder list[PLACEHOLDER_COUNT]) {
    snprintf(n->job, sizeof n->job, "%lld", (long long)job->job_id);
    snprintf(n->attempt, sizeof n->attempt, "%d", job->attempt);
    snprintf(n->memory, sizeof n->memory, "%ld", site_memory_mib(s, job->memory_bytes));
    snprintf(n->threads, sizeof n->threads, "%.0f", s->threads);
    snprintf(n->minutes, sizeof n->minutes, "%.0f", s->time_min);
    snprintf(n->seconds, sizeof n->seconds, "%.0f", 60.0 * s->time_min);
    const struct placeholder all[] = {{"name", job->name},      {"id", job->id},           {"job", n->job},
                                      {"attempt", n->attempt},  {"memory_mib", n->memory}, {"threads", n->threads},
                                      {"time_min", n->minutes}, {"time_sec", n->seconds},  {"partition", s->partition},
                                      {"url", s->url},          {"node", s->node},         {"cache", s->cache},
                                      {"shared", s->shared},    {"ids", job->ids},         {"command", job->command},
                                      {"token", job->token},    {"user", s->user}};
    _Static_assert(sizeof all / sizeof *all <= PLACEHOLDER_COUNT, "room for every placeholder");
    memcpy(list, all, sizeof all);
    return sizeof all / sizeof *all;
}

static void check(const struct site *s, const char *what, const char *text, const char *forbidden,
                  struct buf *problems) {
    struct placeholder list[PLACEHOLDER_COUNT], allowed[PLACEHOLDER_COUNT];
    struct numbers n;
    struct error err;
    const struct site_job none = {.name = "", .id = "", .ids = "", .token = "", .command = ""};
    size_t count = placeholders(s, &none, &n, list), kept = 0;
    for (size_t i = 0; i < count; i++) {
        char *word = mem_printf(" %s ", list[i].name);
        if (!strstr(forbidden, word))
            allowed[kept++] = list[i];
        mem_free(word);
    }
    if (template_check(text, allowed, kept, &err) != STATUS_OK)
        buf_printf(problems, "%s: %s %s\n", s->where, what, err.message);
}

static void check_words(const struct site *s, const char *what, char *const *words, const char *forbidden,
                        struct buf *problems) {
    for (size_t i = 0; words && words[i]; i++)
        check(s, what, words[i], forbidden, problems);
}

/* Command lines are seen by everybody who is on the machine: no secret is in them. */
static void check_templates(const struct site *s, struct buf *problems) {
    check_words(s, "submit", s->submit, " token command id ids ", problems);
    check_words(s, "status", s->status, " token command name id job attempt memory_mib ", problems);
    check_words(s, "cancel", s->cancel, " token command ids memory_mib ", problems);
    check_words(s, "info", s->info, " token command name id ids job attempt memory_mib ", problems);
    if (s->script)
        check(s, "the script", s->script, " id ids ", problems);
    if (!s->script || !strstr(s->script, "{command}") || !strstr(s->script, "{token}"))
        buf_printf(problems, "%s: the script must have the placeholders {token} and {command}\n", s->where);
}

static void check_pattern(const struct site *s, const char *what, const char *pattern, const char *part,
                          struct buf *problems) {
    struct error err;
    if (pattern && pattern_check(pattern, &err) != STATUS_OK)
        buf_printf(problems, "%s: %s %s\n", s->where, what, err.message);
    else if (pattern && *pattern && !strstr(pattern, part))
        buf_printf(problems, "%s: %s must have the placeholder %s\n", s->where, what, part);
}

/* A text that goes into scripts and command lines. */
static void check_plain(const struct site *s, const char *what, const char *text, struct buf *problems) {
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-/:@+,=%[]";
    if (text && strspn(text, plain) != strlen(text))
        buf_printf(problems, "%s: %s may only have letters, digits and ._-/:@+,=%%[]\n", s->where, what);
}

/* One that did not fit into the question would seem to be gone. */
static void check_ids(const struct site *s, struct buf *problems) {
    const int most = SITE_IDS_BYTES / (int)sizeof((struct line_parts *)0)->id;
    for (size_t i = 0; s->status && s->status[i]; i++)
        if (strstr(s->status[i], "{ids}") && s->max_running > most)
            buf_printf(problems, "%s: max_running must be %d at most where status has {ids}, not %.0f\n", s->where,
                       most, s->max_running);
}

static void check_all(const struct site *s, const bool *seen, struct buf *problems) {
    for (size_t i = 0; i < KEY_COUNT; i++)
        if (!keys[i].fallback && !seen[i])
            buf_printf(problems, "%s: %s is missing\n", s->where, keys[i].name);
    check_templates(s, problems);
    check_ids(s, problems);
    check_pattern(s, "submit_id", s->submit_id, "{id}", problems);
    check_pattern(s, "status_line", s->status_line, "{name}", problems);
    check_pattern(s, "status_line", s->status_line, "{state}", problems);
    check_plain(s, "url", s->url, problems);
    check_plain(s, "ca", s->ca, problems);
    check_plain(s, "node", s->node, problems);
    check_plain(s, "cache", s->cache, problems);
    check_plain(s, "partition", s->partition, problems);
    check_plain(s, "shared", s->shared, problems);
    if (s->url && strncmp(s->url, "http://", 7) != 0 && strncmp(s->url, "https://", 8) != 0 &&
        strncmp(s->url, "unix:/", 6) != 0)
        buf_printf(problems, "%s: url must begin with http://, https:// or unix:/, not \"%s\"\n", s->where, s->url);
    if (*s->ca && s->url && strncmp(s->url, "https://", 8) != 0)
        buf_printf(problems, "%s: ca is for a url that begins with https://\n", s->where);
}

static void find_user(char user[64]) {
    struct passwd entry, *found = NULL;
    char texts[4096];
    if (getpwuid_r(geteuid(), &entry, texts, sizeof texts, &found) == 0 && found)
        snprintf(user, 64, "%s", found->pw_name);
    else
        snprintf(user, 64, "%u", (unsigned)geteuid());
}

enum status site_read(struct site *site, const char *name, const char *path, struct buf *problems, struct error *err) {
    struct buf text;
    bool seen[KEY_COUNT] = {false};
    *site = (struct site){.where = mem_strdup(path)};
    snprintf(site->name, sizeof site->name, "%s", name);
    find_user(site->user);
    for (size_t i = 0; i < KEY_COUNT; i++)
        if (keys[i].fallback)
            set(site, &keys[i], keys[i].fallback, path, problems);
    buf_init(&text, FILE_MAX_BYTES);
    enum status status = file_read(path, &text, err);
    if (status == STATUS_OK && text.length > 0 && strlen(text.data) != text.length)
        status = error_set(err, STATUS_INPUT, "%s is not a text file: there is a NUL byte", path);
    if (status == STATUS_OK) {
        char *rest = text.length > 0 ? text.data : NULL;
        read_entries(site, path, &rest, seen, problems);
        site->script = rest ? mem_strdup(rest) : NULL;
        check_all(site, seen, problems);
    }
    buf_release(&text);
    return status;
}

void site_release(struct site *site) {
    for (size_t i = 0; i < KEY_COUNT; i++) {
        if (keys[i].type == KEY_TEXT)
            mem_free(*(char **)member(site, &keys[i]));
        else if (keys[i].type == KEY_WORDS)
            words_free(*(char ***)member(site, &keys[i]));
    }
    mem_free(site->script);
    mem_free(site->where);
    memset(site, 0, sizeof *site);
}

/* --- use ----------------------------------------------------------------------------------- */

enum site_state site_state_of(const struct site *site, const char *word) {
    size_t length = strlen(word);
    for (int i = SITE_WAITING; i <= SITE_PREEMPTED && length > 0; i++) {
        const char *at = site->states[i];
        while (*(at += strspn(at, " \t"))) {
            size_t each = strcspn(at, " \t");
            if (each == length && strncmp(at, word, length) == 0)
                return (enum site_state)i;
            at += each;
        }
    }
    return SITE_UNKNOWN;
}

long site_memory_mib(const struct site *s, double memory_bytes) {
    return (long)ceil(memory_bytes > 0.0 ? memory_bytes / 0x1p20 * s->memory_percent / 100.0 : s->memory_mib);
}

/* The command line that a script runs, of plain words; the caller's. */
static char *node_command(const struct site *s, const struct site_job *job) {
    return mem_printf("%s node %s --job %lld --attempt %d --cache %s%s%s", s->node, s->url, (long long)job->job_id,
                      job->attempt, s->cache, *s->ca ? " --ca " : "", s->ca);
}

static char *filled(const struct site *s, const char *text, const struct site_job *given) {
    struct placeholder list[PLACEHOLDER_COUNT];
    struct numbers n;
    struct buf to;
    struct site_job job = *given;
    char *command = node_command(s, given);
    job.id = job.id ? job.id : "";
    job.ids = job.ids ? job.ids : "";
    job.token = job.token ? job.token : "";
    job.command = job.command ? job.command : command;
    buf_init(&to, 2 * FILE_MAX_BYTES);
    template_fill(text, list, placeholders(s, &job, &n, list), &to);
    char *result = mem_strdup(buf_text(&to));
    buf_release(&to);
    mem_free(command);
    return result;
}

char **site_words(const struct site *site, char *const *words, const struct site_job *job) {
    size_t count = 0;
    while (words[count])
        count++;
    char **list = mem_calloc(count + 1, sizeof *list);
    for (size_t i = 0; i < count; i++)
        list[i] = filled(site, words[i], job);
    return list;
}

char *site_script(const struct site *site, const struct site_job *job) { return filled(site, site->script, job); }
