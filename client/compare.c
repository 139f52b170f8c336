/* compare.c -- `compare`: jobs side by side: the settings in which they differ, and their main figures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/commands.h"
#include "client/format.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/protocol.h"
#include "common/url.h"

const struct command_option compare_options[] = {FORMAT_OPTION, {0}};

/* Figures of the outputs, as "member" or "object.member"; of one output in a row. */
static const struct job_figure {
    const char *kind, *output, *member, *heading;
} figures[] = {
    {JOB_KIND_RECONSTRUCT, OUTPUT_REPORT, "metrics.psnr_db", "?>psnr_db"},
    {JOB_KIND_RECONSTRUCT, OUTPUT_REPORT, "metrics.ssim", "?>ssim"},
    {JOB_KIND_RECONSTRUCT, OUTPUT_REPORT, "metrics.msre", "?>msre"},
    {JOB_KIND_RECONSTRUCT, OUTPUT_REPORT, "grey_card.ratio", "?>grey_card"},
    {JOB_KIND_EVALUATE, OUTPUT_EVALUATION, "base_color_psnr_db", "?>color_db"},
    {JOB_KIND_EVALUATE, OUTPUT_EVALUATION, "roughness_rms_error", "?>roughness_rms"},
    {JOB_KIND_EVALUATE, OUTPUT_EVALUATION, "specular_rms_error", "?>specular_rms"},
    {JOB_KIND_EVALUATE, OUTPUT_EVALUATION, "emission_iou", "?>emission_iou"},
    {JOB_KIND_EVALUATE, OUTPUT_EVALUATION, "msre", "?>truth_msre"},
};
#define FIGURE_COUNT (sizeof figures / sizeof *figures)
#define FIXED_COUNT 4                                             /* job, state, time, name */
#define SETTINGS_MAX (TABLE_COLUMNS - FIXED_COUNT - FIGURE_COUNT) /* columns for settings */

struct job_comparison {
    struct client *client;
    cJSON *jobs;                       /* array, by number; each with "figures" once read; owned */
    const char *setting[SETTINGS_MAX]; /* [setting_count] that are not the same in all jobs; borrowed from jobs */
    size_t setting_count, left_out;    /* left_out: settings that differ beyond the columns */
};

/* --- the jobs ------------------------------------------------------------------------------ */

static enum status add_labelled(struct job_comparison *x, const char *label, struct reply *reply, struct error *err) {
    struct buf path;
    cJSON *items = NULL;
    buf_init(&path, 4096);
    buf_puts(&path, "/v1/jobs?label=");
    url_encode(&path, label, false);
    enum status status = client_list(x->client, buf_text(&path), 0, &items, reply, err);
    buf_release(&path);
    if (status == STATUS_OK && cJSON_GetArraySize(items) == 0) {
        error_set(err, STATUS_NOT_FOUND, "no job has the label %.200s", label);
        status = error_hint(err, "`unbake show JOB` has a job's labels");
    }
    while (status == STATUS_OK && cJSON_GetArraySize(items) > 0)
        cJSON_AddItemToArray(x->jobs, cJSON_DetachItemFromArray(items, 0));
    cJSON_Delete(items);
    return status;
}

static enum status add_job(struct job_comparison *x, const char *word, struct reply *reply, struct error *err) {
    int64_t id;
    enum status status = client_job_id(x->client, word, &id, reply, err);
    if (status == STATUS_OK)
        status = client_job_get(x->client, id, reply, err);
    if (status == STATUS_OK)
        cJSON_AddItemToArray(x->jobs, cJSON_Duplicate(reply->json, true));
    return status;
}

/* A word is a job where it is a number or `last`, else a label. */
static enum status add_word(struct job_comparison *x, const char *word, struct reply *reply, struct error *err) {
    bool is_job = word[strspn(word, "0123456789")] == '\0' || strcmp(word, "last") == 0;
    return is_job ? add_job(x, word, reply, err) : add_labelled(x, word, reply, err);
}

