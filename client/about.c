/* about.c -- `settings` and `version`: facts about the server, or else about this program. */
#include <archive.h>
#include <string.h>

#include "client/commands.h"
#include "client/table.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/protocol.h"
#include "common/render_settings.h"
#include "common/settings.h"

const struct command_option version_options[] = {
    {"verbose", 'v', OPTION_FLAG, NULL, "all libraries, a line each"},
    FORMAT_OPTION,
    {0},
};

const struct command_option settings_options[] = {
    {"kind", 'k', OPTION_TEXT, "KIND", "of which jobs: reconstruct (the default) or render"},
    FORMAT_OPTION,
    {0},
};

void setting_values(struct buf *out, const cJSON *setting) {
    const char *type = member_text(setting, "type"), *unit = member_text(setting, "unit");
    const cJSON *choices = member_items(setting, "choices"), *choice;
    if (choices)
        cJSON_ArrayForEach(choice, choices)
            buf_printf(out, "%s%s", choice == choices->child ? "" : ", ",
                       cJSON_IsString(choice) ? choice->valuestring : "");
    else if (cJSON_HasObjectItem(setting, "minimum"))
        buf_printf(out, "%.16g to %.16g%s%s", member_number(setting, "minimum", 0.0),
                   member_number(setting, "maximum", 0.0), *unit ? " " : "", unit);
    else
        buf_puts(out, strcmp(type, "bool") == 0 ? "true, false" : type);
}

void setting_default(struct buf *out, const cJSON *setting) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(setting, "default");
    char *text = cJSON_IsString(value) ? mem_strdup(value->valuestring) : json_text(value);
    buf_puts(out, text);
    mem_free(text);
}

static void print_settings(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"setting", ">default", "~values", "|meaning"};
    struct table t;
    const cJSON *setting;
    table_init(&t, 4, headings);
    cJSON_ArrayForEach(setting, items) {
        struct buf values, initial;
        buf_init(&values, 4096);
        buf_init(&initial, 4096);
        setting_values(&values, setting);
        setting_default(&initial, setting);
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", member_text(setting, "name"));
        table_set(&t, 1, COLOUR_NONE, "%s", buf_text(&initial));
        table_set(&t, 2, COLOUR_NONE, "%s", buf_text(&values));
        table_set(&t, 3, COLOUR_NONE, "%s", member_text(setting, "help"));
        buf_release(&values);
        buf_release(&initial);
    }
    table_print(&t, &c->out);
    table_release(&t);
}

/* Leaves only the settings named in o. */
static enum status pick(cJSON *items, const struct options *o, struct error *err) {
    for (size_t w = 0; w < o->word_count; w++) {
        struct nearest nearest;
        const cJSON *setting;
        bool found = false;
        nearest_init(&nearest, o->word[w]);
        cJSON_ArrayForEach(setting, items) {
            found = found || strcmp(member_text(setting, "name"), o->word[w]) == 0;
            nearest_offer(&nearest, member_text(setting, "name"));
        }
        if (found)
            continue;
        error_set(err, STATUS_INPUT, "there is no setting \"%.100s\"", o->word[w]);
        return nearest.best ? error_hint(err, "did you mean %s?", nearest.best)
                            : error_hint(err, "`unbake settings` lists them");
    }
    for (int i = cJSON_GetArraySize(items); o->word_count && i-- > 0;) {
        bool named = false;
        for (size_t w = 0; w < o->word_count; w++)
            named = named || strcmp(member_text(cJSON_GetArrayItem(items, i), "name"), o->word[w]) == 0;
        if (!named)
            cJSON_DeleteItemFromArray(items, i);
    }
    return STATUS_OK;
}

