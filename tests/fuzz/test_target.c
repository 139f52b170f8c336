/* test_target.c -- the request target: what comes out of it is UTF-8 without control bytes, climbs
 * nowhere, and reads back the same when it is written. */
#include "server/net/target.h"

#include "common/mem.h"
#include "common/url.h"
#include "common/utf8.h"
#include "tests/fuzz/fuzz.h"

static void check_word(const char *word) {
    MUST(utf8_valid(word, strlen(word), NULL));
    for (; *word; word++)
        MUST((unsigned char)*word >= 0x20 && *word != 0x7f);
}

static void check_segments(const struct target *t) {
    for (size_t i = 0; i < t->segment_count; i++) {
        const char *part = t->segments[i];
        check_word(part);
        MUST(*part != '\0' && strcmp(part, ".") != 0 && strcmp(part, "..") != 0);
        MUST(strncmp(part, "../", 3) != 0 && !strstr(part, "/../") && *part != '/');
    }
    for (size_t i = 0; i < t->query_count; i++) {
        check_word(t->names[i]);
        check_word(t->values[i]);
        MUST(target_query(t, t->names[i]) != NULL);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct target t = {0}, again = {0};
    struct error err = {.message = ""};
    char *raw = fuzz_text(data, size);
    if (target_parse(&t, raw, &err) == STATUS_OK) {
        check_segments(&t);
        char *rest = target_rest(&t, 0);
        struct buf path;
        buf_init(&path, SIZE_MAX / 2);
        buf_puts(&path, "/");
        url_encode(&path, rest, false);
        MUST(target_parse(&again, buf_text(&path), &err) == STATUS_OK);
        char *second = target_rest(&again, 0);
        MUST(strcmp(rest, second) == 0);
        mem_free(second);
        buf_release(&path);
        mem_free(rest);
    } else {
        MUST(err.status == STATUS_INPUT && err.message[0] != '\0');
    }
    for (const char *at = t.path; at && *at; at++)
        MUST((unsigned char)*at > 0x20 && (unsigned char)*at < 0x7f);
    target_release(&again);
    target_release(&t);
    free(raw);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 20000;
    seeds_text(s, "/");
    seeds_text(s, "/v1/jobs/17/outputs/preview%2Fbase_color.png?wait=5&after=12");
    seeds_text(s, "http://localhost:80/v1/jobs?limit=1");
    seeds_text(s, "/v1/scenes?name=K%C3%BCche+hinten&cursor=1700000000000-00ff%00");
    seeds_text(s, "/a/../b//c/./d%2e%2e%2f");
}