static int by_number(const void *a, const void *b) {
    int64_t x = member_whole(*(cJSON *const *)a, "id", 0), y = member_whole(*(cJSON *const *)b, "id", 0);
    return (x > y) - (x < y);
}

/* Each job once, the oldest first. */
static void sort(struct job_comparison *x) {
    size_t count = (size_t)cJSON_GetArraySize(x->jobs);
    cJSON **job = mem_array(count + 1, sizeof *job);
    int64_t last = 0;
    for (size_t i = 0; i < count; i++)
        job[i] = cJSON_DetachItemFromArray(x->jobs, 0);
    qsort(job, count, sizeof *job, by_number);
    for (size_t i = 0; i < count; i++) {
        int64_t id = member_whole(job[i], "id", 0);
        if (i > 0 && id == last)
            cJSON_Delete(job[i]);
        else
            cJSON_AddItemToArray(x->jobs, job[i]);
        last = id;
    }
    mem_free(job);
}

/* --- settings ------------------------------------------------------------------------------ */

static const cJSON *setting_of(const cJSON *job, const char *key) {
    return cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(job, "settings"), key);
}

static bool differs(const struct job_comparison *x, const char *key) {
    const cJSON *job, *first = setting_of(x->jobs->child, key);
    cJSON_ArrayForEach(job, x->jobs) {
        const cJSON *value = setting_of(job, key);
        if ((value == NULL) != (first == NULL) || (value && !cJSON_Compare(value, first, true)))
            return true;
    }
    return false;
}

static bool is_listed(const struct job_comparison *x, const char *key) {
    for (size_t i = 0; i < x->setting_count; i++)
        if (strcmp(x->setting[i], key) == 0)
            return true;
    return false;
}

static void find_settings(struct job_comparison *x) {
    const cJSON *job, *setting;
    cJSON_ArrayForEach(job, x->jobs) {
        cJSON_ArrayForEach(setting, cJSON_GetObjectItemCaseSensitive(job, "settings")) {
            const char *key = member_name(setting);
            if (is_listed(x, key) || !differs(x, key))
                continue;
            if (x->setting_count < SETTINGS_MAX)
                x->setting[x->setting_count++] = key;
            else
                x->left_out++;
        }
    }
}

/* --- figures ------------------------------------------------------------------------------- */

/* The number at "object.member"; NULL where there is none. */
static const cJSON *find_figure(const cJSON *output, const char *member) {
    const char *dot = strchr(member, '.');
    if (dot) {
        char *name = mem_strndup(member, (size_t)(dot - member));
        output = cJSON_GetObjectItemCaseSensitive(output, name);
        mem_free(name);
        member = dot + 1;
    }
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(output, member);
    return cJSON_IsNumber(value) ? value : NULL;
}

/* Adds "figures" to the job; an output that is not there (yet) has none. */
static enum status read_figures(struct job_comparison *x, cJSON *job, struct reply *reply, struct error *err) {
    const char *fetched = NULL;
    cJSON *found = cJSON_AddObjectToObject(job, "figures");
    enum status status = STATUS_OK;
    for (size_t i = 0; i < FIGURE_COUNT && status == STATUS_OK; i++) {
        const struct job_figure *f = &figures[i];
        if (strcmp(member_text(job, "kind"), f->kind) != 0)
            continue;
        if (!fetched) {
            char *path = mem_printf("/v1/jobs/%lld/outputs/%s", (long long)member_whole(job, "id", 0), f->output);
            status = request_get(x->client->request, path, reply, err);
            mem_free(path);
            fetched = f->output;
            if (status == STATUS_NOT_FOUND && reply->code == 404)
                return STATUS_OK;
        }
        const cJSON *value = status == STATUS_OK ? find_figure(reply->json, f->member) : NULL;
        if (value)
            json_add_number(found, strrchr(f->heading, '>') + 1, value->valuedouble);
    }
    return status;
}

/* --- the table ----------------------------------------------------------------------------- */

