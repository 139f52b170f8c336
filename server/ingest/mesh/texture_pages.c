/* texture_pages.c -- see texture_pages.h. */
#include "server/ingest/mesh/texture_pages.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/mesh/intern.h"
#include "server/ingest/mesh/mtl_lines.h"

/* --- names ---------------------------------------------------------------------------------- */

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

/* Whether a and b are equal where each run of digits counts as one. */
static bool differ_in_digits(const char *a, const char *b) {
    bool any = false;
    while (*a && *b) {
        if (is_digit(*a) && is_digit(*b)) {
            any = true;
            while (is_digit(*a))
                a++;
            while (is_digit(*b))
                b++;
        } else if (*a++ != *b++) {
            return false;
        }
    }
    return any && *a == *b;
}

bool texture_pages_are_numbered(const char *const *name, size_t count) {
    bool any = false;
    for (size_t i = 1; i < count; i++) {
        if (!differ_in_digits(name[0], name[i]))
            return false;
        any = any || strcmp(name[0], name[i]) != 0;
    }
    return any;
}

/* Length of the part before the number at the end; SIZE_MAX without a number. ".001" is Blender's mark of a copy. */
static size_t stem_of(const char *name, unsigned long *number) {
    size_t length = strlen(name), at = length;
    while (at > 0 && is_digit(name[at - 1]))
        at--;
    if (at == length || length - at > 9 || (at > 0 && name[at - 1] == '.' && length - at == 3))
        return SIZE_MAX;
    *number = strtoul(name + at, NULL, 10);
    return at;
}

static bool ends_in_word(const char *name, size_t length) {
    static const char *const words[] = {"material", "mat",  "texture", "textured", "tex",
                                        "atlas",    "page", "udim",    "map"};
    while (length > 0 && strchr("_- ", name[length - 1]))
        length--;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t own = strlen(words[i]);
        if (length >= own && strncasecmp(name + length - own, words[i], own) == 0)
            return true;
    }
    return false;
}

bool texture_pages_by_name(const char *const *name, size_t count) {
    unsigned long least = ~0ul, most = 0;
    size_t stem = 0;
    for (size_t i = 0; i < count; i++) {
        unsigned long number;
        size_t own = stem_of(name[i], &number);
        if (own == SIZE_MAX || (i > 0 && (own != stem || strncmp(name[0], name[i], stem) != 0)))
            return false;
        stem = own;
        least = number < least ? number : least;
        most = number > most ? number : most;
    }
    /* distinct, so consecutive if they fill their range */
    return count > 1 && most - least + 1 == count && ends_in_word(name[0], stem);
}

/* --- MTL ------------------------------------------------------------------------------------ */

/* A material: its picture, and its other statements one after the other. */
struct mtl_material {
    const char *name;
    char *picture, *rest; /* owned; NULL: none */
    bool found;
};

static bool is_word(const char *line, const char *word) {
    size_t length = strlen(word);
    return strncasecmp(line, word, length) == 0 && (line[length] == ' ' || line[length] == '\t');
}

/* Other pictures (normals, roughness) come in pages, too. */
static bool is_picture(const char *line) {
    return strncasecmp(line, "map_", 4) == 0 || is_word(line, "bump") || is_word(line, "norm") || is_word(line, "disp");
}

static void add_statement(struct mtl_material *m, const char *line) {
    if (is_word(line, "map_Kd")) {
        mem_free(m->picture);
        m->picture = mem_strdup(line + 7 + strspn(line + 7, " \t"));
    } else if (!is_picture(line)) {
        char *longer = mem_printf("%s%s\n", m->rest ? m->rest : "", line);
        mem_free(m->rest);
        m->rest = longer;
    }
}

static struct mtl_material *find_material(struct mtl_material *list, size_t count, const char *name) {
    for (size_t i = 0; i < count; i++)
        if (strcmp(list[i].name, name) == 0)
            return &list[i];
    return NULL;
}

static void read_mtl(const char *text, size_t length, struct mtl_material *list, size_t count) {
    struct mtl_material *current = NULL;
    const char *end = text + length;
    char *line;
    while ((line = mtl_next_line(&text, end))) {
        if (is_word(line, "newmtl")) {
            current = find_material(list, count, line + 7 + strspn(line + 7, " \t"));
            if (current)
                current->found = true;
        } else if (current && line[0] != '#' && line[0] != '\0') {
            add_statement(current, line);
        }
        mem_free(line);
    }
}

static bool is_equal(const char *a, const char *b) { return a && b ? strcmp(a, b) == 0 : a == b; }

static enum texture_pages judge(const struct mtl_material *list, size_t count) {
    const char **picture = mem_array(count, sizeof *picture);
    enum texture_pages result = TEXTURE_PAGES_YES;
    for (size_t i = 0; i < count && result != TEXTURE_PAGES_UNKNOWN; i++) {
        picture[i] = list[i].picture;
        if (!list[i].found)
            result = TEXTURE_PAGES_UNKNOWN;
        else if (!list[i].picture || !is_equal(list[0].rest, list[i].rest))
            result = TEXTURE_PAGES_NO;
    }
    if (result == TEXTURE_PAGES_YES && !texture_pages_are_numbered(picture, count))
        result = TEXTURE_PAGES_NO;
    mem_free(picture);
    return result;
}

static size_t count_pictures(const struct mtl_material *list, size_t count) {
    struct intern pictures;
    intern_init(&pictures);
    for (size_t i = 0; i < count; i++)
        if (list[i].picture)
            intern_number(&pictures, list[i].picture, strlen(list[i].picture) + 1);
    size_t found = pictures.count;
    intern_release(&pictures);
    return found;
}

enum texture_pages texture_pages_by_mtl(const char *text, size_t length, const char *const *material, size_t count,
                                        size_t *picture_count) {
    struct mtl_material *list = mem_calloc(count + 1, sizeof *list);
    for (size_t i = 0; i < count; i++)
        list[i].name = material[i];
    read_mtl(text, length, list, count);
    enum texture_pages result = count < 2 ? TEXTURE_PAGES_NO : judge(list, count);
    *picture_count = count_pictures(list, count);
    for (size_t i = 0; i < count; i++) {
        mem_free(list[i].picture);
        mem_free(list[i].rest);
    }
    mem_free(list);
    return result;
}
