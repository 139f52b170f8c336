/* get.c -- `get`: a job's outputs become files (fetch.h). No name from the server leads out of the folder asked for. */
#include <fnmatch.h>
#include <string.h>

#include "client/commands.h"
#include "client/fetch.h"
#include "client/view.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/nearest.h"

const struct command_option get_options[] = {
    {"output", 'o', OPTION_TEXT, "DIR", "where the files go; it is made if need be (job-JOB)"},
    {0},
};

bool get_name_is_safe(const char *name) {
    if (strlen(name) > 1000 || !*name)
        return false;
    for (const char *at = name;;) {
        size_t length = strcspn(at, "/");
        if (length == 0 || length > 200 || at[0] == '.')
            return false;
        for (size_t i = 0; i < length; i++)
            if ((unsigned char)at[i] < 0x20 || at[i] == 0x7F || at[i] == '\\')
                return false;
        if (at[length] == '\0')
            return true;
        at += length + 1;
    }
}

/* Every word must match an output, before anything is fetched. */
static enum status check_words(struct fetch *f, const struct options *o) {
    for (size_t i = 1; o && i < o->word_count; i++) {
        struct nearest nearest;
        bool matched = false;
        const cJSON *item;
        nearest_init(&nearest, o->word[i]);
        cJSON_ArrayForEach(item, f->outputs) {
            const char *name = member_text(item, "name");
            matched = matched || fnmatch(o->word[i], name, 0) == 0;
            nearest_offer(&nearest, name);
        }
        if (matched)
            continue;
        long long job = (long long)f->job;
        error_set(f->err, STATUS_NOT_FOUND, "job %lld has no output %.200s", job, o->word[i]);
        return nearest.best ? error_hint(f->err, "did you mean %s?", nearest.best)
                            : error_hint(f->err, "`unbake show %lld` lists what there is", job);
    }
    return STATUS_OK;
}

static bool wanted(const struct options *o, const char *name) {
    for (size_t i = 1; o && i < o->word_count; i++)
        if (fnmatch(o->word[i], name, 0) == 0)
            return true;
    return !o || o->word_count == 1;
}

static enum status fetch_all(struct fetch *f, const struct options *o, cJSON *results) {
    enum status status = fetch_list(f);
    if (status != STATUS_OK)
        return status;
    if (cJSON_GetArraySize(f->outputs) == 0) {
        error_set(f->err, STATUS_NOT_FOUND, "job %lld has no outputs yet", (long long)f->job);
        return error_hint(f->err, "`unbake watch %lld` shows how far it is", (long long)f->job);
    }
    status = check_words(f, o);
    cJSON *first = cJSON_Duplicate(f->outputs, true); /* the list may be fetched again meanwhile */
    const cJSON *item;
    cJSON_ArrayForEach(item, first) {
        const char *name = member_text(item, "name");
        if (status != STATUS_OK)
            break;
        if (!wanted(o, name))
            continue;
        if (!get_name_is_safe(name)) {
            f->reply.code = 0;
            status = error_set(f->err, STATUS_CORRUPT, "the server lists an output with an unsafe name: %.200s", name);
            break;
        }
        f->name = mem_strdup(name);
        f->path = file_join(f->dir, name);
        f->part = mem_printf("%s.part", f->path);
        status = fetch_one(f, results);
        mem_free(f->name);
        mem_free(f->path);
        mem_free(f->part);
    }
    cJSON_Delete(first);
    return status;
}

static void print_results(struct client *c, const char *dir, const cJSON *results) {
    int count = cJSON_GetArraySize(results), present = 0;
    double bytes = 0.0;
    char size[16];
    const cJSON *result;
    if (c->json) {
        client_print_json(c, results);
        return;
    }
    cJSON_ArrayForEach(result, results) {
        bool there = strcmp(member_text(result, "action"), "present") == 0;
        present += there;
        bytes += there ? 0.0 : member_number(result, "bytes", 0.0);
    }
    format_bytes(size, bytes);
    if (c->quiet)
        return;
    printf("%d file%s in %s", count, count == 1 ? "" : "s", dir);
    if (present == count)
        printf(", all there already\n");
    else
        printf(" (%s%s)\n", size, present ? "; the others were there" : "");
}

/* Fetches what the words after the first name (o NULL: all). `status`: of what led here; f->job is known where it is
 * STATUS_OK. */
static int get(struct fetch *f, const struct options *o, enum status status) {
    struct client *c = f->client;
    struct error *err = f->err;
    int code = CLIENT_OK;
    cJSON *results = cJSON_CreateArray();
    if (status == STATUS_OK)
        status = fetch_all(f, o, results);
    if (status == STATUS_CANCELLED)
        error_hint(err, "`unbake get %lld -o DIR` continues where this stopped", (long long)f->job);
    if (status != STATUS_OK)
        code = client_fail(c, &f->reply, err);
    else
        print_results(c, f->dir, results);
    cJSON_Delete(results);
    cJSON_Delete(f->outputs);
    reply_release(&f->reply);
    return code;
}

int get_run(struct client *c, const struct options *o) {
    struct error err;
    struct fetch f = {.client = c, .err = &err, .fd = -1};
    reply_init(&f.reply);
    enum status status = client_job_id(c, o->word[0], &f.job, &f.reply, &err);
    char *fallback = mem_printf("job-%lld", (long long)f.job);
    f.dir = options_text(o, "output", fallback);
    int code = get(&f, o, status);
    mem_free(fallback);
    return code;
}

int get_job(struct client *c, int64_t job, const char *dir) {
    struct error err;
    struct fetch f = {.client = c, .err = &err, .fd = -1, .job = job, .dir = dir};
    reply_init(&f.reply);
    return get(&f, NULL, STATUS_OK);
}
