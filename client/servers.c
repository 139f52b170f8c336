/* servers.c -- see servers.h; and `servers`, which lists them. */
#include "client/servers.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/commands.h"
#include "client/credentials.h"
#include "client/table.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/protocol.h"

#define FILE_MAX_BYTES ((size_t)1 << 20) /* of the configuration file */

/* --- the file ------------------------------------------------------------------------------ */

void servers_release(struct servers *s) {
    for (size_t i = 0; i < s->count; i++) {
        mem_free(s->entry[i].name);
        mem_free(s->entry[i].url);
        mem_free(s->entry[i].ca);
        mem_free(s->entry[i].token_file);
    }
    mem_free(s->entry);
    mem_free(s->chosen);
    mem_free(s->path);
    *s = (struct servers){0};
}

/* Refuses a file that somebody else could turn to a server of his. */
static enum status read_safe(const char *path, struct buf *text, struct error *err) {
    struct stat info;
    buf_init(text, FILE_MAX_BYTES);
    if (stat(path, &info) != 0)
        return errno == ENOENT || errno == ENOTDIR ? STATUS_OK : error_set_errno(err, errno, "cannot access %s", path);
    if ((info.st_mode & 022) != 0 || (info.st_uid != geteuid() && info.st_uid != 0)) {
        error_set(err, STATUS_IO, "%s can be written by others: it is not used", path);
        return error_hint(err, "chmod 600 %s", path);
    }
    return file_read(path, text, err);
}

/* Removes blanks at both ends, and what follows " #". */
static char *trimmed(char *line) {
    line += strspn(line, " \t");
    for (char *at = line; *at; at++)
        if (*at == '#' && (at == line || at[-1] == ' ' || at[-1] == '\t')) {
            *at = '\0';
            break;
        }
    for (size_t length = strlen(line); length > 0 && strchr(" \t\r", line[length - 1]); length--)
        line[length - 1] = '\0';
    return line;
}

