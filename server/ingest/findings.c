/* findings.c -- see findings.h. */
#include "server/ingest/findings.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

void findings_release(struct findings *f) {
    for (size_t i = 0; i < f->warning_count && i < FINDINGS_MAX; i++)
        mem_free(f->warning[i]);
    mem_free(f->warning);
    *f = (struct findings){0};
}

/* Removes the file name that readers put first; here it has its own member. */
static const char *without_name(const char *reason, const char *file) {
    size_t length = strlen(file);
    if (length == 0 || strncmp(reason, file, length) != 0)
        return reason;
    const char *rest = reason + length + strspn(reason + length, ": ");
    return reason[length] == ':' || reason[length] == ' ' ? rest : reason;
}

static void add_problem(struct findings *f, const char *file, const char *reason, const char *hint) {
    if (f->problem_count++ >= FINDINGS_MAX)
        return;
    cJSON *problem = cJSON_CreateObject();
    json_add_string(problem, "file", file);
    json_add_string(problem, "reason", without_name(reason, file));
    if (hint[0] != '\0')
        json_add_string(problem, "hint", hint);
    cJSON_AddItemToArray(f->problems, problem);
}

void findings_problem(struct findings *f, const char *file, const char *format, ...) {
    char reason[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(reason, sizeof reason, format, args);
    va_end(args);
    add_problem(f, file, reason, "");
}

void findings_error(struct findings *f, const char *file, const struct error *err) {
    add_problem(f, file, err->message, err->hint);
}

enum status findings_settle(struct findings *f, const char *file, enum status status, const struct error *own,
                            struct error *err) {
    if (status == STATUS_OK)
        return STATUS_OK;
    if (status == STATUS_INPUT || status == STATUS_LIMIT) {
        findings_error(f, file, own);
        return STATUS_OK;
    }
    if (err)
        *err = *own;
    return status;
}

void findings_warning(struct findings *f, const char *format, ...) {
    if (f->warning_count++ >= FINDINGS_MAX)
        return;
    char sentence[600];
    va_list args;
    va_start(args, format);
    vsnprintf(sentence, sizeof sentence, format, args);
    va_end(args);
    f->warning = mem_realloc_array(f->warning, f->warning_count, sizeof *f->warning);
    f->warning[f->warning_count - 1] = mem_strdup(sentence);
}
