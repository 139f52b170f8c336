/* client.c -- see client.h. */
#include "client/client.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/mem.h"
#include "common/url.h"

/* --- how a command ends -------------------------------------------------------------------- */

static int exit_of(const struct reply *reply, const struct error *err) {
    bool answered = reply && reply->code > 0;
    switch (err->status) {
    case STATUS_CANCELLED: return CLIENT_INTERRUPTED;
    case STATUS_UNAVAILABLE: return CLIENT_UNREACHABLE;
    case STATUS_NOT_FOUND: return answered ? CLIENT_NOT_FOUND : CLIENT_LOCAL;
    case STATUS_CONFLICT: return answered ? CLIENT_CONFLICT : CLIENT_LOCAL;
    case STATUS_INPUT: return answered ? CLIENT_REFUSED : CLIENT_USAGE;
    default: return answered ? CLIENT_REFUSED : CLIENT_LOCAL;
    }
}

static void put_clean(FILE *out, const char *text) {
    struct buf clean;
    buf_init(&clean, 1 << 20);
    terminal_clean(&clean, text);
    fputs(buf_text(&clean), out);
    buf_release(&clean);
}

static void print_problem_json(const struct reply *reply, const struct error *err, int code) {
    cJSON *object;
    if (reply && reply->code >= 400 && cJSON_IsObject(reply->json)) {
        object = cJSON_Duplicate(reply->json, true);
    } else {
        object = cJSON_CreateObject();
        json_add_string(object, "title", status_name(err->status));
        json_add_string(object, "detail", err->message);
        if (err->hint[0])
            json_add_string(object, "hint", err->hint);
    }
    json_add_int(object, "exit_status", code);
    char *text = json_text(object);
    fprintf(stderr, "%s\n", text);
    mem_free(text);
    cJSON_Delete(object);
}

static void print_invalid_params(struct client *c, const struct reply *reply) {
    const cJSON *item;
    cJSON_ArrayForEach(item, member_items(reply->json, "invalid_params")) {
        fputs("  ", stderr);
        fputs(terminal_colour(&c->err, COLOUR_YELLOW), stderr);
        put_clean(stderr, member_text(item, "name"));
        fputs(terminal_colour(&c->err, COLOUR_NONE), stderr);
        fputs(": ", stderr);
        put_clean(stderr, member_text(item, "reason"));
        const char *hint = member_text(item, "hint");
        if (*hint) {
            fputs(" (", stderr);
            put_clean(stderr, hint);
            fputs(")", stderr);
        }
        fputs("\n", stderr);
    }
}

int client_fail(struct client *c, const struct reply *reply, const struct error *err) {
    int code = exit_of(reply, err);
    terminal_clear(&c->out);
    terminal_clear(&c->err);
    fflush(stdout);
    if (c->json) {
        print_problem_json(reply, err, code);
        return code;
    }
    fprintf(stderr, "%sunbake:%s ", terminal_colour(&c->err, COLOUR_RED), terminal_colour(&c->err, COLOUR_NONE));
    put_clean(stderr, err->message);
    fputs("\n", stderr);
    if (reply && reply->json)
        print_invalid_params(c, reply);
    if (err->hint[0]) {
        fputs("  hint: ", stderr);
        put_clean(stderr, err->hint);
        fputs("\n", stderr);
    }
    if (reply && reply->code == 429 && reply->retry_after_sec >= 0.0)
        fprintf(stderr, "  try again in %.0f s\n", reply->retry_after_sec);
    return code;
}

void client_note(struct client *c, const char *format, ...) {
    if (c->quiet || c->json)
        return;
    char text[2048];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    terminal_clear(&c->out);
    terminal_clear(&c->err);
    fflush(stdout);
    fputs("unbake: ", stderr);
    put_clean(stderr, text);
    fputs("\n", stderr);
}

void client_say(struct client *c, const char *format, ...) {
    char text[8192]; /* a server's names and states are far shorter */
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    put_clean(c->out.out, text);
    fputs("\n", c->out.out);
}

void field_print(struct client *c, const char *name, const char *value) {
    if (!*value)
        return;
    struct buf clean_name, clean;
    buf_init(&clean_name, 1 << 10);
    buf_init(&clean, 1 << 16);
    terminal_clean(&clean_name, name);
    terminal_clean(&clean, value);
    fprintf(c->out.out, "%s%-16s%s %s\n", terminal_colour(&c->out, COLOUR_DIM), buf_text(&clean_name),
            terminal_colour(&c->out, COLOUR_NONE), buf_text(&clean));
    buf_release(&clean);
    buf_release(&clean_name);
}

