/* test_field.c -- the syntax of header fields: ranges, entity tags, digests, base64, numbers, hosts. */
#include "common/base64.h"
#include "common/sha256.h"
#include "server/net/field.h"

#include "tests/fuzz/fuzz.h"

static void check_range(const char *text, uint64_t size) {
    uint64_t first = 0, count = 0;
    if (field_range(text, size, &first, &count) == FIELD_RANGE_PART)
        MUST(count >= 1 && first < size && count <= size - first);
}

static void check_digest(const char *text) {
    char hex[65], again[65], written[64];
    if (!field_digest(text, hex))
        return;
    MUST(sha256_is_hex(hex));
    field_digest_format(hex, written);
    MUST(field_digest(written, again) && strcmp(hex, again) == 0);
}

static void check_host(const char *text) {
    size_t length;
    if (!field_host(text, &length))
        return;
    MUST(length > 0 && length <= strlen(text));
    field_is_loopback_host(text, length);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *text = fuzz_text(data, size);
    uint8_t bytes[16];
    size_t used;
    int64_t number;
    field_is_token(text);
    field_etag_listed(text, "\"rev-1\"", false);
    field_etag_listed(text, "\"rev-1\"", true);
    field_accepts(text, "application/x-ndjson");
    field_is_type(text, "application/json");
    check_range(text, 0);
    check_range(text, 1000);
    check_range(text, UINT64_MAX);
    check_digest(text);
    check_host(text);
    if (base64_decode((const char *)data, size, bytes, sizeof bytes, &used))
        MUST(used <= sizeof bytes && used * 4 <= size * 3);
    if (field_number(text, -5, 1000, &number))
        MUST(number >= -5 && number <= 1000);
    if (field_number(text, 0, INT64_MAX, &number))
        MUST(number >= 0);
    free(text);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char *const texts[] = {"bytes=0-99",
                                        "bytes=-5",
                                        "bytes=100-",
                                        "bytes=0-1,2-3",
                                        "\"a\", W/\"rev-1\" , *",
                                        "text/html;q=0.5, application/x-ndjson",
                                        "application/json; charset=utf-8",
                                        "sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:",
                                        "bG9uZ2VyIHRoYW4gMTYgYnl0ZXM=",
                                        "YWI=",
                                        "999999999999999999",
                                        "-5",
                                        "[::1]:80",
                                        "lab.localhost:7117",
                                        "127.0.0.1"};
    s->mutants = 20000;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        seeds_text(s, texts[i]);
}
