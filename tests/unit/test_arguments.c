/* test_arguments.c -- a command line of the daemon: options, words and where they end; numbers in and out of range. */
#include "server/arguments.h"

#include <string.h>

#include "tests/check.h"

static const struct command_option table[] = {
    {"count", 0, OPTION_TEXT, "N", ""},
    {"seed", 0, OPTION_TEXT, "N", ""},
    {"turn", 0, OPTION_TEXT, "DEG", ""},
    {"json", 0, OPTION_FLAG, NULL, ""},
    {0},
};

static bool read_line(struct options *o, char *first, char *second, char *third) {
    char *argv[] = {"command", first, second, third, NULL};
    return arguments_read(o, first ? second ? third ? 4 : 3 : 2 : 1, argv, table);
}

static void check_words(void) {
    static const struct {
        char *word[3];
        bool is_good, is_json;
        size_t words;
        const char *count, *turn;
    } cases[] = {
        {{NULL, NULL, NULL}, true, false, 0, "", ""},
        {{"room", "--json", "out"}, true, true, 2, "", ""},
        {{"--count", "3", "--count=4"}, true, false, 0, "4", ""},
        {{"--turn", "-30", "room"}, true, false, 1, "", "-30"},
        {{"--", "--json", "-x"}, true, false, 2, "", ""},
        {{"--cuont", "3", NULL}, false, false, 0, "", ""},
        {{"--count", NULL, NULL}, false, false, 0, "", ""},
        {{"--json=1", NULL, NULL}, false, false, 0, "", ""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct options o;
        bool is_good = read_line(&o, cases[i].word[0], cases[i].word[1], cases[i].word[2]);
        CHECK_THAT(is_good == cases[i].is_good && options_flag(&o, "json") == cases[i].is_json, "case %zu", i);
        CHECK_THAT(!is_good || o.word_count == cases[i].words, "case %zu: %zu words", i, o.word_count);
        CHECK_STRING(options_text(&o, "count", ""), cases[i].count);
        CHECK_STRING(options_text(&o, "turn", ""), cases[i].turn);
        options_release(&o);
    }
}

static void check_numbers(void) {
    static const struct {
        char *name, *text;
        bool is_good;
    } cases[] = {
        {"--count", "2", true},      {"--count", "9", true},
        {"--count", "1", false},     {"--count", "2.5", false},
        {"--count", "", false},      {"--count", "3x", false},
        {"--count", "nan", false},   {"--turn", "-2.5", true},
        {"--turn", "1e9999", false}, {"--seed", "9007199254740991", true},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint32_t count = 7;
        uint64_t seed = 7;
        float turn = 7.0f;
        const struct number_flag numbers[] = {
            {"count", 2, 9, .count = &count},
            {"seed", 0, 9007199254740991.0, .large = &seed},
            {"turn", -360, 360, .real = &turn},
        };
        struct options o;
        CHECK(read_line(&o, cases[i].name, cases[i].text, NULL));
        CHECK_THAT(arguments_numbers(&o, numbers, 3) == cases[i].is_good, "%s %s", cases[i].name, cases[i].text);
        CHECK(count == (i == 0 ? 2 : i == 1 ? 9 : 7) && turn == (i == 7 ? -2.5f : 7.0f));
        CHECK(seed == (i == 9 ? 9007199254740991u : 7));
        options_release(&o);
    }
}

int main(void) {
    check_words();
    check_numbers();
    return check_result();
}