void client_print_json(struct client *c, const cJSON *value) {
    const cJSON *item;
    if (c->format == FORMAT_JSONL && cJSON_IsArray(value)) {
        cJSON_ArrayForEach(item, value)
            client_print_json(c, item);
        return;
    }
    char *text = json_text(value);
    fprintf(c->out.out, "%s\n", text);
    fflush(c->out.out);
    mem_free(text);
}

/* --- members ------------------------------------------------------------------------------- */

const char *member_text(const cJSON *object, const char *key) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsString(value) ? value->valuestring : "";
}

double member_number(const cJSON *object, const char *key, double fallback) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsNumber(value) && isfinite(value->valuedouble) ? value->valuedouble : fallback;
}

int64_t member_whole(const cJSON *object, const char *key, int64_t fallback) {
    double value = member_number(object, key, (double)fallback);
    return fabs(value) <= 0x1p53 ? (int64_t)value : fallback;
}

const cJSON *member_items(const cJSON *object, const char *key) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsArray(value) ? value : NULL;
}

const char *member_name(const cJSON *member) { return member->string ? member->string : ""; }

double time_parse(const char *text) {
    struct tm time = {0};
    const char *rest = strptime(text, "%Y-%m-%dT%H:%M:%S", &time);
    if (!rest)
        return (double)NAN;
    double fraction = 0.0;
    if (*rest == '.') {
        char *end;
        fraction = strtod(rest, &end);
        rest = end;
    }
    return strcmp(rest, "Z") == 0 ? (double)timegm(&time) + fraction : (double)NAN;
}

double time_since(const char *text) {
    double age = difftime(time(NULL), 0) - time_parse(text);
    return age < 0.0 ? 0.0 : age;
}

/* --- jobs and lists ------------------------------------------------------------------------ */

enum status client_job_id(struct client *c, const char *word, int64_t *id, struct reply *reply, struct error *err) {
    if (strcmp(word, "last") == 0) {
        enum status status = request_get(c->request, "/v1/jobs?limit=1", reply, err);
        if (status != STATUS_OK)
            return status;
        const cJSON *newest = cJSON_GetArrayItem(member_items(reply->json, "items"), 0);
        *id = member_whole(newest, "id", 0);
        return *id > 0 ? STATUS_OK : error_set(err, STATUS_NOT_FOUND, "there are no jobs yet");
    }
    char *end;
    *id = strtoll(word, &end, 10);
    if (word[0] >= '0' && word[0] <= '9' && *end == '\0' && *id > 0 && strlen(word) < 19)
        return STATUS_OK;
    error_set(err, STATUS_INPUT, "\"%.100s\" is not a job", word);
    return error_hint(err, "a job is a number, as `unbake list` shows it, or `last`");
}

enum status client_job_get(struct client *c, int64_t id, struct reply *reply, struct error *err) {
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld", (long long)id);
    return request_get(c->request, path, reply, err);
}

enum status client_list(struct client *c, const char *path, size_t limit, cJSON **items, struct reply *reply,
                        struct error *err) {
    char *cursor = NULL;
    enum status status;
    *items = cJSON_CreateArray();
    do {
        size_t have = (size_t)cJSON_GetArraySize(*items);
        size_t page = limit && limit - have < 200 ? limit - have : 200;
        struct buf target;
        buf_init(&target, 4096);
        buf_printf(&target, "%s%climit=%zu", path, strchr(path, '?') ? '&' : '?', page);
        if (cursor) {
            buf_puts(&target, "&cursor=");
            url_encode(&target, cursor, false);
        }
        mem_free(cursor);
        cursor = NULL;
        status = request_get(c->request, buf_text(&target), reply, err);
        buf_release(&target);
        if (status != STATUS_OK)
            break;
        cJSON *found = cJSON_GetObjectItemCaseSensitive(reply->json, "items");
        cJSON *item;
        while ((item = cJSON_DetachItemFromArray(found, 0)) != NULL)
            cJSON_AddItemToArray(*items, item);
        const char *next = member_text(reply->json, "next");
        if (*next)
            cursor = mem_strdup(next);
    } while (cursor && (!limit || (size_t)cJSON_GetArraySize(*items) < limit));
    mem_free(cursor);
    return status;
}