static void put_settings(const struct job_comparison *x, struct table *t, const cJSON *job) {
    for (size_t i = 0; i < x->setting_count; i++) {
        const cJSON *value = setting_of(job, x->setting[i]);
        char *text = !value                  ? mem_strdup("-")
                     : cJSON_IsString(value) ? mem_strdup(value->valuestring)
                                             : json_text(value);
        table_set(t, 2 + i, COLOUR_NONE, "%s", text);
        mem_free(text);
    }
}

static void put_figures(const struct job_comparison *x, struct table *t, const cJSON *job) {
    const cJSON *found = cJSON_GetObjectItemCaseSensitive(job, "figures");
    for (size_t i = 0; i < FIGURE_COUNT; i++) {
        double value = member_number(found, strrchr(figures[i].heading, '>') + 1, (double)NAN);
        char text[24];
        format_figure(text, value);
        if (!isnan(value))
            table_set(t, 3 + x->setting_count + i, COLOUR_NONE, "%s", text);
    }
}

/* From its first start to its end or to now. */
static void put_time(struct table *t, size_t column, const cJSON *job) {
    double age = time_since(member_text(job, "started_at")),
           ended = time_parse(member_text(job, "finished_at")) - time_parse(member_text(job, "started_at"));
    char text[16];
    format_duration(text, isfinite(ended) ? ended : age);
    if (isfinite(age))
        table_set(t, column, COLOUR_NONE, "%s", text);
}

static void print_table(struct job_comparison *x) {
    const char *heading[TABLE_COLUMNS] = {">job", "state"};
    struct client *c = x->client;
    struct table t;
    const cJSON *job;
    size_t columns = 2;
    for (size_t i = 0; i < x->setting_count; i++)
        heading[columns++] = x->setting[i];
    size_t time = columns;
    heading[columns++] = ">time";
    for (size_t i = 0; i < FIGURE_COUNT; i++)
        heading[columns++] = figures[i].heading;
    heading[columns++] = "name";
    table_init(&t, columns, heading);
    cJSON_ArrayForEach(job, x->jobs) {
        const char *state = member_text(job, "state");
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%.0f", member_number(job, "id", 0.0));
        table_set(&t, 1, state_colour(state), "%s", state);
        put_settings(x, &t, job);
        put_time(&t, time, job);
        put_figures(x, &t, job);
        table_set(&t, columns - 1, COLOUR_NONE, "%s", member_text(job, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
    if (x->left_out)
        client_note(c, "%zu more settings differ; --json has all", x->left_out);
}

/* --json: what the table has, with the settings whole. */
static void print_json(const struct job_comparison *x) {
    static const char *const members[] = {"id",     "name",     "state",      "kind",        "scene",
                                          "labels", "settings", "started_at", "finished_at", "figures"};
    cJSON *list = cJSON_CreateArray();
    const cJSON *job;
    cJSON_ArrayForEach(job, x->jobs) {
        cJSON *item = cJSON_CreateObject();
        for (size_t i = 0; i < sizeof members / sizeof *members; i++) {
            const cJSON *member = cJSON_GetObjectItemCaseSensitive(job, members[i]);
            if (member)
                json_add(item, members[i], cJSON_Duplicate(member, true));
        }
        cJSON_AddItemToArray(list, item);
    }
    client_print_json(x->client, list);
    cJSON_Delete(list);
}

int compare_run(struct client *c, const struct options *o) {
    struct job_comparison x = {.client = c, .jobs = cJSON_CreateArray()};
    struct reply reply;
    struct error err;
    cJSON *job;
    int code = CLIENT_OK;
    enum status status = STATUS_OK;
    reply_init(&reply);
    for (size_t i = 0; i < o->word_count && status == STATUS_OK; i++)
        status = add_word(&x, o->word[i], &reply, &err);
    if (status == STATUS_OK)
        sort(&x);
    cJSON_ArrayForEach(job, x.jobs) {
        if (status == STATUS_OK)
            status = read_figures(&x, job, &reply, &err);
    }
    if (status == STATUS_OK)
        find_settings(&x);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        print_json(&x);
    else
        print_table(&x);
    cJSON_Delete(x.jobs);
    reply_release(&reply);
    return code;
}
