/* findings.c -- see findings.h. */
#include "client/findings.h"

#include <string.h>

#include "common/mem.h"
#include "common/reading.h"

static const cJSON *facts_of(const cJSON *scene) { return cJSON_GetObjectItemCaseSensitive(scene, "facts"); }

static const cJSON *fit_of(const cJSON *scene) { return cJSON_GetObjectItemCaseSensitive(facts_of(scene), "fit"); }

const char *findings_fit(const cJSON *scene) { return member_text(fit_of(scene), "verdict"); }

/* "  first: second" with `first` coloured, made harmless. */
static void print_line(struct client *c, FILE *out, enum colour colour, const char *first, const char *second) {
    const struct terminal *t = out == c->out.out ? &c->out : &c->err;
    struct buf line;
    buf_init(&line, 1 << 16);
    buf_puts(&line, terminal_colour(t, colour));
    terminal_clean(&line, first);
    buf_puts(&line, terminal_colour(t, COLOUR_NONE));
    buf_puts(&line, *first && *second ? ": " : "");
    terminal_clean(&line, second);
    fprintf(out, "  %s\n", buf_text(&line));
    buf_release(&line);
}

static void print_problems(struct client *c, FILE *out, const cJSON *scene) {
    const cJSON *problem;
    cJSON_ArrayForEach(problem, member_items(scene, "problems")) {
        const char *file = member_text(problem, "file"), *hint = member_text(problem, "hint");
        print_line(c, out, COLOUR_RED, *file ? file : "problem", member_text(problem, "reason"));
        if (*hint)
            print_line(c, out, COLOUR_DIM, "    hint", hint);
    }
}

static void print_warnings(struct client *c, FILE *out, const cJSON *scene) {
    const cJSON *warning;
    cJSON_ArrayForEach(warning, member_items(facts_of(scene), "warnings")) {
        const char *text = cJSON_GetStringValue(warning);
        print_line(c, out, COLOUR_YELLOW, "warning", text ? text : "");
    }
}

static void print_evidence(struct client *c, FILE *out, const cJSON *scene) {
    const cJSON *item, *fit = fit_of(scene);
    cJSON_ArrayForEach(item, member_items(fit, "evidence")) {
        const char *text = cJSON_GetStringValue(item);
        print_line(c, out, COLOUR_NONE, "", text ? text : "");
    }
}

/* What would mend it, as a command; or that it was done. */
static void print_remedy(struct client *c, FILE *out, const cJSON *scene) {
    const cJSON *fit = fit_of(scene), *remedy = cJSON_GetObjectItemCaseSensitive(fit, "remedy");
    const char *text = member_text(fit, "remedy_text");
    if (!cJSON_IsObject(remedy) && !*text)
        return;
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(fit, "taken"))) {
        print_line(c, out, COLOUR_YELLOW, "applied", text);
        print_line(c, out, COLOUR_NONE, "", "nothing is to be done: jobs read the room so");
        return;
    }
    print_line(c, out, COLOUR_YELLOW, "remedy", text);
    if (!cJSON_IsObject(remedy))
        return;
    char *words = reading_words(remedy);
    char *command = mem_printf("unbake scenes set %.12s %s", member_text(scene, "id"), words);
    print_line(c, out, COLOUR_NONE, "", command);
    mem_free(command);
    mem_free(words);
}

static void print_reading(struct client *c, const cJSON *scene) {
    const cJSON *found = cJSON_GetObjectItemCaseSensitive(facts_of(scene), "reading");
    char *words = reading_words(cJSON_IsObject(found) ? found : cJSON_GetObjectItemCaseSensitive(scene, "reading"));
    field_print(c, "read with", words);
    mem_free(words);
}

void findings_print(struct client *c, const cJSON *scene) {
    static const enum colour colours[] = {COLOUR_GREEN, COLOUR_YELLOW, COLOUR_RED};
    static const char *const verdicts[] = {"yes", "doubtful", "no"};
    const char *fit = findings_fit(scene);
    const cJSON *row;
    cJSON_ArrayForEach(row, member_items(facts_of(scene), "table"))
        field_print(c, member_text(row, "label"), member_text(row, "value"));
    print_reading(c, scene);
    for (size_t i = 0; i < sizeof verdicts / sizeof *verdicts; i++)
        if (strcmp(fit, verdicts[i]) == 0)
            fprintf(c->out.out, "%s%-16s%s %s%s%s\n", terminal_colour(&c->out, COLOUR_DIM), "fit",
                    terminal_colour(&c->out, COLOUR_NONE), terminal_colour(&c->out, colours[i]), fit,
                    terminal_colour(&c->out, COLOUR_NONE));
    print_evidence(c, c->out.out, scene);
    print_remedy(c, c->out.out, scene);
    print_warnings(c, c->out.out, scene);
    print_problems(c, c->out.out, scene);
}

void findings_print_faults(struct client *c, const cJSON *scene) {
    print_warnings(c, c->out.out, scene);
    print_problems(c, c->out.out, scene);
}

void findings_note(struct client *c, const cJSON *scene) {
    const cJSON *reading = cJSON_GetObjectItemCaseSensitive(scene, "reading");
    const char *fit = findings_fit(scene);
    if (c->quiet || c->json)
        return;
    fflush(stdout);
    if (cJSON_GetArraySize(reading) > 0) {
        char *words = reading_words(reading);
        client_note(c, "the scene is read with %s", words);
        mem_free(words);
    }
    print_warnings(c, stderr, scene);
    if (strcmp(fit, "doubtful") == 0) {
        client_note(c, "whether mesh and photographs fit is in doubt");
        print_evidence(c, stderr, scene);
    }
    if (*fit)
        print_remedy(c, stderr, scene);
    print_problems(c, stderr, scene);
}

void findings_add(cJSON *object, const cJSON *scene) {
    const cJSON *warnings = member_items(facts_of(scene), "warnings"), *problems = member_items(scene, "problems");
    if (cJSON_GetArraySize(warnings) > 0)
        json_add(object, "warnings", cJSON_Duplicate(warnings, true));
    if (cJSON_GetArraySize(problems) > 0)
        json_add(object, "problems", cJSON_Duplicate(problems, true));
}
