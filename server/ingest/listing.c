/* listing.c -- see listing.h. */
#include "server/ingest/listing.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/utf8.h"
#include "server/ingest/path.h"

#define HEAD_BYTES 4096 /* of a file that is recognised by what it begins with */

/* --- making one ----------------------------------------------------------------------------- */

struct growing {
    struct listing *l;
    size_t capacity, folder_capacity;
};

/* Takes path. */
static void add_file(struct growing *g, char *path, uint64_t bytes, const void *content) {
    struct listing *l = g->l;
    if (l->count == g->capacity) {
        g->capacity = g->capacity ? 2 * g->capacity : 64;
        l->file = mem_realloc_array(l->file, g->capacity, sizeof *l->file);
    }
    l->file[l->count++] = (struct listed_file){path, bytes, content};
}

/* Takes base. */
static void add_folder(struct growing *g, char *base) {
    struct listing *l = g->l;
    if (l->folder_count == g->folder_capacity) {
        g->folder_capacity = g->folder_capacity ? 2 * g->folder_capacity : 16;
        l->folder = mem_realloc_array(l->folder, g->folder_capacity, sizeof *l->folder);
    }
    l->folder[l->folder_count++] = base;
}

static enum status add_below(struct growing *g, const char *base, int depth, struct error *err) {
    char **names, *dir = file_join(g->l->root, base);
    size_t count;
    add_folder(g, mem_strdup(base));
    enum status status = file_list(dir, &names, &count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct stat info;
        if (names[i][0] == '.' || path_is_litter(names[i]))
            continue;
        char *path = mem_printf("%s%s", base, names[i]), *full = file_join(dir, names[i]);
        if (lstat(full, &info) != 0) {
            status = error_set_errno(err, errno, "cannot access %s", path);
        } else if (S_ISREG(info.st_mode)) {
            add_file(g, path, (uint64_t)info.st_size, NULL);
            path = NULL;
        } else if (S_ISDIR(info.st_mode) && depth < LISTING_MAX_DEPTH) {
            char *inner = mem_printf("%s/", path);
            status = add_below(g, inner, depth + 1, err);
            mem_free(inner);
        } else if (S_ISLNK(info.st_mode) && g->l->link_count++ == 0) {
            g->l->link = path;
            path = NULL;
        }
        mem_free(path);
        mem_free(full);
    }
    file_free_names(names, count);
    mem_free(dir);
    return status;
}

static int by_path(const void *a, const void *b) {
    return strcmp(((const struct listed_file *)a)->path, ((const struct listed_file *)b)->path);
}

static size_t depth_of(const char *base) {
    size_t depth = 0;
    for (; *base; base++)
        depth += *base == '/';
    return depth;
}

static int by_depth(const void *a, const void *b) {
    const char *x = *(char *const *)a, *y = *(char *const *)b;
    size_t p = depth_of(x), q = depth_of(y);
    return p != q ? (p > q) - (p < q) : strcmp(x, y);
}

static void sort(struct listing *l) {
    if (l->count > 1)
        qsort(l->file, l->count, sizeof *l->file, by_path);
    if (l->folder_count > 1)
        qsort(l->folder, l->folder_count, sizeof *l->folder, by_depth);
}

enum status listing_read(struct listing *l, const char *root, struct error *err) {
    struct growing g = {.l = l};
    *l = (struct listing){.root = mem_strdup(root)};
    enum status status = add_below(&g, "", 0, err);
    sort(l);
    return status;
}

void listing_of_memory(struct listing *l, const struct listed_file *file, size_t count) {
    struct growing g = {.l = l};
    *l = (struct listing){0};
    add_folder(&g, mem_strdup(""));
    for (size_t i = 0; i < count; i++) {
        add_file(&g, mem_strdup(file[i].path), file[i].bytes, file[i].content);
        for (const char *slash = strchr(file[i].path, '/'); slash; slash = strchr(slash + 1, '/')) {
            char *base = mem_strndup(file[i].path, (size_t)(slash - file[i].path) + 1);
            bool is_new = true;
            for (size_t k = 0; k < l->folder_count && is_new; k++)
                is_new = strcmp(l->folder[k], base) != 0;
            if (is_new)
                add_folder(&g, base);
            else
                mem_free(base);
        }
    }
    sort(l);
}

void listing_release(struct listing *l) {
    for (size_t i = 0; i < l->count; i++)
        mem_free(l->file[i].path);
    for (size_t i = 0; i < l->folder_count; i++)
        mem_free(l->folder[i]);
    mem_free(l->file);
    mem_free(l->folder);
    mem_free(l->root);
    mem_free(l->link);
    *l = (struct listing){0};
}

/* --- looking ---------------------------------------------------------------------------------- */

