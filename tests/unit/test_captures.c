/* test_captures.c -- what becomes of each of the captures that people have on their disks, as captures.tsv has it.
 *
 * A line of captures.tsv is: capture, outcome, and what is named, apart by tabs. Outcomes are
 *
 *   ready    the bundle is read and its mesh and photographs fit, and nothing of the third column need be said
 *   warns    the same, with a warning that has the third column in it
 *   remedy   the bundle is read, and the check of fit says or takes the third column
 *   refused  a problem has the third column in it, in its file, reason or hint
 *
 * Who changes what becomes of one changes its line: UNBAKE_CAPTURES=print makes this test print all of them, with what
 * was said in full. */
#include "server/check/scene_check.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

#define TABLE "tests/unit/captures.tsv"

static const char *data_folder(void) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    return root ? root : "../shared/data";
}

struct outcome {
    bool is_ready;
    bool fits;  /* as it was given */
    char *said; /* warnings, or problems as JSON */
    char *source;
};

/* What the check says where the capture does not fit. */
static void say_fit(const struct scene_check *room, struct buf *said) {
    cJSON *facts = cJSON_CreateObject();
    scene_check_facts(room, facts);
    const cJSON *fit = cJSON_GetObjectItem(facts, "fit"), *evidence = cJSON_GetObjectItem(fit, "evidence");
    const char *remedy = cJSON_GetStringValue(cJSON_GetObjectItem(fit, "remedy_text"));
    if (room->fit.verdict == FIT_NO || room->was_taken)
        buf_printf(said, " | %s",
                   remedy ? remedy
                          : cJSON_GetStringValue(cJSON_GetArrayItem(evidence, cJSON_GetArraySize(evidence) - 1)));
    cJSON_Delete(facts);
}

static struct outcome load(const char *name, struct parallel *pool) {
    struct bundle_limits limits = bundle_default_limits();
    struct scene_check room;
    struct reading reading = reading_default();
    struct error err = {.message = ""};
    struct buf said;
    cJSON *problems = cJSON_CreateArray(), *problem;
    char *dir = mem_printf("%s/captures/%s", data_folder(), name);
    enum status status = scene_check(&room, dir, &reading, &limits, pool, problems, NULL, NULL, &err);
    CHECK_THAT(status == STATUS_OK || status == STATUS_INPUT, "%s: %s", name, err.message);
    buf_init(&said, 1 << 20);
    for (size_t i = 0; i < room.scene.warning_count; i++)
        buf_printf(&said, "%s%s", i ? " | " : "", room.scene.warning[i]);
    cJSON_ArrayForEach(problem, problems) {
        static const char *const members[] = {"file", "reason", "hint"};
        for (int i = 0; i < 3; i++) {
            const char *text = cJSON_GetStringValue(cJSON_GetObjectItem(problem, members[i]));
            buf_printf(&said, "%s%s", i ? ": " : problem->prev != problem ? " | " : "", text ? text : "");
        }
    }
    if (status == STATUS_OK)
        say_fit(&room, &said);
    struct outcome outcome = {status == STATUS_OK, room.fit.verdict != FIT_NO && !room.was_taken,
                              mem_strdup(buf_text(&said)), mem_strdup(room.scene.source ? room.scene.source : "")};
    CHECK_THAT(!strstr(outcome.said, dir), "%s tells where the bundle lies: %s", name, outcome.said);
    buf_release(&said);
    scene_check_release(&room);
    cJSON_Delete(problems);
    mem_free(dir);
    return outcome;
}

static void check_line(char *line, struct parallel *pool, bool prints) {
    char *name = strsep(&line, "\t"), *wanted = strsep(&line, "\t"), *part = line ? line : (char *)"";
    struct outcome o = load(name, pool);
    bool is_refused = wanted && strcmp(wanted, "refused") == 0, has_remedy = wanted && strcmp(wanted, "remedy") == 0,
         must_say = is_refused || has_remedy || (wanted && strcmp(wanted, "warns") == 0);
    if (prints)
        printf("%-28s %-8s %-16s %s\n", name, o.is_ready ? "ready" : "refused", o.source, o.said);
    CHECK_THAT(o.is_ready == !is_refused, "%s is %s: %s", name, o.is_ready ? "ready" : "refused", o.said);
    CHECK_THAT(is_refused || o.fits == !has_remedy, "%s: mesh and photographs %s: %s", name,
               o.fits ? "fit" : "do not fit", o.said);
    if (must_say)
        CHECK_THAT(part[0] && strstr(o.said, part), "%s does not say \"%s\": %s", name, part, o.said);
    else if (part[0] && strcmp(wanted, "ready") == 0)
        CHECK_THAT(!strstr(o.said, part), "%s says \"%s\": %s", name, part, o.said);
    mem_free(o.said);
    mem_free(o.source);
}

int main(void) {
    struct buf table;
    struct error err = {.message = ""};
    char *captures = mem_printf("%s/captures", data_folder()), **names;
    const char *prints = getenv("UNBAKE_CAPTURES");
    size_t name_count, line_count = 0, folder_count = 0;
    if (access(captures, R_OK) != 0)
        CHECK_SKIP("no test data at %s", captures);
    struct parallel *pool = parallel_new(2);
    buf_init(&table, 1 << 20);
    CHECK_THAT(file_read(TABLE, &table, &err) == STATUS_OK, "%s", err.message);
    char *text = mem_strdup(buf_text(&table)), *rest = text, *line;
    while ((line = strsep(&rest, "\n")) != NULL) {
        if (line[0] == '\0' || line[0] == '#')
            continue;
        line_count++;
        check_line(line, pool, prints != NULL);
    }
    CHECK(file_list(captures, &names, &name_count, &err) == STATUS_OK);
    for (size_t i = 0; i < name_count; i++)
        folder_count += !strstr(names[i], ".md");
    CHECK_THAT(line_count == folder_count, "%zu lines for %zu captures", line_count, folder_count);
    file_free_names(names, name_count);
    mem_free(text);
    buf_release(&table);
    parallel_free(pool);
    mem_free(captures);
    return check_result();
}
