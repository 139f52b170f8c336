/* Header fields: entity tags, ranges, digests, hosts. */
#include "server/net/field.h"

#include "common/sha256.h"
#include "tests/check.h"

static void check_range(const char *text, uint64_t size, enum field_range wanted, uint64_t first, uint64_t count) {
    uint64_t found_first = 0, found_count = 0;
    enum field_range found = field_range(text, size, &found_first, &found_count);
    CHECK_THAT(found == wanted, "\"%s\" of %llu bytes", text, (unsigned long long)size);
    if (wanted == FIELD_RANGE_PART)
        CHECK_THAT(found_first == first && found_count == count, "\"%s\": %llu, %llu", text,
                   (unsigned long long)found_first, (unsigned long long)found_count);
}

static void check_ranges(void) {
    check_range("bytes=0-0", 10, FIELD_RANGE_PART, 0, 1);
    check_range("bytes=2-5", 10, FIELD_RANGE_PART, 2, 4);
    check_range("bytes=2-", 10, FIELD_RANGE_PART, 2, 8);
    check_range("bytes=2-99", 10, FIELD_RANGE_PART, 2, 8);
    check_range("bytes=-3", 10, FIELD_RANGE_PART, 7, 3);
    check_range("bytes=-99", 10, FIELD_RANGE_PART, 0, 10);
    check_range("BYTES= 1-2 ", 10, FIELD_RANGE_PART, 1, 2);
    check_range("bytes=10-", 10, FIELD_RANGE_OUTSIDE, 0, 0);
    check_range("bytes=-0", 10, FIELD_RANGE_OUTSIDE, 0, 0);
    check_range("bytes=0-", 0, FIELD_RANGE_OUTSIDE, 0, 0);
    static const char *const whole[] = {"",          "bytes",     "bytes=",      "bytes=-",
                                        "bytes=a-b", "bytes=5-2", "items=0-1",   "bytes=0-1,3-4",
                                        "bytes=1",   "bytes=--1", "bytes=0x1-2", "bytes=99999999999999999999-",
                                        "bytes=1 -2"};
    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++)
        check_range(whole[i], 10, FIELD_RANGE_WHOLE, 0, 0);
}

static void check_tags(void) {
    CHECK(field_etag_listed("\"a\"", "\"a\"", false));
    CHECK(field_etag_listed(" \"b\" , \"a\"", "\"a\"", false));
    CHECK(field_etag_listed("*", "\"a\"", false));
    CHECK(field_etag_listed("W/\"a\"", "\"a\"", true));
    CHECK(!field_etag_listed("W/\"a\"", "\"a\"", false));
    CHECK(field_etag_listed("W/\"a\", \"a\"", "\"a\"", false));
    CHECK(!field_etag_listed("\"aa\"", "\"a\"", true));
    CHECK(!field_etag_listed("a", "\"a\"", true));
    CHECK(!field_etag_listed("\"a", "\"a\"", true));
    CHECK(!field_etag_listed("", "\"a\"", true));
    CHECK(!field_etag_listed("*x", "\"a\"", true));
}

static void check_digests(void) {
    static const char hex[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"; /* "abc" */
    char text[64], back[65];
    field_digest_format(hex, text);
    CHECK_STRING(text, "sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:");
    CHECK(field_digest(text, back));
    CHECK_STRING(back, hex);
    CHECK(field_digest("md5=:AAAA:, sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:", back));
    CHECK(!field_digest("xsha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:", back));
    CHECK(!field_digest("sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa=:", back));
    CHECK(!field_digest("sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAF!0=:", back));
    CHECK(!field_digest("sha-256=", back));
    CHECK(sha256_is_hex(hex) && !sha256_is_hex("ba78") && !sha256_is_hex("BA7816"));
}

static void check_hosts(void) {
    static const char *const local[] = {"localhost", "localhost:80", "LOCALHOST", "127.0.0.1:7117",
                                        "127.9.9.9", "[::1]",        "[::1]:80",  "a.localhost:1"};
    static const char *const other[] = {"evil.org", "127.evil.org", "127.0.0.1.evil.org", "localhost.evil.org",
                                        "[::2]",    "128.0.0.1",    "notlocalhost",       ".localhost"};
    static const char *const bad[] = {"", ":80", "a b", "a/b", "[::1", "[::1]x", "a:b", "a,b", "user@localhost"};
    size_t length;
    for (size_t i = 0; i < sizeof local / sizeof *local; i++)
        CHECK_THAT(field_host(local[i], &length) && field_is_loopback_host(local[i], length), "%s", local[i]);
    for (size_t i = 0; i < sizeof other / sizeof *other; i++)
        CHECK_THAT(field_host(other[i], &length) && !field_is_loopback_host(other[i], length), "%s", other[i]);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(!field_host(bad[i], &length), "%s", bad[i]);
}

int main(void) {
    int64_t number;
    check_ranges();
    check_tags();
    check_digests();
    check_hosts();
    CHECK(field_number("0", 0, 9, &number) && number == 0);
    CHECK(field_number("-5", -9, 9, &number) && number == -5);
    CHECK(!field_number("", 0, 9, &number) && !field_number("1 ", 0, 9, &number));
    CHECK(!field_number("+1", 0, 9, &number) && !field_number("10", 0, 9, &number));
    CHECK(!field_number("9999999999999999999999", 0, INT64_MAX, &number));
    CHECK(field_accepts("text/html, application/x-ndjson;q=0.9", "application/x-ndjson"));
    CHECK(!field_accepts("text/html", "application/x-ndjson") && !field_accepts("", "text/html"));
    CHECK(field_is_type("application/json; charset=utf-8", "application/json"));
    CHECK(!field_is_type("application/jsonx", "application/json"));
    CHECK(field_is_token("X-Y_z9") && !field_is_token("") && !field_is_token("a b") && !field_is_token("a:"));
    return check_result();
}
