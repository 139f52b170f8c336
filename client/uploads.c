/* uploads.c -- `uploads` and `collect`: unfinished uploads, and what the server removes. */
#include "client/collection.h"
#include "client/commands.h"
#include "client/retention.h"
#include "client/table.h"

const struct command_option collect_options[] = {
    {"dry-run", 0, OPTION_FLAG, NULL, "only say what would be removed"},
    FORMAT_OPTION,
    {0},
};

static void print_uploads(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"upload",    ">done",  "~>size",  "~>age",
                                           "~>expires", "~scene", "~?owner", "name"};
    struct table t;
    const cJSON *item;
    table_init(&t, 8, headings);
    cJSON_ArrayForEach(item, items) {
        char size[16], age[16], expires[16];
        double length = member_number(item, "length", 1.0);
        format_bytes(size, length);
        format_duration(age, time_since(member_text(item, "created_at")));
        retention_text(expires, item);
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", member_text(item, "id"));
        table_set(&t, 1, COLOUR_NONE, "%.0f%%", 100.0 * member_number(item, "offset", 0.0) / length);
        table_set(&t, 2, COLOUR_NONE, "%s", size);
        table_set(&t, 3, COLOUR_NONE, "%s", age);
        table_set(&t, 4, COLOUR_NONE, "%s", expires);
        table_set(&t, 5, COLOUR_NONE, "%.12s", member_text(item, "scene"));
        table_set(&t, 6, COLOUR_NONE, "%s", member_text(item, "owner"));
        table_set(&t, 7, COLOUR_NONE, "%s", member_text(item, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

static void print_upload(struct client *c, const cJSON *upload) {
    char done[16], size[16], text[40];
    format_bytes(done, member_number(upload, "offset", 0.0));
    format_bytes(size, member_number(upload, "length", 0.0));
    snprintf(text, sizeof text, "%s of %s", done, size);
    field_print(c, "upload", member_text(upload, "id"));
    field_print(c, "name", member_text(upload, "name"));
    field_print(c, "owner", member_text(upload, "owner"));
    field_print(c, "received", text);
    field_print(c, "scene", member_text(upload, "scene"));
    field_print(c, "created", member_text(upload, "created_at"));
    field_print(c, "updated", member_text(upload, "updated_at"));
    field_print(c, "expires", retention_time(upload));
}

int uploads_run(struct client *c, const struct options *o) {
    static const struct collection uploads = {"uploads", "upload", "/v1/uploads", print_uploads, print_upload, NULL};
    return collection_run(c, o, &uploads);
}

static void print_collected(struct client *c, const cJSON *reply, bool dry_run) {
    static const char *const headings[] = {"kind", "id", "~>files", ">size", "~expired", "name"};
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
