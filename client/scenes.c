/* scenes.c -- `scenes`: what was uploaded. */
#include <string.h>

#include "client/commands.h"
#include "common/nearest.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/protocol.h"

const struct option scenes_options[] = {
    {"limit", 'n', OPTION_WHOLE, "N", "list at most so many (20); 0: all"},
    {0},
};

static void print_scenes(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"scene", "state", ">size", ">age", "name"};
    struct table t;
    const cJSON *scene;
    table_init(&t, 5, headings);
    cJSON_ArrayForEach(scene, items) {
        char size[16], age[16];
        const char *state = member_text(scene, "state");
        format_bytes(size, member_number(scene, "bytes", 0.0));
        format_duration(age, time_since(member_text(scene, "created_at")));
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%.12s", member_text(scene, "id"));
        table_set(&t, 1, state_colour(state), "%s", state);
        table_set(&t, 2, COLOUR_NONE, "%s", size);
        table_set(&t, 3, COLOUR_NONE, "%s", age);
        table_set(&t, 4, COLOUR_NONE, "%s", member_text(scene, "name"));
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
    cJSON_ArrayForEach(fact, cJSON_GetObjectItemCaseSensitive(scene, "facts")) {
        char *text = cJSON_IsString(fact) ? mem_strdup(fact->valuestring) : json_text(fact);
        table_row(&t);
        table_set(&t, 0, COLOUR_DIM, "%s", fact->string);
        table_set(&t, 1, COLOUR_NONE, "%s", text);
        mem_free(text);
    }
    table_print(&t, &c->out);
    table_release(&t);
    scenes_print_problems(c, scene, c->out.out);
}

/* GET or DELETE of one scene. */
static int one_scene(struct client *c, const char *id, bool remove) {
    struct reply reply;
    struct error err;
    struct buf path;
    int code = CLIENT_OK;
    reply_init(&reply);
    buf_init(&path, 4096);
    buf_puts(&path, "/v1/scenes/");
    request_escape(&path, id, false);
    struct request_call call = {.path = buf_text(&path), .method = remove ? "DELETE" : NULL};
    enum status status = request_run(c->request, &call, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (remove && c->json) {
        cJSON *removed = cJSON_CreateObject();
        json_add_string(removed, "id", id);
        json_add_bool(removed, "removed", true);
        client_print_json(c, removed);
        cJSON_Delete(removed);
    } else if (remove && !c->quiet)
        printf("scene %.12s removed\n", id);
    else if (!remove && c->json)
        client_print_json(c, reply.json);
    else if (!remove)
        print_scene(c, reply.json);
    buf_release(&path);
    reply_release(&reply);
    return code;
}

int scenes_run(struct client *c, const struct options *o) {
    const char *verb = o->word_count ? o->word[0] : "list";
    bool show = strcmp(verb, "show") == 0, remove = strcmp(verb, "rm") == 0;
    if (strcmp(verb, "list") == 0 && o->word_count <= 1)
        return list_scenes(c, o);
    if ((!show && !remove) || o->word_count < 2) {
        struct error err;
        struct nearest nearest;
        nearest_init(&nearest, verb);
        nearest_offer(&nearest, "list");
        nearest_offer(&nearest, "show");
        nearest_offer(&nearest, "rm");
        if (show || remove)
            error_set(&err, STATUS_INPUT, "scenes %s takes SCENE..., which is missing", verb);
        else
            error_set(&err, STATUS_INPUT,
                      "scenes takes nothing, `show SCENE` or `rm SCENE`, not \"%.100s\"", verb);
        if (nearest.best && !show && !remove)
            error_hint(&err, "did you mean `unbake scenes %s`?", nearest.best);
        return client_fail(c, NULL, &err);
    }
    int first = CLIENT_OK;
    for (size_t i = 1; i < o->word_count; i++) {
        int code = one_scene(c, o->word[i], remove);
        if (first == CLIENT_OK)
            first = code;
    }
    return first;
}
