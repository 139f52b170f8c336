/* SHA-1 against the examples of FIPS 180-4 and RFC 3174, in one piece and in many. */
#include "common/sha1.h"

#include "tests/check.h"

static void check_digest(const char *text, size_t repeats, const char *wanted) {
    struct sha1 s;
    uint8_t digest[SHA1_BYTES];
    char hex[2 * SHA1_BYTES + 1];
    sha1_init(&s);
    for (size_t i = 0; i < repeats; i++)
        sha1_update(&s, text, strlen(text));
    sha1_bytes(&s, digest);
    for (int i = 0; i < SHA1_BYTES; i++)
        snprintf(hex + 2 * i, 3, "%02x", digest[i]);
    CHECK_STRING(hex, wanted);
}

int main(void) {
    check_digest("", 1, "da39a3ee5e6b4b0d3255bfef95601890afd80709");
    check_digest("abc", 1, "a9993e364706816aba3e25717850c26c9cd0d89d");
    check_digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 1,
                 "84983e441c3bd26ebaae4aa1f95129e5e54670f1");
    check_digest("a", 1000000, "34aa973cd4c4daa4f61eeb2bdbad27316534016f");
    check_digest("01234567012345670123456701234567", 20, "dea356a2cddd90c7a7ecedc5ebb563934f460452");
    check_digest("hello world", 1, "2aae6c35c94fcfb415dbe95f408b9ce91ee846ed");
    return check_result();
}
