/* photo_folder.c -- see photo_folder.h. */
#include "server/ingest/source/photo_folder.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/path.h"

/* --- names ------------------------------------------------------------------------------------ */

bool photo_is_picture(const char *path) {
    static const char *const extensions[] = {"png",  "jpg", "jpeg", "exr", "hdr", "tif", "tiff", "webp", "heic", "heif",
                                             "avif", "dng", "cr2",  "cr3", "nef", "arw", "raf",  "orf",  "rw2",  "pef"};
    const char *extension = path_extension(path);
    for (size_t i = 0; i < sizeof extensions / sizeof *extensions; i++)
        if (strcasecmp(extension, extensions[i]) == 0)
            return true;
    return false;
}

/* The name without its first `skip` parts; NULL: it has no more. */
static const char *skip_parts(const char *name, size_t skip) {
    for (; skip > 0 && name; skip--) {
        name = strchr(name, '/');
        name = name ? name + 1 : NULL;
    }
    return name;
}

/* Length without a picture's extension. */
static size_t stem_length(const char *name) {
    const char *extension = path_extension(name);
    return photo_is_picture(name) ? strlen(name) - strlen(extension) - 1 : strlen(name);
}

/* --- files ------------------------------------------------------------------------------------ */

/* The bundle's pictures by their paths without case and extension. */
struct picture {
    char *key; /* owned */
    const struct listed_file *file;
};

struct pictures {
    size_t count;
    struct picture *picture; /* [count] sorted by key, then by path */
};

/* folder + name, in lower case and without a picture's extension. */
static char *make_key(const char *folder, const char *name) {
    char *key = mem_printf("%s%.*s", folder, (int)stem_length(name), name);
    for (char *p = key; *p; p++)
        *p = (char)tolower((unsigned char)*p);
    return key;
}

static int by_key(const void *a, const void *b) {
    const struct picture *x = a, *y = b;
    int order = strcmp(x->key, y->key);
    return order ? order : strcmp(x->file->path, y->file->path);
}

static struct pictures find_pictures(const struct listing *l) {
    struct pictures in = {.picture = mem_array(l->count + 1, sizeof *in.picture)};
    for (size_t i = 0; i < l->count; i++)
        if (photo_is_picture(l->file[i].path))
            in.picture[in.count++] = (struct picture){make_key("", l->file[i].path), &l->file[i]};
    if (in.count > 1)
        qsort(in.picture, in.count, sizeof *in.picture, by_key);
    return in;
}

static void release_pictures(struct pictures *in) {
    for (size_t i = 0; i < in->count; i++)
        mem_free(in->picture[i].key);
    mem_free(in->picture);
}

/* The picture in `folder` (a base) that `name` means there; NULL: none, or more than one. */
static const struct listed_file *match(const struct pictures *in, const char *folder, const char *name) {
    char *key = make_key(folder, name), *full = mem_printf("%s%s", folder, name);
    const struct listed_file *exact = NULL, *cased = NULL, *loose = NULL;
    size_t low = 0, high = in->count, cased_count = 0, loose_count = 0;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (strcmp(in->picture[middle].key, key) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < in->count && strcmp(in->picture[low].key, key) == 0; low++) {
        const struct listed_file *file = in->picture[low].file;
        if (strcmp(file->path, full) == 0)
            exact = file;
        if (strcasecmp(file->path, full) == 0)
            cased = file, cased_count++;
        loose = file, loose_count++;
    }
    mem_free(full);
    mem_free(key);
    if (exact || cased_count > 0)
        return exact ? exact : cased_count == 1 ? cased : NULL;
    return loose_count == 1 ? loose : NULL;
}

/* --- folders ---------------------------------------------------------------------------------- */

#define SAMPLE_COUNT 64 /* frames that decide which folder it is */
#define MAX_PARTS 8     /* leading parts of a name that may be left out */

struct choice {
    char *folder; /* a base; owned */
    size_t skip, found_count;
};

