/* test_archive.c -- unpacking damaged archives: an answer, nothing but files and folders below the
 * new folder, nothing at all after a refusal. */
#include "server/ingest/archive.h"

#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

static void check_tree(const char *dir) {
    struct dirent **entry = NULL;
    int count = scandir(dir, &entry, NULL, NULL);
    for (int i = 0; i < count; i++) {
        const char *name = entry[i]->d_name;
        if (strcmp(name, ".") != 0 && strcmp(name, "..") != 0) {
            char *inner = file_join(dir, name);
            struct stat facts;
            MUST(lstat(inner, &facts) == 0 && (S_ISREG(facts.st_mode) || S_ISDIR(facts.st_mode)));
            if (S_ISDIR(facts.st_mode))
                check_tree(inner);
            mem_free(inner);
        }
        free(entry[i]);
    }
    free(entry);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct archive_limits limits = {100, 1 << 20, 1000.0};
    char *path = file_join(fuzz_folder(), "case"), *dir = file_join(fuzz_folder(), "out");
    struct error err = {.message = ""};
    fuzz_write(path, data, size);
    enum status status = archive_unpack(path, "case", dir, &limits, &err);
    if (status == STATUS_OK) {
        check_tree(dir);
    } else {
        MUST(status == STATUS_INPUT || status == STATUS_LIMIT);
        MUST(err.message[0] != '\0' && access(dir, F_OK) != 0);
    }
    file_remove_tree(dir, NULL);
    mem_free(path);
    mem_free(dir);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 2000;
    seeds_data(s, "vectors/zip", ".zip");
    seeds_data(s, "vectors/tar", ".tar");
}
