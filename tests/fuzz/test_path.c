/* test_path.c -- names of files inside a bundle, and of outputs that a server tells the client to
 * write: what passes stays below the folder that it is for. */
#include "client/commands.h"
#include "common/mem.h"
#include "common/utf8.h"
#include "server/ingest/path.h"
#include "tests/fuzz/fuzz.h"

static void check_below(const char *name) {
    MUST(*name != '/' && strcmp(name, "..") != 0 && strncmp(name, "../", 3) != 0 && !strstr(name, "/../"));
    size_t length = strlen(name);
    MUST(length < 3 || strcmp(name + length - 3, "/..") != 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *name = fuzz_text(data, size), *clean = NULL, *again = NULL;
    struct error err = {.message = ""};
    if (path_clean(name, &clean, &err) == STATUS_OK) {
        check_below(clean);
        MUST(strlen(clean) <= PATH_MAX_BYTES && utf8_valid(clean, strlen(clean), NULL));
        MUST(path_clean(clean, &again, &err) == STATUS_OK && strcmp(clean, again) == 0);
        path_is_litter(clean);
        MUST(!strchr(path_base(clean), '/') && !strchr(path_extension(clean), '.'));
    } else {
        MUST(err.status == STATUS_INPUT && !clean && err.message[0] != '\0');
    }
    if (get_name_is_safe(name))
        check_below(name);
    mem_free(again);
    mem_free(clean);
    free(name);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char *const texts[] = {
        "a/./b//c.png",           "../x",          "C:\\x",     "/etc/passwd", "a\\..\\b", "__MACOSX/._a",
        "preview/base_color.png", "\xC3\xA4/\xFF", "a/../../b", "a:b",         "./C:/x",   "a\u202Eb\u200E"};
    s->mutants = 20000;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        seeds_text(s, texts[i]);
}
