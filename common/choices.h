/* choices.h -- lists of words as tables of settings have them: "a|b|c". */
#ifndef UNBAKE_COMMON_CHOICES_H
#define UNBAKE_COMMON_CHOICES_H

#include <stddef.h>

#include "common/json.h"

/* Index of a word of `length` bytes; -1 where it is not in the list, or the list is NULL. */
int choices_index(const char *choices, const char *word, size_t length);
/* Copies the word at an index of the list, and returns the copy. */
const char *choices_word(const char *choices, int index, char *word, size_t size);
/* Adds the array "choices" to `entry`; nothing where the list is NULL or "". */
void choices_to_json(const char *choices, cJSON *entry);

#endif
