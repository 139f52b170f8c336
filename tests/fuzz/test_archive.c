/* test_archive.c -- unpacking damaged archives: an answer, nothing but files and folders below the
 * new folder, nothing at all after a refusal. */
#include "server/ingest/archive.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/mutate.h"

static char work[] = "/dev/shm/unbake-fuzz-archive-XXXXXX";

static void check_tree(const char *dir) {
    struct dirent **entry = NULL;
    int count = scandir(dir, &entry, NULL, NULL);
    for (int i = 0; i < count; i++) {
        const char *name = entry[i]->d_name;
        if (strcmp(name, ".") != 0 && strcmp(name, "..") != 0) {
            char *inner = file_join(dir, name);
            struct stat facts;
            CHECK(lstat(inner, &facts) == 0 && (S_ISREG(facts.st_mode) || S_ISDIR(facts.st_mode)));
            if (S_ISDIR(facts.st_mode))
                check_tree(inner);
            mem_free(inner);
        }
        free(entry[i]);
    }
    free(entry);
}

static void target(const uint8_t *data, size_t size) {
    static const struct archive_limits limits = {100, 1 << 20, 1000.0};
    char *path = file_join(work, "case"), *dir = file_join(work, "out");
    struct error err = {.message = ""};
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    CHECK(fd >= 0 && file_write_all(fd, data, size, path, NULL) == STATUS_OK);
    close(fd);
    enum status status = archive_unpack(path, "case", dir, &limits, &err);
    if (status == STATUS_OK) {
        check_tree(dir);
        file_remove_tree(dir, NULL);
    } else {
        CHECK_THAT(status == STATUS_INPUT || status == STATUS_LIMIT, "%s", err.message);
        CHECK(err.message[0] != '\0' && access(dir, F_OK) != 0);
        file_remove_tree(dir, NULL);
    }
    mem_free(path);
    mem_free(dir);
}

int main(int argc, char **argv) {
    if (!mkdtemp(work))
        CHECK_SKIP("no /dev/shm to work in");
    struct mutate *m = malloc(sizeof *m);
    mutate_init(m);
    mutate_add(m, "vectors/zip", ".zip");
    mutate_add(m, "vectors/tar", ".tar");
    int result = mutate_run(m, argc, argv, 4000, target);
    free(m);
    file_remove_tree(work, NULL);
    return result;
}
