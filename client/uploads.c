/* uploads.c -- `uploads` and `collect`: what is under way to the server, and what it removes. */
#include <string.h>

#include "client/commands.h"
#include "client/keeping.h"
#include "client/table.h"
#include "common/mem.h"

const struct option uploads_options[] = {
    {"limit", 'n', OPTION_WHOLE, "N", "list at most so many (20); 0: all"},
    {"dry-run", 0, OPTION_FLAG, NULL, "with rm: only say what would be removed"},
    {0},
};
const struct option collect_options[] = {
    {"dry-run", 0, OPTION_FLAG, NULL, "only say what would be removed"},
    {0},
};

static void print_uploads(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"upload", ">done", ">size", ">age", ">expires", "name"};
    struct table t;
    const cJSON *item;
    table_init(&t, 6, headings);
    cJSON_ArrayForEach(item, items) {
        char size[16], age[16], expires[16];
        double length = member_number(item, "length", 1.0);
        format_bytes(size, length);
        format_duration(age, time_since(member_text(item, "created_at")));
        keeping_text(expires, item);
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", member_text(item, "id"));
        table_set(&t, 1, COLOUR_NONE, "%.0f%%", 100.0 * member_number(item, "offset", 0.0) / length);
        table_set(&t, 2, COLOUR_NONE, "%s", size);
        table_set(&t, 3, COLOUR_NONE, "%s", age);
        table_set(&t, 4, COLOUR_NONE, "%s", expires);
        table_set(&t, 5, COLOUR_NONE, "%s", member_text(item, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

static int list_uploads(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    cJSON *items = NULL;
    const cJSON *item;
    int code = CLIENT_OK;
    long limit = options_whole(o, "limit", 20);
    reply_init(&reply);
    enum status status =
        limit < 0 ? error_set(&err, STATUS_INPUT, "--limit takes 0 or more, not %ld", limit)
                  : client_list(c, "/v1/uploads", (size_t)limit, &items, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, items);
    else if (c->quiet)
        cJSON_ArrayForEach(item, items) { printf("%s\n", member_text(item, "id")); }
    else if (cJSON_GetArraySize(items) == 0)
        client_note(c, "no uploads");
    else
        print_uploads(c, items);
    cJSON_Delete(items);
    reply_release(&reply);
    return code;
}

static int remove_upload(struct client *c, const char *id, bool dry_run) {
    struct reply reply;
    struct error err;
    struct buf path;
    char size[16];
    int code = CLIENT_OK;
    reply_init(&reply);
    buf_init(&path, 4096);
    buf_puts(&path, "/v1/uploads/");
    request_escape(&path, id, false);
    buf_puts(&path, dry_run ? "?dry_run=1" : "");
    struct request_call call = {.path = buf_text(&path), .method = "DELETE"};
    if (request_run(c->request, &call, &reply, &err) != STATUS_OK) {
        code = client_fail(c, &reply, &err);
    } else if (c->json) {
        cJSON *value = dry_run ? cJSON_Duplicate(reply.json, true) : cJSON_CreateObject();
        json_add_string(value, "id", id);
        json_add_bool(value, "removed", !dry_run);
        client_print_json(c, value);
        cJSON_Delete(value);
    } else if (!c->quiet) {
        format_bytes(size, member_number(reply.json, "bytes", 0.0));
        printf(dry_run ? "upload %s: %s\n" : "upload %s removed\n", id, size);
    }
    buf_release(&path);
    reply_release(&reply);
    return code;
}

int uploads_run(struct client *c, const struct options *o) {
    const char *verb = o->word_count ? o->word[0] : "list";
    if (strcmp(verb, "list") == 0 && o->word_count <= 1)
        return list_uploads(c, o);
    if (strcmp(verb, "rm") != 0 || o->word_count < 2) {
        struct error err;
        error_set(&err, STATUS_INPUT, "uploads takes nothing or `rm UPLOAD...`, not \"%.100s\"", verb);
        return client_fail(c, NULL, &err);
    }
    int first = CLIENT_OK;
    for (size_t i = 1; i < o->word_count; i++) {
        int code = remove_upload(c, o->word[i], options_flag(o, "dry-run"));
        if (first == CLIENT_OK)
            first = code;
    }
    return first;
}

static void print_collected(struct client *c, const cJSON *reply, bool dry_run) {
    static const char *const headings[] = {"kind", "id", ">files", ">size", "expired", "name"};
    struct table t;
    const cJSON *item;
    char size[16];
    table_init(&t, 6, headings);
    cJSON_ArrayForEach(item, member_items(reply, "items")) {
        format_bytes(size, member_number(item, "bytes", 0.0));
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", member_text(item, "kind"));
        table_set(&t, 1, COLOUR_NONE, "%.12s", member_text(item, "id"));
        table_set(&t, 2, COLOUR_NONE, "%.0f", member_number(item, "files", 0.0));
        table_set(&t, 3, COLOUR_NONE, "%s", size);
        table_set(&t, 4, COLOUR_NONE, "%s", member_text(item, "expires_at"));
        table_set(&t, 5, COLOUR_NONE, "%s", member_text(item, "name"));
    }
    if (cJSON_GetArraySize(member_items(reply, "items")) > 0)
        table_print(&t, &c->out);
    table_release(&t);
    format_bytes(size, member_number(reply, "bytes", 0.0));
    client_note(c, dry_run ? "%s would be freed" : "%s were freed", size);
}

int collect_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    bool dry_run = options_flag(o, "dry-run");
    struct request_call call = {.path = dry_run ? "/v1/collect?dry_run=1" : "/v1/collect", .method = "POST"};
    int code = CLIENT_OK;
    reply_init(&reply);
    if (request_run(c->request, &call, &reply, &err) != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, reply.json);
    else if (!c->quiet)
        print_collected(c, reply.json, dry_run);
    reply_release(&reply);
    return code;
}
