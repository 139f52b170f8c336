/* choices.c -- see choices.h. */
#include "common/choices.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"

/* The word after the one at `at`, or the end of the list. */
static const char *next_word(const char *at) {
    at += strcspn(at, "|");
    return at + (*at == '|');
}

int choices_index(const char *choices, const char *word, size_t length) {
    int index = 0;
    for (const char *at = choices; at && *at; at = next_word(at), index++)
        if (strcspn(at, "|") == length && memcmp(at, word, length) == 0)
            return index;
    return -1;
}

const char *choices_word(const char *choices, int index, char *word, size_t size) {
    while (index-- > 0)
        choices = next_word(choices);
    snprintf(word, size, "%.*s", (int)strcspn(choices, "|"), choices);
    return word;
}

void choices_to_json(const char *choices, cJSON *entry) {
    cJSON *list = choices && *choices ? cJSON_AddArrayToObject(entry, "choices") : NULL;
    for (const char *at = choices; list && *at; at = next_word(at)) {
        char *word = mem_strndup(at, strcspn(at, "|"));
        cJSON_AddItemToArray(list, json_new_string(word));
        mem_free(word);
    }
}
