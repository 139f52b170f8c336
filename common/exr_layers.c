/* exr_layers.c -- see exr_layers.h. Names of layers: Technical Introduction to OpenEXR, "Layers": all before the last
 * dot of a channel's name. */
#include "common/exr_layers.h"

#include <stdbool.h>
#include <string.h>
#include <strings.h>

/* Length of the layer in a channel's name, with its dot. */
static size_t layer_length(const char *name) {
    const char *dot = strrchr(name, '.');
    return dot ? (size_t)(dot - name) + 1 : 0;
}

/* The channel of the same layer with this base name (one letter, in either case; `long_name` as some tools have it). */
static int sibling(const exr_attr_chlist_t *list, int red, char letter) {
    static const char *const longer[] = {"red", "green", "blue", "alpha"};
    static const char letters[] = "RGBA";
    const char *of = list->entries[red].name.str, *full = longer[strchr(letters, letter) - letters];
    size_t length = layer_length(of);
    for (int i = 0; i < list->num_channels; i++) {
        const char *name = list->entries[i].name.str;
        if (strncmp(name, of, length) != 0 || layer_length(name) != length)
            continue;
        const char *base = name + length;
        if ((strncasecmp(base, &letter, 1) == 0 && base[1] == '\0') || strcasecmp(base, full) == 0)
            return i;
    }
    return -1;
}

/* Whether the last component of a layer's name, of `length` characters, is one that renderers give to the picture. */
static bool is_picture(const char *layer, size_t length) {
    static const char *const names[] = {"Combined", "Composite", "beauty", "rgba", "rgb", "color", "colour", "image"};
    size_t start = length;
    while (start > 0 && layer[start - 1] != '.')
        start--;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strlen(names[i]) == length - start && strncasecmp(layer + start, names[i], length - start) == 0)
            return true;
    return false;
}

/* 0: the file's own R, G, B; 1: Blender's compositor's; 2: a layer of a known name; 3: R, G, B of a part of another
 * name; 4: another layer. */
static int rank_of(const char *name, const char *part) {
    size_t length = layer_length(name);
    if (length == 0 && (!part || part[0] == '\0'))
        return 0;
    if (strncasecmp(name, "Composite.", 10) == 0 || (part && strncasecmp(part, "Composite", 9) == 0))
        return 1;
    if (length > 0)
        return is_picture(name, length - 1) ? 2 : 4;
    return is_picture(part, strlen(part)) ? 2 : 3;
}

void exr_find_colors(const exr_attr_chlist_t *list, const char *part, struct exr_colors *colors) {
    *colors = (struct exr_colors){{-1, -1, -1, -1}, EXR_NO_COLOR, -1};
    for (int i = 0; i < list->num_channels; i++) {
        if (sibling(list, i, 'R') != i)
            continue;
        int green = sibling(list, i, 'G'), blue = sibling(list, i, 'B');
        int rank = rank_of(list->entries[i].name.str, part);
        if (green < 0 || blue < 0 || rank > colors->rank)
            continue;
        bool is_tie = rank == colors->rank;
        if (is_tie)
            colors->rival = i;
        else
            *colors = (struct exr_colors){{i, green, blue, sibling(list, i, 'A')}, rank, -1};
    }
}