/* How many of a sample of the frames are found so. */
static size_t count_found(const struct pictures *in, const struct transforms *t, const char *folder, size_t skip) {
    size_t count = 0, step = t->frame_count / SAMPLE_COUNT + 1;
    for (size_t i = 0; i < t->frame_count; i += step) {
        const char *name = skip_parts(t->frame[i].file, skip);
        count += name && match(in, folder, name);
    }
    return count;
}

/* Keeps the better one. */
static void try_folder(const struct pictures *in, const struct transforms *t, const char *folder, struct choice *best) {
    for (size_t skip = 0; skip <= MAX_PARTS; skip++) {
        size_t count = count_found(in, t, folder, skip);
        if (count > best->found_count) {
            mem_free(best->folder);
            *best = (struct choice){mem_strdup(folder), skip, count};
        }
    }
}

static struct choice choose_folder(const struct pictures *in, const char *base, const struct transforms *t) {
    static const char *const folders[] = {"",       "images/", "photos/", "rgb/",  "color/",
                                          "image/", "input/",  "frames/", "imgs/", "resized_images/"};
    struct choice best = {0};
    size_t sample_count = 0, step = t->frame_count / SAMPLE_COUNT + 1;
    for (size_t i = 0; i < t->frame_count; i += step)
        sample_count++;
    for (size_t length = strlen(base);;) {
        for (size_t i = 0; i < sizeof folders / sizeof *folders && best.found_count < sample_count; i++) {
            char *folder = mem_printf("%.*s%s", (int)length, base, folders[i]);
            try_folder(in, t, folder, &best);
            mem_free(folder);
        }
        if (length == 0)
            return best;
        length--; /* the slash; then the folder's name */
        while (length > 0 && base[length - 1] != '/')
            length--;
    }
}

/* --- all of them ------------------------------------------------------------------------------ */

static int by_pointer(const void *a, const void *b) {
    const struct listed_file *x = *(const struct listed_file *const *)a, *y = *(const struct listed_file *const *)b;
    return (x > y) - (x < y);
}

/* Pictures in the folder of the first one that was found, which are no frame's. */
static void tell_unposed(const struct pictures *in, const struct listed_file **used, size_t used_count,
                         struct findings *f) {
    const char *first = used[0]->path;
    size_t length = (size_t)(path_base(first) - first), count = 0;
    qsort(used, used_count, sizeof *used, by_pointer);
    for (size_t i = 0; i < in->count; i++) {
        const struct listed_file *file = in->picture[i].file;
        bool is_beside =
            (size_t)(path_base(file->path) - file->path) == length && strncmp(file->path, first, length) == 0;
        count += is_beside && !bsearch(&file, used, used_count, sizeof *used, by_pointer);
    }
    if (count > 0)
        findings_warning(f, "%zu photographs in %.*s have no pose and are not used", count,
                         length > 0 ? (int)length : 14, length > 0 ? first : "the top folder");
}

size_t photo_folder_settle(const struct listing *l, const char *base, bool tells_unposed, struct transforms *t,
                           struct findings *f) {
    struct pictures in = find_pictures(l);
    struct choice choice = choose_folder(&in, base, t);
    const struct listed_file **used = mem_array(t->frame_count + 1, sizeof *used);
    size_t found_count = 0;
    if (choice.skip > 0)
        findings_warning(f, "photographs are taken from %s, where the bundle has them: the file names %s",
                         choice.folder[0] ? choice.folder : "the top folder", t->frame[0].file);
    for (size_t i = 0; i < t->frame_count; i++) {
        char *named = t->frame[i].file;
        const char *name = skip_parts(named, choice.skip);
        const struct listed_file *file = choice.folder && name ? match(&in, choice.folder, name) : NULL;
        t->frame[i].file = file ? mem_strdup(file->path) : mem_printf("%s%s", base, named);
        if (file)
            used[found_count++] = file;
        mem_free(named);
    }
    if (tells_unposed && found_count > 0)
        tell_unposed(&in, used, found_count, f);
    mem_free(used);
    mem_free(choice.folder);
    release_pictures(&in);
    return found_count;
}
