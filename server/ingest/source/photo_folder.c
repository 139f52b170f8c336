/* photo_folder.c -- see photo_folder.h. */
#include "server/ingest/source/photo_folder.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/name_key.h"
#include "server/ingest/path.h"

/* --- names ------------------------------------------------------------------------------------ */

bool photo_is_picture(const char *path) {
    static const char *const extensions[] = {"png",  "jpg",  "jpeg", "exr",  "hdr", "tif",
                                             "tiff", "webp", "heic", "heif", "avif"};
    const char *extension = path_extension(path);
    for (size_t i = 0; i < sizeof extensions / sizeof *extensions; i++)
        if (strcasecmp(extension, extensions[i]) == 0)
            return true;
    return image_is_raw_name(path);
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

/* The bundle's pictures by their paths without extension, as name_key has them. */
struct picture {
    char *key; /* owned */
    const struct listed_file *file;
};

struct pictures {
    size_t count;
    struct picture *picture; /* [count] sorted by key, then by path */
};

/* folder + name as name_key has it, without a picture's extension. */
static char *make_key(const char *folder, const char *name) {
    char *stem = mem_printf("%s%.*s", folder, (int)stem_length(name), name), *key = name_key(stem);
    mem_free(stem);
    return key;
}

static bool has_extension_of(const char *path, const char *name) {
    return strcasecmp(path_extension(path), path_extension(name)) == 0;
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

/* Files that a name may mean. */
struct meant {
    const struct listed_file *file, *rival; /* rival: as good a choice, or NULL */
};

/* Adds a file that means the name to `degree`. */
static void add_meant(struct meant *meant, int *best, int degree, const struct listed_file *file) {
    if (degree > *best)
        *meant = (struct meant){file, NULL}, *best = degree;
    else if (degree == *best)
        meant->rival = file;
}

/* The picture in `folder` (a base) that `name` means there: exactly, else but for case and spelling of accents
 * (name_key.h), else but for the extension, and then rather a picture than the camera's raw file beside it. */
static struct meant find_meant(const struct pictures *in, const char *folder, const char *name) {
    char *key = make_key(folder, name), *full = mem_printf("%s%s", folder, name);
    struct meant meant = {NULL, NULL};
    size_t low = 0, high = in->count;
    int best = 0;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (strcmp(in->picture[middle].key, key) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < in->count && strcmp(in->picture[low].key, key) == 0; low++) {
        const struct listed_file *file = in->picture[low].file;
        int degree = strcmp(file->path, full) == 0        ? 4
                     : has_extension_of(file->path, full) ? 3
                     : !image_is_raw_name(file->path)     ? 2
                                                          : 1;
        add_meant(&meant, &best, degree, file);
    }
    mem_free(full);
    mem_free(key);
    return meant;
}

/* --- folders ---------------------------------------------------------------------------------- */

#define SAMPLE_COUNT 64 /* frames that decide which folder it is */
#define MAX_PARTS 8     /* leading parts of a name that may be left out */

struct choice {
    char *folder; /* a base; owned */
    size_t skip, found_count;
};

/* Names of the frames' photographs or masks, which NULL stands for where a frame has none. */
struct names {
    const struct frames *t;
    bool are_masks;
};

static const char *name_at(const struct names *n, size_t i) {
    return n->are_masks ? n->t->frame[i].mask : n->t->frame[i].file;
}

/* How many of a sample of the names are found so. */
static size_t count_found(const struct pictures *in, const struct names *n, const char *folder, size_t skip) {
    size_t count = 0, step = n->t->frame_count / SAMPLE_COUNT + 1;
    for (size_t i = 0; i < n->t->frame_count; i += step) {
        const char *name = skip_parts(name_at(n, i), skip);
        struct meant meant = name ? find_meant(in, folder, name) : (struct meant){NULL, NULL};
        count += meant.file != NULL;
    }
    return count;
}

/* Keeps the better one. */
static void try_folder(const struct pictures *in, const struct names *n, const char *folder, struct choice *best) {
    for (size_t skip = 0; skip <= MAX_PARTS; skip++) {
        size_t count = count_found(in, n, folder, skip);
        if (count > best->found_count) {
            mem_free(best->folder);
            *best = (struct choice){mem_strdup(folder), skip, count};
        }
    }
}

static struct choice choose_folder(const struct pictures *in, const char *base, const struct names *n) {
    static const char *const photo_folders[] = {"",       "images/", "photos/", "rgb/",  "color/",
                                                "image/", "input/",  "frames/", "imgs/", "resized_images/"};
    static const char *const mask_folders[] = {"", "masks/", "mask/"};
    const char *const *folders = n->are_masks ? mask_folders : photo_folders;
    size_t folder_count =
        n->are_masks ? sizeof mask_folders / sizeof *mask_folders : sizeof photo_folders / sizeof *photo_folders;
    struct choice best = {0};
    size_t sample_count = 0, step = n->t->frame_count / SAMPLE_COUNT + 1;
    for (size_t i = 0; i < n->t->frame_count; i += step)
        sample_count += name_at(n, i) != NULL;
    for (size_t length = strlen(base);;) {
        for (size_t i = 0; i < folder_count && best.found_count < sample_count; i++) {
            char *folder = mem_printf("%.*s%s", (int)length, base, folders[i]);
            try_folder(in, n, folder, &best);
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

static void tell_elsewhere(const struct choice *choice, const char *what, const char *named, struct findings *f) {
    if (choice->skip > 0)
        findings_warning(f, "%s are taken from %s, where the bundle has them: the file names %s", what,
                         choice->folder[0] ? choice->folder : "the top folder", named);
}

/* The path of a name, the caller's; *file: its file, or NULL. More than one that it may mean is a problem. */
static char *settle_name(const struct pictures *in, const struct choice *choice, const char *base, const char *named,
                         size_t number, struct findings *f, const struct listed_file **file) {
    const char *name = skip_parts(named, choice->skip);
    struct meant meant = {NULL, NULL};
    if (choice->folder && name)
        meant = find_meant(in, choice->folder, name);
    if (meant.rival)
        findings_problem(f, named, "frames[%zu] names it, and it may be %s or %s", number, meant.file->path,
                         meant.rival->path);
    *file = meant.file;
    return meant.file ? mem_strdup(meant.file->path) : mem_printf("%s%s", base, named);
}

size_t photo_folder_resolve(const struct listing *l, const char *base, bool tells_unposed, struct frames *t,
                            struct findings *f) {
    struct pictures in = find_pictures(l);
    const struct names names = {t, false};
    struct choice choice = choose_folder(&in, base, &names);
    const struct listed_file **used = mem_array(t->frame_count + 1, sizeof *used);
    size_t found_count = 0;
    tell_elsewhere(&choice, "photographs", t->frame_count > 0 ? t->frame[0].file : "", f);
    for (size_t i = 0; i < t->frame_count; i++) {
        char *named = t->frame[i].file;
        const struct listed_file *file;
        t->frame[i].file = settle_name(&in, &choice, base, named, t->frame[i].number, f, &file);
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

static int by_text(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

/* Leaves out the frames' photographs: where masks are missing, photographs of the same names must not stand for
 * them. */
static void drop_photographs(struct pictures *in, const struct frames *t) {
    const char **path = mem_array(t->frame_count, sizeof *path);
    size_t kept = 0;
    for (size_t i = 0; i < t->frame_count; i++)
        path[i] = t->frame[i].file;
    qsort(path, t->frame_count, sizeof *path, by_text);
    for (size_t i = 0; i < in->count; i++)
        if (bsearch(&in->picture[i].file->path, path, t->frame_count, sizeof *path, by_text))
            mem_free(in->picture[i].key);
        else
            in->picture[kept++] = in->picture[i];
    in->count = kept;
    mem_free(path);
}

void photo_folder_settle_masks(const struct listing *l, const char *base, struct frames *t, struct findings *f) {
    const struct names names = {t, true};
    const char *first = NULL;
    for (size_t i = 0; i < t->frame_count && !first; i++)
        first = t->frame[i].mask;
    if (!first)
        return;
    struct pictures in = find_pictures(l);
    drop_photographs(&in, t);
    struct choice choice = choose_folder(&in, base, &names);
    tell_elsewhere(&choice, "masks", first, f);
    for (size_t i = 0; i < t->frame_count; i++) {
        char *named = t->frame[i].mask;
        const struct listed_file *file;
        t->frame[i].mask = named ? settle_name(&in, &choice, base, named, t->frame[i].number, f, &file) : NULL;
        mem_free(named);
    }
    mem_free(choice.folder);
    release_pictures(&in);
}
