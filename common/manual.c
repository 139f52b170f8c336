/* manual.c -- see manual.h. A completion is a shell function around two `case`s: words by command,
 * values by the word before the cursor. zsh runs bash's by its own bashcompinit. */
#include "common/manual.h"

#include <ctype.h>
#include <string.h>

/* --- manual pages -------------------------------------------------------------------------- */

/* Line by line: a line must not begin with a dot or an apostrophe, and \ - mean something. */
static void put(FILE *out, const char *text, size_t length) {
    bool at_start = true;
    for (size_t i = 0; i < length; i++) {
        if (at_start && (text[i] == '.' || text[i] == '\''))
            fputs("\\&", out);
        if (text[i] == '\\')
            fputs("\\e", out);
        else if (text[i] == '-')
            fputs("\\-", out);
        else
            fputc(text[i], out);
        at_start = text[i] == '\n';
    }
}

static void put_all(FILE *out, const char *text) { put(out, text, strlen(text)); }

void manual_head(FILE *out, const char *title, int section, const char *name, const char *summary) {
    fprintf(out, ".TH %s %d \"\" \"unbake\" \"unbake\"\n.SH NAME\n", title, section);
    put_all(out, name);
    fputs(" \\- ", out);
    put_all(out, summary);
    fputs("\n", out);
}

void manual_section(FILE *out, const char *title) { fprintf(out, ".SH %s\n", title); }

void manual_subsection(FILE *out, const char *name, const char *arguments) {
    fputs(".SS \"", out);
    put_all(out, name);
    fputs(*arguments ? " " : "", out);
    put_all(out, arguments);
    fputs("\"\n", out);
}

void manual_synopsis(FILE *out, const char *program, const char *name, const char *arguments, bool has_options) {
    fputs(".B ", out);
    put_all(out, program);
    fputs(*name ? " " : "", out);
    put_all(out, name);
    fputs("\n", out);
    if (*arguments) {
        put_all(out, arguments);
        fputs("\n", out);
    }
    fputs(has_options ? "[OPTION]...\n.br\n" : ".br\n", out);
}

void manual_text(FILE *out, const char *text) {
    if (!*text)
        return;
    fputs(".PP\n", out);
    put_all(out, text);
}

void manual_sentence(FILE *out, const char *text) {
    fputs(".PP\n", out);
    fputc(toupper((unsigned char)text[0]), out);
    put_all(out, text + 1);
    fputs(".\n", out);
}

void manual_item(FILE *out, const char *word, const char *value, const char *text) {
    fputs(".TP\n\\fB", out);
    put_all(out, word);
    fputs("\\fR", out);
    if (value) {
        fputs(" \\fI", out);
        put_all(out, value);
        fputs("\\fR", out);
    }
    fputs("\n", out);
    put_all(out, text);
    fputs("\n", out);
}

void manual_options(FILE *out, const struct command_option *table, option_help *help_of) {
    for (; table && table->name; table++) {
        char word[64];
        if (table->letter)
            snprintf(word, sizeof word, "-%c, --%s", table->letter, table->name);
        else
            snprintf(word, sizeof word, "--%s", table->name);
        manual_item(out, word, table->value, table->help ? table->help : help_of(table));
    }
}

void manual_example(FILE *out, const char *lines) {
    if (!*lines)
        return;
    fputs(".PP\n.nf\n", out);
    put_all(out, lines);
    fputs(".fi\n", out);
}

/* --- completions --------------------------------------------------------------------------- */

void completion_begin(FILE *out, const char *program, bool zsh) {
    if (zsh)
        fprintf(out, "#compdef %s\nautoload -U +X bashcompinit && bashcompinit\n", program);
    fprintf(out,
            "_%s() {\n"
            "    local at=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} command= words=\n"
            "    [ \"$COMP_CWORD\" -gt 1 ] && command=${COMP_WORDS[1]}\n"
            "    case $command in\n",
            program);
}

void completion_words(FILE *out, const char *pattern) { fprintf(out, "    %s) words=\"", pattern); }

void completion_word(FILE *out, const char *word, const char *after) { fprintf(out, "%s%s ", word, after); }

void completion_options(FILE *out, const struct command_option *table) {
    for (; table && table->name; table++)
        completion_word(out, "--", table->name);
}

void completion_words_end(FILE *out) { fputs("\" ;;\n", out); }

void completion_values(FILE *out) { fputs("    esac\n    case $before in\n", out); }

void completion_end(FILE *out, const char *program) {
    fprintf(out,
            "    esac\n"
            "    COMPREPLY=($(compgen -W \"$words\" -- \"$at\"))\n"
            "    [ ${#COMPREPLY[@]} -gt 0 ] || COMPREPLY=($(compgen -f -- \"$at\"))\n"
            "    case ${COMPREPLY[0]-} in *=) compopt -o nospace 2>/dev/null ;; esac\n"
            "}\ncomplete -F _%s %s\n",
            program, program);
}
