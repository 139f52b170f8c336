/* check_command.c -- see check_command.h. */
#include "server/check/check_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/machine.h"
#include "common/mem.h"
#include "common/settings.h"
#include "server/check/check_pictures.h"
#include "server/check/check_table.h"
#include "server/ingest/facts.h"
#include "server/ingest/pixels.h"

const struct command_option check_flags[] = {
    {"scene-set", 0, OPTION_TEXT, "KEY=VALUE",
     "how the bundle is to be read: transforms, mesh, axes, mesh_axes, scale, shift, coordinates, lens, distortion, "
     "exposures"},
    {"set", 0, OPTION_TEXT, "NAME=VALUE", "a setting of the job that memory and time are estimated for"},
    {"pictures", 0, OPTION_TEXT, "DIR", "draw the mesh's edges over photographs, a plan, and exposures there"},
    {"json", 0, OPTION_FLAG, NULL, "print the facts as JSON"},
    {"threads", 0, OPTION_TEXT, "N", "0: one per processor (0)"},
    COMMAND_HELP_FLAG,
    {0},
};

/* The values of a flag that may be given several times, as an object; the caller's. */
static enum status collect(const struct options *a, const char *flag,
                           enum status (*parse)(const char *, cJSON *, struct error *), cJSON **object,
                           struct error *err) {
    enum status status = STATUS_OK;
    *object = cJSON_CreateObject();
    for (size_t i = 0; i < a->given_count && status == STATUS_OK; i++)
        if (strcmp(a->given[i].option->name, flag) == 0)
            status = parse(a->given[i].text, *object, err);
    return status;
}

static const char *text_of(const cJSON *object, const char *key) {
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
    return text ? text : "";
}

static void print_list(const char *title, const cJSON *list) {
    const cJSON *item;
    cJSON_ArrayForEach(item, list)
        printf("%s%s\n", title, cJSON_GetStringValue(item));
}

static void print_facts(const cJSON *facts) {
    const cJSON *fit = cJSON_GetObjectItemCaseSensitive(facts, "fit"), *row;
    cJSON_ArrayForEach(row, cJSON_GetObjectItemCaseSensitive(facts, "table"))
        printf("  %-18s %s\n", text_of(row, "label"), text_of(row, "value"));
    print_list("warning: ", cJSON_GetObjectItemCaseSensitive(facts, "warnings"));
    printf("fit: %s\n", text_of(fit, "verdict"));
    print_list("  ", cJSON_GetObjectItemCaseSensitive(fit, "evidence"));
    if (*text_of(fit, "remedy_text"))
        printf("%s: %s\n", cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(fit, "taken")) ? "applied" : "remedy",
               text_of(fit, "remedy_text"));
}

static void print_problems(const cJSON *problems) {
    const cJSON *problem;
    cJSON_ArrayForEach(problem, problems) {
        const char *hint = text_of(problem, "hint");
        printf("problem: %s: %s%s%s\n", text_of(problem, "file"), text_of(problem, "reason"), *hint ? "; " : "", hint);
    }
}

/* What is wrong, and what was noticed before: why frames were left out, for example. */
static void print_refusal(const struct scene_check *room, const cJSON *problems) {
    cJSON *warnings = facts_warnings(&room->scene);
    print_list("warning: ", warnings);
    print_problems(problems);
    cJSON_Delete(warnings);
}

static void print_json(const cJSON *json) {
    char *text = json_page(json);
    puts(text);
    mem_free(text);
}

/* Everything that is known of the room; the caller's. */
static enum status find_facts(const struct options *a, const struct scene_check *room, const struct settings *settings,
                              struct parallel *pool, cJSON **facts, struct error *err) {
    const char *dir = options_text(a, "pictures", NULL);
    double begin = clock_sec();
    *facts = facts_of(&room->scene);
    scene_check_facts(room, *facts);
    check_table_add(*facts, room, settings, (double)machine_memory_available(""), pool);
    enum status status = dir ? file_make_dirs(dir, err) : STATUS_OK;
    if (dir && status == STATUS_OK)
        status = check_pictures_write(room, dir, pool, cJSON_AddArrayToObject(*facts, "previews"), NULL, NULL, err);
    json_add_number(*facts, "load_sec", room->load_sec);
    json_add_number(*facts, "fit_sec", room->fit_sec);
    json_add_number(*facts, "pictures_sec", clock_sec() - begin);
    return status;
}

/* Checks the room and prints what was found. */
static enum status check(const struct options *a, const struct reading *reading, const struct settings *settings,
                         struct parallel *pool, bool *fits, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    struct spill *pixels = pixels_new_temporary();
    struct scene_check room;
    cJSON *problems = cJSON_CreateArray(), *facts = NULL;
    bool as_json = options_flag(a, "json");
    pixels_use(pixels, &limits);
    enum status status = scene_check(&room, a->word[0], reading, &limits, pool, problems, NULL, NULL, err);
    *fits = status == STATUS_OK && room.fit.verdict != FIT_NO;
    if (status == STATUS_OK) {
        status = find_facts(a, &room, settings, pool, &facts, err);
    } else if (as_json) {
        facts = cJSON_CreateObject();
        json_add(facts, "problems", cJSON_Duplicate(problems, true));
        json_add(facts, "warnings", facts_warnings(&room.scene));
    }
    if (as_json)
        print_json(facts);
    else if (facts)
        print_facts(facts);
    else
        print_refusal(&room, problems);
    cJSON_Delete(facts);
    cJSON_Delete(problems);
    scene_check_release(&room);
    spill_free(pixels);
    return status;
}

int check_command(int argc, char **argv) {
    uint32_t threads = 0;
    const struct number_flag numbers[] = {{"threads", 0, 1024, .count = &threads}};
    struct options a;
    struct error err;
    struct reading reading = reading_default();
    struct settings settings;
    cJSON *given = NULL, *wanted = NULL;
    bool fits = false;
    int code = arguments_begin(&a, argc, argv, check_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    enum status status = collect(&a, "scene-set", reading_parse_assignment, &given, &err);
    if (status == STATUS_OK)
        status = collect(&a, "set", settings_parse_assignment, &wanted, &err);
    if (status == STATUS_OK)
        status = reading_parse(given, &reading, &err);
    settings_init(&settings);
    if (status == STATUS_OK)
        status = settings_apply(&settings, wanted, NULL, &err);
    bool is_usage = status != STATUS_OK;
    if (status == STATUS_OK) {
        struct parallel *pool = parallel_new((int)threads);
        status = check(&a, &reading, &settings, pool, &fits, &err);
        parallel_free(pool);
    }
    if (status != STATUS_OK)
        fprintf(stderr, "unbaked check: %s\n", err.message);
    reading_release(&reading);
    cJSON_Delete(given);
    cJSON_Delete(wanted);
    settings_release(&settings);
    options_release(&a);
    return is_usage ? EXIT_USAGE : status == STATUS_OK && fits ? EXIT_SUCCESS : EXIT_FAILURE;
}
