/* scenes.c -- `scenes`: what was uploaded. */
#include <string.h>

#include "client/commands.h"
#include "client/keeping.h"
#include "common/nearest.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/protocol.h"

const struct option scenes_options[] = {
    {"limit", 'n', OPTION_WHOLE, "N", "list at most so many (20); 0: all"},
    {"dry-run", 0, OPTION_FLAG, NULL, "with rm: only say what would be removed"},
    KEEPING_OPTIONS,
    {0},
};

static void print_scenes(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"scene", "state", ">size", ">age", ">expires", "name"};
    struct table t;
    const cJSON *scene;
    table_init(&t, 6, headings);
    cJSON_ArrayForEach(scene, items) {
        char size[16], age[16], expires[16];
        const char *state = member_text(scene, "state");
        format_bytes(size, member_number(scene, "bytes", 0.0));
        format_duration(age, time_since(member_text(scene, "created_at")));
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%.12s", member_text(scene, "id"));
        table_set(&t, 1, state_colour(state), "%s", state);
        table_set(&t, 2, COLOUR_NONE, "%s", size);
        table_set(&t, 3, COLOUR_NONE, "%s", age);
        keeping_text(expires, scene);
        table_set(&t, 4, COLOUR_NONE, "%s", expires);
        table_set(&t, 5, COLOUR_NONE, "%s", member_text(scene, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

static int list_scenes(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    cJSON *items = NULL;
    int code = CLIENT_OK;
    long limit = options_whole(o, "limit", 20);
    reply_init(&reply);
    enum status status =
        limit < 0 ? error_set(&err, STATUS_INPUT, "--limit takes 0 or more, not %ld", limit)
                  : client_list(c, "/v1/scenes", (size_t)limit, &items, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, items);
    else if (c->quiet) {
        const cJSON *scene;
        cJSON_ArrayForEach(scene, items) printf("%s\n", member_text(scene, "id"));
    } else if (cJSON_GetArraySize(items) == 0)
        client_note(c, "no scenes");
    else
        print_scenes(c, items);
    cJSON_Delete(items);
    reply_release(&reply);
    return code;
}

void scenes_print_problems(struct client *c, const cJSON *scene, FILE *out) {
    const cJSON *problem;
    cJSON_ArrayForEach(problem, member_items(scene, "problems")) {
        struct buf line;
        buf_init(&line, 1 << 16);
        buf_puts(&line, terminal_colour(&c->out, COLOUR_YELLOW));
        terminal_clean(&line, member_text(problem, "file"));
        buf_puts(&line, terminal_colour(&c->out, COLOUR_NONE));
        buf_puts(&line, *member_text(problem, "file") ? ": " : "");
        terminal_clean(&line, member_text(problem, "reason"));
        fprintf(out, "  %s\n", buf_text(&line));
        buf_release(&line);
    }
}

static void print_scene(struct client *c, const cJSON *scene) {
    static const char *const headings[] = {"scene", ""};
    struct table t;
    char size[16];
    const cJSON *fact;
    const char *state = member_text(scene, "state");
    table_init(&t, 2, headings);
    table_set(&t, 1, COLOUR_NONE, "%s", member_text(scene, "id"));
    table_row(&t);
    table_set(&t, 0, COLOUR_DIM, "name");
    table_set(&t, 1, COLOUR_NONE, "%s", member_text(scene, "name"));
    table_row(&t);
    table_set(&t, 0, COLOUR_DIM, "state");
    table_set(&t, 1, state_colour(state), "%s", state);
    table_row(&t);
    format_bytes(size, member_number(scene, "bytes", 0.0));
    table_set(&t, 0, COLOUR_DIM, "size");
    table_set(&t, 1, COLOUR_NONE, "%s", size);
    table_row(&t);
    table_set(&t, 0, COLOUR_DIM, "created");
    table_set(&t, 1, COLOUR_NONE, "%s", member_text(scene, "created_at"));
    table_row(&t);
    table_set(&t, 0, COLOUR_DIM, "expires");
    table_set(&t, 1, COLOUR_NONE, "%s", cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(scene, "pinned"))
                                            ? "never: pinned" : member_text(scene, "expires_at"));
    cJSON_ArrayForEach(fact, cJSON_GetObjectItemCaseSensitive(scene, "facts")) {
        char *text = cJSON_IsString(fact) ? mem_strdup(fact->valuestring) : json_text(fact);
        table_row(&t);
        table_set(&t, 0, COLOUR_DIM, "%s", member_name(fact));
        table_set(&t, 1, COLOUR_NONE, "%s", text);
        mem_free(text);
    }
    table_print(&t, &c->out);
    table_release(&t);
    scenes_print_problems(c, scene, c->out.out);
}

enum verb { VERB_SHOW, VERB_KEEP, VERB_REMOVE, VERB_COUNT };
static const char *const verbs[VERB_COUNT] = {"show", "keep", "rm"};

static void print_removed(struct client *c, const char *id, const cJSON *reply, bool dry_run) {
    char size[16];
    cJSON *value = dry_run ? cJSON_Duplicate(reply, true) : cJSON_CreateObject();
    json_add_string(value, "id", id);
    json_add_bool(value, "removed", !dry_run);
    format_bytes(size, member_number(value, "bytes", 0.0));
    if (c->json)
        client_print_json(c, value);
    else if (!c->quiet && dry_run)
        printf("scene %.12s: %.0f files, %s\n", id, member_number(value, "files", 0.0), size);
    else if (!c->quiet)
        printf("scene %.12s removed\n", id);
    cJSON_Delete(value);
}

/* GET, PATCH with `body` or DELETE of one scene. */
static int one_scene(struct client *c, const char *id, enum verb verb, bool dry_run, const cJSON *body) {
    static const char *const methods[VERB_COUNT] = {NULL, "PATCH", "DELETE"};
    struct reply reply;
    struct error err;
    struct buf path;
    int code = CLIENT_OK;
    reply_init(&reply);
    buf_init(&path, 4096);
    buf_puts(&path, "/v1/scenes/");
    request_escape(&path, id, false);
    buf_puts(&path, dry_run ? "?dry_run=1" : "");
    struct request_call call = {.path = buf_text(&path), .method = methods[verb], .body = body};
    enum status status = request_run(c->request, &call, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (verb == VERB_REMOVE)
        print_removed(c, id, reply.json, dry_run);
    else if (c->json)
        client_print_json(c, reply.json);
    else if (verb == VERB_SHOW || !c->quiet)
        print_scene(c, reply.json);
    buf_release(&path);
    reply_release(&reply);
    return code;
}

/* What the words ask for; VERB_COUNT with the error set where they make no sense. */
static enum verb read_verb(const struct options *o, struct error *err) {
    struct nearest nearest;
    nearest_init(&nearest, o->word[0]);
    nearest_offer(&nearest, "list");
    for (int v = 0; v < VERB_COUNT; v++) {
        nearest_offer(&nearest, verbs[v]);
        if (strcmp(o->word[0], verbs[v]) != 0)
            continue;
        if (o->word_count > 1)
            return (enum verb)v;
        error_set(err, STATUS_INPUT, "scenes %s takes SCENE..., which is missing", verbs[v]);
        return VERB_COUNT;
    }
    error_set(err, STATUS_INPUT, "scenes takes nothing, `show SCENE`, `keep SCENE` or `rm SCENE`, not \"%.100s\"",
              o->word[0]);
    if (nearest.best)
        error_hint(err, "did you mean `unbake scenes %s`?", nearest.best);
    return VERB_COUNT;
}

int scenes_run(struct client *c, const struct options *o) {
    struct error err;
    bool dry_run = options_flag(o, "dry-run");
    if (o->word_count == 0 || (strcmp(o->word[0], "list") == 0 && o->word_count == 1))
        return list_scenes(c, o);
    enum verb verb = read_verb(o, &err);
    cJSON *body = cJSON_CreateObject();
    enum status status = verb == VERB_COUNT ? STATUS_INPUT : keeping_describe(o, body, &err);
    if (status == STATUS_OK && (verb == VERB_KEEP) != (body->child != NULL))
        status = error_set(&err, STATUS_INPUT, verb == VERB_KEEP ? "scenes keep takes --pin, --unpin or --keep-days N"
                           : "--pin, --unpin and --keep-days go with `scenes keep`");
    if (status == STATUS_OK && dry_run && verb != VERB_REMOVE)
        status = error_set(&err, STATUS_INPUT, "--dry-run goes with `scenes rm`");
    int first = status == STATUS_OK ? CLIENT_OK : client_fail(c, NULL, &err);
    for (size_t i = 1; i < o->word_count && status == STATUS_OK; i++) {
        int code = one_scene(c, o->word[i], verb, dry_run, verb == VERB_KEEP ? body : NULL);
        if (first == CLIENT_OK)
            first = code;
    }
    cJSON_Delete(body);
    return first;
}