/* Number of the first file whose path is not before base + name. */
static size_t lower_bound(const struct listing *l, const char *base, const char *name) {
    size_t low = 0, high = l->count, length = strlen(base);
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        const char *path = l->file[middle].path;
        int order = strncmp(path, base, length);
        if (order == 0)
            order = strcmp(path + length, name);
        if (order < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static bool is_below(const char *path, const char *base) { return strncmp(path, base, strlen(base)) == 0; }

const struct listed_file *listing_find(const struct listing *l, const char *base, const char *name) {
    size_t at = lower_bound(l, base, name), length = strlen(base);
    if (at == l->count || !is_below(l->file[at].path, base) || strcmp(l->file[at].path + length, name) != 0)
        return NULL;
    return &l->file[at];
}

char *listing_find_any(const struct listing *l, const char *base, const char *const *names, size_t count) {
    const struct listed_file *file = NULL;
    for (size_t i = 0; i < count && !file; i++)
        file = listing_find(l, base, names[i]);
    return file ? mem_strdup(file->path) : NULL;
}

bool listing_has_folder(const struct listing *l, const char *base, const char *name) {
    char *inner = mem_printf("%s%s/", base, name);
    size_t at = lower_bound(l, inner, "");
    bool found = at < l->count && is_below(l->file[at].path, inner);
    mem_free(inner);
    return found;
}

char *listing_above(const char *base) {
    size_t length = strlen(base);
    if (length == 0)
        return NULL;
    length--; /* its slash */
    while (length > 0 && base[length - 1] != '/')
        length--;
    return mem_strndup(base, length);
}

const struct listed_file *listing_match(const struct listing *l, const char *base, const char *pattern, size_t *at) {
    size_t length = strlen(base), first = lower_bound(l, base, "");
    for (*at = *at > first ? *at : first; *at < l->count && is_below(l->file[*at].path, base); (*at)++)
        if (fnmatch(pattern, l->file[*at].path + length, FNM_PATHNAME | FNM_CASEFOLD) == 0)
            return &l->file[(*at)++];
    return NULL;
}

const struct listed_file *listing_first(const struct listing *l, const char *base, const char *pattern) {
    size_t at = 0;
    return listing_match(l, base, pattern, &at);
}

size_t listing_match_count(const struct listing *l, const char *base, const char *pattern) {
    size_t at = 0, count = 0;
    while (listing_match(l, base, pattern, &at))
        count++;
    return count;
}

/* --- reading ---------------------------------------------------------------------------------- */

enum status listing_open(const struct listing *l, const char *path, const char *kind, struct mapping *m,
                         struct error *err) {
    const struct listed_file *file = listing_find(l, "", path);
    *m = (struct mapping){0};
    if (file && file->content) {
        if (file->bytes == 0)
            return error_set(err, STATUS_INPUT, "%s is not %s: it is empty", path, kind);
        *m = (struct mapping){
            .data = (void *)(uintptr_t)file->content, .size = (size_t)file->bytes, .is_borrowed = true};
        return STATUS_OK;
    }
    if (!l->root)
        return error_set(err, STATUS_INPUT, "%s is not in the bundle", path);
    char *full = file_join(l->root, path);
    enum status status = mapping_open(m, full, path, kind, err);
    mem_free(full);
    return status;
}

enum status listing_text(const struct listing *l, const char *path, size_t limit, char **text, struct error *err) {
    struct mapping file;
    enum status status = listing_open(l, path, "a text", &file, err);
    *text = NULL;
    if (status == STATUS_OK && file.size > limit)
        status = error_set(err, STATUS_LIMIT, "%s is larger than %zu bytes", path, limit);
    size_t length, mark = file.size >= 3 && memcmp(file.data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    if (status == STATUS_OK)
        *text = utf8_from_utf16(file.data, file.size, &length);
    if (status == STATUS_OK && !*text)
        *text = mem_strndup((const char *)file.data + mark, file.size - mark);
    mapping_close(&file);
    return status;
}

static bool begins_with_both(const struct listing *l, const char *path, const char *word, const char *other) {
    struct mapping file;
    if (listing_open(l, path, "a file", &file, NULL) != STATUS_OK)
        return false;
    size_t size = file.size < HEAD_BYTES ? file.size : HEAD_BYTES;
    bool found = memmem(file.data, size, word, strlen(word)) && memmem(file.data, size, other, strlen(other));
    mapping_close(&file);
    return found;
}

char *listing_first_with(const struct listing *l, const char *base, const char *pattern, const char *word,
                         const char *other) {
    const struct listed_file *file;
    for (size_t at = 0; (file = listing_match(l, base, pattern, &at)) != NULL;)
        if (begins_with_both(l, file->path, word, other))
            return mem_strdup(file->path);
    return NULL;
}
