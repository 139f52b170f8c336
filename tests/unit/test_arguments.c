/* arguments.h: flags, values and words of a command line; numbers in and out of range. */
#include "server/arguments.h"

#include <string.h>

#include "tests/check.h"

static const struct flag flags[] = {
    {"--count", "N", ""}, {"--seed", "N", ""}, {"--turn", "DEG", ""}, {"--json", NULL, ""}, {0},
};

static bool read_line(struct arguments *a, char *first, char *second, char *third) {
    char *argv[] = {"command", first, second, third, NULL};
    return arguments_read(a, first ? second ? third ? 4 : 3 : 2 : 1, argv, flags);
}

static void check_flags(void) {
    struct arguments a;
    CHECK(read_line(&a, NULL, NULL, NULL) && a.word_count == 0 && a.given_count == 0 && !arguments_have(&a, "--json"));
    CHECK(read_line(&a, "room", "--json", "out") && a.word_count == 2 && arguments_have(&a, "--json"));
    CHECK_STRING(a.words[1], "out");
    CHECK_STRING(arguments_value(&a, "--count", "none"), "none");
    CHECK(read_line(&a, "--count", "3", "--count=4"));
    CHECK_STRING(arguments_value(&a, "--count", ""), "4");
    CHECK(read_line(&a, "--turn", "-30", "room") && a.word_count == 1);
    CHECK_STRING(arguments_value(&a, "--turn", ""), "-30");
    CHECK(!read_line(&a, "--cuont", "3", NULL) && !read_line(&a, "--count", NULL, NULL));
    CHECK(!read_line(&a, "--json=1", NULL, NULL));
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
            {"--count", 2, 9, .count = &count},
            {"--seed", 0, 9007199254740991.0, .large = &seed},
            {"--turn", -360, 360, .real = &turn},
        };
        struct arguments a;
        CHECK(read_line(&a, cases[i].name, cases[i].text, NULL));
        CHECK_THAT(arguments_numbers(&a, numbers, 3) == cases[i].is_good, "%s %s", cases[i].name, cases[i].text);
        CHECK(count == (i == 0 ? 2 : i == 1 ? 9 : 7) && turn == (i == 7 ? -2.5f : 7.0f));
        CHECK(seed == (i == 9 ? 9007199254740991u : 7));
    }
}

int main(void) {
    check_flags();
    check_numbers();
    return check_result();
}
