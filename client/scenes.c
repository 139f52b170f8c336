/* scenes.c -- `scenes`: the uploaded rooms. */
#include <string.h>

#include "client/collection.h"
#include "client/commands.h"
#include "client/retention.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/protocol.h"

static void print_scenes(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"scene", "state", ">size", ">age", ">expires", "?owner", "name"};
    struct table t;
    const cJSON *scene;
    table_init(&t, 7, headings);
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
        retention_text(expires, scene);
        table_set(&t, 4, COLOUR_NONE, "%s", expires);
        table_set(&t, 5, COLOUR_NONE, "%s", member_text(scene, "owner"));
        table_set(&t, 6, COLOUR_NONE, "%s", member_text(scene, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
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
    char size[16];
    const cJSON *fact;
    format_bytes(size, member_number(scene, "bytes", 0.0));
    field_print(c, "scene", member_text(scene, "id"));
    field_print(c, "name", member_text(scene, "name"));
    field_print(c, "owner", member_text(scene, "owner"));
    field_print(c, "state", member_text(scene, "state"));
    field_print(c, "size", size);
    retention_disk(size, scene);
    field_print(c, "on disk", size);
    field_print(c, "created", member_text(scene, "created_at"));
    field_print(c, "expires", retention_time(scene));
    cJSON_ArrayForEach(fact, cJSON_GetObjectItemCaseSensitive(scene, "facts")) {
        char *text = cJSON_IsString(fact) ? mem_strdup(fact->valuestring) : json_text(fact);
        field_print(c, member_name(fact), text);
        mem_free(text);
    }
    scenes_print_problems(c, scene, c->out.out);
}

int scenes_run(struct client *c, const struct options *o) {
    static const struct collection scenes = {"scenes", "scene", "/v1/scenes", print_scenes, print_scene};
    return collection_run(c, o, &scenes);
}
