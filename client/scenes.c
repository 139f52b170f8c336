/* scenes.c -- `scenes`: the uploaded rooms. */
#include <string.h>

#include "client/collection.h"
#include "client/commands.h"
#include "client/findings.h"
#include "client/retention.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"

static void print_scenes(struct client *c, const cJSON *items) {
    static const char *const headings[] = {"scene", "state", "?fit", "~>size", ">age", "~>expires", "~?owner", "name"};
    struct table t;
    const cJSON *scene;
    table_init(&t, 8, headings);
    cJSON_ArrayForEach(scene, items) {
        char size[16], age[16], expires[16];
        const char *state = member_text(scene, "state");
        format_bytes(size, member_number(scene, "bytes", 0.0));
        format_duration(age, time_since(member_text(scene, "created_at")));
        table_row(&t);
        table_set(&t, 0, COLOUR_NONE, "%.12s", member_text(scene, "id"));
        table_set(&t, 1, state_colour(state), "%s", state);
        table_set(&t, 2, COLOUR_NONE, "%s", findings_fit(scene));
        table_set(&t, 3, COLOUR_NONE, "%s", size);
        table_set(&t, 4, COLOUR_NONE, "%s", age);
        retention_text(expires, scene);
        table_set(&t, 5, COLOUR_NONE, "%s", expires);
        table_set(&t, 6, COLOUR_NONE, "%s", member_text(scene, "owner"));
        table_set(&t, 7, COLOUR_NONE, "%s", member_text(scene, "name"));
    }
    table_print(&t, &c->out);
    table_release(&t);
}

/* What findings_print shows in its own way. */
static bool is_finding(const char *fact) {
    static const char *const names[] = {"fit", "reading", "previews", "table", "warnings"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(fact, names[i]) == 0)
            return true;
    return false;
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
        if (is_finding(member_name(fact)))
            continue;
        char *text = cJSON_IsString(fact) ? mem_strdup(fact->valuestring) : json_text(fact);
        field_print(c, member_name(fact), text);
        mem_free(text);
    }
    findings_print(c, scene);
}

int scenes_run(struct client *c, const struct options *o) {
    if (o->word_count > 0 && strcmp(o->word[0], "set") == 0)
        return check_set_run(c, o);
    static const struct collection scenes = {"scenes", "scene", "/v1/scenes", print_scenes, print_scene, "set"};
    return collection_run(c, o, &scenes);
}