int settings_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    int code = CLIENT_OK;
    cJSON *items = NULL;
    reply_init(&reply);
    const char *kind = options_text(o, "kind", JOB_KIND_RECONSTRUCT);
    bool is_render = strcmp(kind, JOB_KIND_RENDER) == 0;
    char path[64];
    snprintf(path, sizeof path, "/v1/settings%s", is_render ? "?kind=" JOB_KIND_RENDER : "");
    enum status status = is_render || strcmp(kind, JOB_KIND_RECONSTRUCT) == 0
                             ? request_get(c->request, path, &reply, &err)
                             : error_set(&err, STATUS_INPUT, "--kind must be reconstruct or render, not %.60s", kind);
    if (status == STATUS_OK) {
        items = cJSON_DetachItemFromObjectCaseSensitive(reply.json, "items");
    } else if (status == STATUS_UNAVAILABLE) {
        client_note(c, "%s; these are the settings that version " UNBAKE_VERSION " knows", err.message);
        items = is_render ? render_settings_describe() : settings_describe();
        status = STATUS_OK;
        reply.code = 0;
    }
    if (status == STATUS_OK && items)
        status = pick(items, o, &err);
    if (status != STATUS_OK)
        code = client_fail(c, status == STATUS_INPUT ? NULL : &reply, &err);
    else if (c->json)
        client_print_json(c, items);
    else
        print_settings(c, items);
    cJSON_Delete(items);
    reply_release(&reply);
    return code;
}

static void print_server(struct client *c, const cJSON *server) {
    struct buf line;
    const cJSON *library;
    buf_init(&line, 1 << 16);
    buf_puts(&line, "unbaked ");
    terminal_clean(&line, member_text(server, "version"));
    buf_printf(&line, " at %s", request_server(c->request));
    cJSON_ArrayForEach(library, cJSON_GetObjectItemCaseSensitive(server, "libraries")) {
        buf_puts(&line, ", ");
        terminal_clean(&line, member_name(library));
        buf_puts(&line, " ");
        terminal_clean(&line, cJSON_IsString(library) ? library->valuestring : "?");
    }
    printf("%s\n", buf_text(&line));
    buf_release(&line);
}

static void print_versions_json(struct client *c, const cJSON *server) {
    cJSON *object = cJSON_CreateObject(), *client = cJSON_CreateObject();
    cJSON *libraries = cJSON_CreateObject();
    json_add_string(client, "version", UNBAKE_VERSION);
    json_add_string(client, "api", PROTOCOL_API);
    json_add_string(libraries, "libcurl", request_library_version());
    json_add_string(libraries, "libarchive", archive_version_details());
    json_add(client, "libraries", libraries);
    json_add(object, "client", client);
    json_add(object, "server", server ? cJSON_Duplicate(server, true) : cJSON_CreateNull());
    client_print_json(c, object);
    cJSON_Delete(object);
}

static void print_client_verbose(struct client *c) {
    field_print(c, "unbake", UNBAKE_VERSION);
    field_print(c, "  API", PROTOCOL_API);
    field_print(c, "  libcurl", request_library_version());
    field_print(c, "  libarchive", archive_version_details());
}

static void print_server_verbose(struct client *c, const cJSON *server) {
    const cJSON *library;
    field_print(c, "unbaked", member_text(server, "version"));
    field_print(c, "  at", request_server(c->request));
    field_print(c, "  API", member_text(server, "api"));
    cJSON_ArrayForEach(library, cJSON_GetObjectItemCaseSensitive(server, "libraries")) {
        char *name = mem_printf("  %s", member_name(library));
        field_print(c, name, cJSON_IsString(library) ? library->valuestring : "?");
        mem_free(name);
    }
}

/* Differing versions are no fault: within an API version servers and clients of any versions fit. */
static void note_difference(struct client *c, const cJSON *server) {
    if (strcmp(member_text(server, "api"), PROTOCOL_API) != 0)
        client_note(c, "this client speaks API %s, the server %.40s", PROTOCOL_API, member_text(server, "api"));
}

/* An unreachable server is part of the answer, not a failure. */
int version_run(struct client *c, const struct options *o) {
    bool verbose = options_flag(o, "verbose");
    struct reply reply;
    struct error err;
    reply_init(&reply);
    struct request_call call = {.path = "/v1/version", .once = true};
    enum status status = request_run(c->request, &call, &reply, &err);
    int code = CLIENT_OK;
    if (status != STATUS_OK && status != STATUS_UNAVAILABLE)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        print_versions_json(c, reply.json);
    else {
        if (verbose)
            print_client_verbose(c);
        else
            printf("unbake %s, libcurl %s, %s\n", UNBAKE_VERSION, request_library_version(), archive_version_details());
        if (status == STATUS_OK)
            (verbose ? print_server_verbose : print_server)(c, reply.json);
        else
            client_say(c, "%s", err.message);
        if (status == STATUS_OK)
            note_difference(c, reply.json);
    }
    reply_release(&reply);
    return code;
}
