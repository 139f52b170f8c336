/* seeds.c -- see fuzz.h. */
#include <dirent.h>
#include <ftw.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/fuzz/fuzz.h"

void seeds_add(struct seeds *s, const void *data, size_t size) {
    if (size > SEED_MAX_BYTES)
        return;
    s->seed = realloc(s->seed, (s->count + 1) * sizeof *s->seed);
    struct seed *seed = &s->seed[s->count++];
    seed->data = malloc(size ? size : 1);
    memcpy(seed->data, data, size);
    seed->size = size;
}

void seeds_text(struct seeds *s, const char *text) { seeds_add(s, text, strlen(text)); }

static void add_file(struct seeds *s, const char *path) {
    static uint8_t bytes[SEED_MAX_BYTES + 1];
    FILE *file = fopen(path, "rb");
    if (!file)
        return;
    size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    seeds_add(s, bytes, size);
}

static int is_visible(const struct dirent *entry) { return entry->d_name[0] != '.'; }

void seeds_path(struct seeds *s, const char *path, const char *suffix) {
    struct stat facts;
    if (stat(path, &facts) != 0)
        return;
    if (S_ISREG(facts.st_mode)) {
        size_t length = strlen(path), tail = strlen(suffix);
        if (length >= tail && strcmp(path + length - tail, suffix) == 0)
            add_file(s, path);
        return;
    }
    /* In alphabetical order: the same sequence on every file system. */
    struct dirent **entry = NULL;
    int count = scandir(path, &entry, is_visible, alphasort);
    for (int i = 0; i < count; i++) {
        char inner[1024];
        snprintf(inner, sizeof inner, "%s/%s", path, entry[i]->d_name);
        seeds_path(s, inner, suffix);
        free(entry[i]);
    }
    free(entry);
}

void seeds_data(struct seeds *s, const char *name, const char *suffix) {
    const char *root = getenv("UNBAKE_TEST_DATA");
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", root ? root : "../shared/data", name);
    seeds_path(s, path, suffix);
}

void seeds_release(struct seeds *s) {
    for (size_t i = 0; i < s->count; i++)
        free(s->seed[i].data);
    free(s->seed);
}

/* --- what targets need --------------------------------------------------------------------- */

static char folder[] = "/dev/shm/unbake-fuzz-XXXXXX";

static int remove_one(const char *path, const struct stat *facts, int kind, struct FTW *place) {
    (void)facts, (void)kind, (void)place;
    return remove(path);
}

static void remove_folder(void) { nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS); }

const char *fuzz_folder(void) {
    static bool is_made;
    if (!is_made) {
        MUST(mkdtemp(folder));
        atexit(remove_folder);
        is_made = true;
    }
    return folder;
}

void fuzz_write(const char *path, const uint8_t *data, size_t size) {
    FILE *file = fopen(path, "wb");
    MUST(file && fwrite(data, 1, size, file) == size && fclose(file) == 0);
}

char *fuzz_text(const uint8_t *data, size_t size) {
    char *text = malloc(size + 1);
    if (size)
        memcpy(text, data, size);
    text[size] = '\0';
    return text;
}