static bool is_name(const char *text) {
    return *text && text[strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.")] == '\0';
}

static enum status begin_section(struct servers *s, char *line, struct error *err) {
    size_t length = strlen(line);
    if (line[length - 1] == ']')
        line[length - 1] = '\0';
    if (line[length - 1] != '\0' || !is_name(line + 1))
        return error_set(err, STATUS_INPUT, "[NAME] has letters, digits, \"-\", \"_\" and \".\"");
    for (size_t i = 0; i < s->count; i++)
        if (strcmp(s->entry[i].name, line + 1) == 0)
            return error_set(err, STATUS_INPUT, "there is a [%.100s] above", line + 1);
    s->entry = mem_realloc_array(s->entry, s->count + 1, sizeof *s->entry);
    s->entry[s->count++] = (struct server_entry){.name = mem_strdup(line + 1)};
    return STATUS_OK;
}

/* A path of the file: "~/" is the home folder, a relative one begins where the file lies. */
static char *path_of(const struct servers *s, const char *value) {
    const char *home = getenv("HOME");
    if (value[0] == '~' && value[1] == '/' && home)
        return mem_printf("%s%s", home, value + 1);
    return value[0] == '/' ? mem_strdup(value)
                           : mem_printf("%.*s/%s", (int)(strrchr(s->path, '/') - s->path), s->path, value);
}

static enum status assign(struct servers *s, const char *key, const char *value, struct error *err) {
    static const char *const keys[] = {"url", "ca", "token_file"};
    struct server_entry *e = s->count ? &s->entry[s->count - 1] : NULL;
    char **member[] = {e ? &e->url : NULL, e ? &e->ca : NULL, e ? &e->token_file : NULL};
    struct nearest nearest;
    if (!e && strcmp(key, "server") == 0) {
        mem_free(s->chosen);
        s->chosen = mem_strdup(value);
        return STATUS_OK;
    }
    nearest_init(&nearest, key);
    for (size_t i = 0; e && i < sizeof keys / sizeof *keys; i++) {
        nearest_offer(&nearest, keys[i]);
        if (strcmp(keys[i], key) != 0)
            continue;
        mem_free(*member[i]);
        *member[i] = i == 0 ? mem_strdup(value) : path_of(s, value);
        return STATUS_OK;
    }
    error_set(err, STATUS_INPUT, "unknown name \"%.60s\"", key);
    return nearest.best ? error_hint(err, "did you mean %s?", nearest.best)
                        : error_hint(err, e ? "a server has url, ca and token_file"
                                            : "before the first [NAME] there is only `server = NAME`");
}

static enum status read_line(struct servers *s, char *line, struct error *err) {
    line = trimmed(line);
    if (!*line)
        return STATUS_OK;
    if (*line == '[')
        return begin_section(s, line, err);
    char *equals = strchr(line, '=');
    if (!equals)
        return error_set(err, STATUS_INPUT, "\"%.60s\" is neither [NAME] nor name = value", line);
    *equals = '\0';
    const char *key = trimmed(line), *value = trimmed(equals + 1);
    return *value ? assign(s, key, value, err) : error_set(err, STATUS_INPUT, "%.60s has no value", key);
}

static enum status read_lines(struct servers *s, char *text, struct error *err) {
    size_t number = 0;
    for (char *line = text; *line;) {
        size_t length = strcspn(line, "\n");
        bool last = line[length] == '\0';
        line[length] = '\0';
        number++;
        if (read_line(s, line, err) != STATUS_OK) {
            char reason[sizeof err->message];
            memcpy(reason, err->message, sizeof reason);
            char hint[sizeof err->hint];
            memcpy(hint, err->hint, sizeof hint);
            error_set(err, STATUS_INPUT, "%s, line %zu: %.400s", s->path, number, reason);
            return *hint ? error_hint(err, "%s", hint) : STATUS_INPUT;
        }
        line += length + !last;
    }
    for (size_t i = 0; i < s->count; i++)
        if (!s->entry[i].url)
            return error_set(err, STATUS_INPUT, "%s: [%s] has no url", s->path, s->entry[i].name);
    return STATUS_OK;
}

enum status servers_read(struct servers *s, struct error *err) {
    struct buf text;
    *s = (struct servers){.path = credentials_folder_file("config")};
    if (!s->path)
        return STATUS_OK;
    enum status status = read_safe(s->path, &text, err);
    char *lines = mem_strdup(buf_text(&text));
    buf_release(&text);
    if (status == STATUS_OK)
        status = read_lines(s, lines, err);
    mem_free(lines);
    return status;
}

const char *servers_word(const struct options *o) {
    const char *server = getenv("UNBAKE_SERVER");
    return options_text(o, "server", server && *server ? server : NULL);
}

enum status servers_find(const struct servers *s, const char *word, const char **url, const struct server_entry **entry,
                         struct error *err) {
    struct nearest nearest;
    const char *name = word ? word : s->chosen;
    *entry = NULL;
    *url = name ? name : PROTOCOL_DEFAULT_SERVER;
    if (!name || strchr(name, ':'))
        return STATUS_OK;
    nearest_init(&nearest, name);
    for (size_t i = 0; i < s->count; i++) {
        nearest_offer(&nearest, s->entry[i].name);
        if (strcmp(s->entry[i].name, name) != 0)
            continue;
        *entry = &s->entry[i];
        *url = s->entry[i].url;
        return STATUS_OK;
    }
    error_set(err, STATUS_INPUT, "no server is named \"%.100s\" in %s", name, s->path ? s->path : "a configuration");
    return nearest.best ? error_hint(err, "did you mean %s?", nearest.best)
                        : error_hint(err, "`unbake servers` lists the names; a URL begins with http:// or https://");
}

/* --- the command --------------------------------------------------------------------------- */

const struct command_option servers_options[] = {FORMAT_OPTION, {0}};

/* "file", "kept" by `unbake login`, "none"; "unreadable" where the file must not be used. */
static const char *token_of(const struct server_entry *e, const char *url) {
    char *token = NULL;
    enum status status =
        e && e->token_file ? credentials_read(e->token_file, &token, NULL) : credentials_find(url, &token, NULL);
    bool found = token != NULL;
    mem_free(token);
    return status != STATUS_OK ? "unreadable" : !found ? "none" : e && e->token_file ? "file" : "kept";
}

static cJSON *describe(const struct server_entry *e, const char *url, bool in_use) {
    cJSON *item = cJSON_CreateObject();
    struct http_request *r = request_new(url, 0.0, -1); /* as tokens are kept: without a trailing slash */
    json_add_string(item, "name", e ? e->name : "");
    json_add_string(item, "url", request_server(r));
    json_add_bool(item, "in_use", in_use);
    json_add_string(item, "token", token_of(e, request_server(r)));
    json_add_string(item, "token_file", e && e->token_file ? e->token_file : "");
    json_add_string(item, "ca", e && e->ca ? e->ca : "");
    request_free(r);
    return item;
}

static void print_servers(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"", "server", "~token", "~?ca", "url"};
    const cJSON *item;
    struct table t;
    table_init(&t, 5, headings);
    cJSON_ArrayForEach(item, items) {
        const char *token = member_text(item, "token");
        bool is_bad = strcmp(token, "unreadable") == 0;
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%s", cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(item, "in_use")) ? "*" : " ");
        table_set(&t, 1, COLOUR_NONE, "%s", member_text(item, "name"));
        table_set(&t, 2, is_bad ? COLOUR_RED : COLOUR_NONE, "%s", token);
        table_set(&t, 3, COLOUR_NONE, "%s", member_text(item, "ca"));
        table_set(&t, 4, COLOUR_NONE, "%s", member_text(item, "url"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

int servers_run(struct client *c, const struct options *o) {
    struct servers s;
    struct error err;
    const char *url;
    const struct server_entry *in_use;
    cJSON *items = cJSON_CreateArray();
    int code = CLIENT_OK;
    if (servers_read(&s, &err) != STATUS_OK) {
        code = client_fail(c, NULL, &err);
    } else {
        enum status status = servers_find(&s, servers_word(o), &url, &in_use, &err);
        if (status == STATUS_OK && !in_use)
            cJSON_AddItemToArray(items, describe(NULL, url, true));
        for (size_t i = 0; i < s.count; i++)
            cJSON_AddItemToArray(items, describe(&s.entry[i], s.entry[i].url, &s.entry[i] == in_use));
        if (c->json)
            client_print_json(c, items);
        else
            print_servers(c, items);
        if (s.count == 0 && s.path)
            client_note(c, "no server has a name yet; names are read from %s (`unbake servers --help`)", s.path);
        if (status != STATUS_OK)
            code = client_fail(c, NULL, &err);
    }
    cJSON_Delete(items);
    servers_release(&s);
    return code;
}
