/* test_check_progress.c -- the lines of a check: facts come while it runs, each line knows more, and the last is all of
 * it. */
#include "server/data/layout.h"
#include "tests/unit/tiny_scene.h"

#define LINES_MOST 16

static cJSON *line[LINES_MOST];
static int line_count;

static void read_lines(FILE *file) {
    char *text = NULL;
    size_t room = 0;
    rewind(file);
    while (getline(&text, &room, file) > 0) {
        cJSON *one = cJSON_Parse(text);
        const char *type = cJSON_GetStringValue(cJSON_GetObjectItem(one, "type"));
        if (type && strcmp(type, "scene") == 0 && line_count < LINES_MOST)
            line[line_count++] = cJSON_DetachItemFromObject(one, "facts");
        cJSON_Delete(one);
    }
    free(text);
}

static int count_of(const cJSON *facts, const char *key) { return cJSON_GetArraySize(cJSON_GetObjectItem(facts, key)); }

int main(void) {
    tiny_scene_make("check-told");
    char *archive = layout_archive(dir), *command = mem_printf("tar -C '%s' -cf '%s' .", scene, archive);
    CHECK(system(command) == 0);
    FILE *file = tmpfile();
    CHECK(file != NULL);
    struct order order = {.dir = dir, .kind = "check", .scene_id = "x", .thread_count = 1};
    struct progress progress = {.fd = fileno(file)};
    OK(task_check(&order, &progress, &err));
    read_lines(file);
    CHECK_THAT(line_count >= 4, "%d lines", line_count);
    for (int i = 0; i < line_count; i++) {
        CHECK(cJSON_IsNumber(cJSON_GetObjectItem(line[i], "triangle_count")));
        CHECK((cJSON_GetObjectItem(line[i], "fit") != NULL) == (i > 0));
        CHECK((count_of(line[i], "table") > 0) == (i > 0));
        CHECK(i == 0 || count_of(line[i], "previews") >= count_of(line[i - 1], "previews"));
    }
    CHECK(count_of(line[1], "previews") == 0 && count_of(line[2], "previews") > 0);
    CHECK(count_of(line[line_count - 1], "previews") > count_of(line[2], "previews"));
    for (int i = 0; i < line_count; i++)
        cJSON_Delete(line[i]);
    fclose(file);
    mem_free(command);
    mem_free(archive);
    tiny_scene_remove();
    return check_result();
}
