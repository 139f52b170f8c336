/* format.c -- see format.h. */
#include "client/format.h"

#include <string.h>

#include "common/nearest.h"

const char *const format_names[] = {"text", "json", "jsonl", NULL};

static bool find(const char *word, enum client_format *format) {
    for (size_t i = 0; format_names[i]; i++)
        if (strcmp(format_names[i], word) == 0) {
            *format = (enum client_format)i;
            return true;
        }
    return false;
}

enum status format_read(const struct options *o, enum client_format *format, struct error *err) {
    const char *word = options_text(o, "format", NULL);
    bool json = options_flag(o, "json");
    struct nearest nearest;
    *format = json ? FORMAT_JSON : FORMAT_TEXT;
    if (!word)
        return STATUS_OK;
    if (!find(word, format)) {
        nearest_init(&nearest, word);
        for (size_t i = 0; format_names[i]; i++)
            nearest_offer(&nearest, format_names[i]);
        error_set(err, STATUS_INPUT, "unknown format \"%.60s\"", word);
        return nearest.best ? error_hint(err, "did you mean %s?", nearest.best)
                            : error_hint(err, "text, json or jsonl");
    }
    return json && *format == FORMAT_TEXT ? error_set(err, STATUS_INPUT, "--json and --format text exclude each other")
                                          : STATUS_OK;
}

enum client_format format_guess(int argc, char *const *argv) {
    enum client_format format = FORMAT_TEXT;
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++) {
        const char *word = argv[i];
        if (strcmp(word, "--json") == 0)
            return FORMAT_JSON;
        if (strncmp(word, "--format=", 9) == 0)
            find(word + 9, &format);
        else if ((strcmp(word, "--format") == 0 || strcmp(word, "-o") == 0) && i + 1 < argc)
            find(argv[i + 1], &format);
        else if (strncmp(word, "-o", 2) == 0)
            find(word + 2, &format);
    }
    return format;
}
