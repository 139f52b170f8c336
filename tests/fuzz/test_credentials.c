/* test_credentials.c -- the client's file of tokens: what is there is found, what is kept is found
 * again, and the others' lines stay. */
#include "client/credentials.h"

#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

#define SERVER "http://a"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *before = NULL, *after = NULL, *other = NULL;
    setenv("XDG_CONFIG_HOME", fuzz_folder(), 1);
    char *dir = file_join(fuzz_folder(), "unbake"), *path = credentials_folder_file("tokens");
    mkdir(dir, 0700);
    umask(077);
    fuzz_write(path, data, size);
    if (credentials_find("http://other", &before, NULL) == STATUS_OK &&
        credentials_keep(SERVER, "secret", NULL) == STATUS_OK) {
        MUST(credentials_find(SERVER, &after, NULL) == STATUS_OK && after && strcmp(after, "secret") == 0);
        MUST(credentials_find("http://other", &other, NULL) == STATUS_OK);
        MUST(!before == !other && (!before || strcmp(before, other) == 0));
        MUST(credentials_keep(SERVER, NULL, NULL) == STATUS_OK);
        mem_free(after);
        MUST(credentials_find(SERVER, &after, NULL) == STATUS_OK && !after);
    }
    mem_free(before);
    mem_free(after);
    mem_free(other);
    mem_free(path);
    mem_free(dir);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 1000;
    seeds_text(s, "http://a one\nhttp://other two\n\nhttp://other three");
    seeds_text(s, "http://other \r\nhttp://a\n");
}
