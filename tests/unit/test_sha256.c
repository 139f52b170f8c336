/* test_sha256.c -- the vectors of FIPS 180-4 and its appendix, split in every way, and files; and the compression
 * function in the forms that this processor can run: each has the vectors, and all agree. */
#include "common/sha256.h"

#include "common/sha256_blocks.h"

#include "tests/check.h"

#define MILLION 1000000

static void check_digest(const void *data, size_t length, const char *wanted) {
    char hex[SHA256_HEX_SIZE];
    sha256_of(data, length, hex);
    CHECK_STRING(hex, wanted);
}

static void known_digests(void) {
    check_digest("", 0, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    check_digest("abc", 3, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    check_digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56,
                 "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

/* The digest must not depend on how the bytes are handed over. */
static void split_updates(void) {
    unsigned char text[300];
    for (size_t i = 0; i < sizeof text; i++)
        text[i] = (unsigned char)(i * 7);
    char whole[SHA256_HEX_SIZE], split[SHA256_HEX_SIZE];
    for (size_t length = 0; length <= sizeof text; length++) {
        sha256_of(text, length, whole);
        struct sha256 s;
        sha256_init(&s);
        for (size_t at = 0, step = 1; at < length; at += step, step = step % 70 + 13) {
            if (step > length - at)
                step = length - at;
            sha256_update(&s, text + at, step);
        }
        sha256_hex(&s, split);
        CHECK_STRING(split, whole);
    }
}

/* FIPS 180-4, 5.1.1: the whole message in blocks, through one form of the compression function. */
static void digest_by(sha256_blocks *blocks, const void *data, size_t length, char hex[SHA256_HEX_SIZE]) {
    struct sha256 s;
    size_t count = (length + 9 + 63) / 64;
    uint8_t *padded = calloc(count, 64);
    CHECK(padded);
    if (length > 0)
        memcpy(padded, data, length);
    padded[length] = 0x80;
    for (size_t i = 0; i < 8; i++)
        padded[64 * count - 1 - i] = (uint8_t)((uint64_t)length * 8 >> (8 * i));
    sha256_init(&s);
    blocks(s.state, padded, count);
    for (size_t i = 0; i < 8; i++)
        snprintf(hex + 8 * i, 9, "%08x", s.state[i]);
    free(padded);
}

static void check_form(sha256_blocks *blocks) {
    char hex[SHA256_HEX_SIZE];
    digest_by(blocks, "", 0, hex);
    CHECK_STRING(hex, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    digest_by(blocks, "abc", 3, hex);
    CHECK_STRING(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    digest_by(blocks, "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56, hex);
    CHECK_STRING(hex, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    /* NIST's byte-oriented test vectors: SHA256ShortMsg, Len = 440. */
    static const uint8_t message[55] = {0x3e, 0xbf, 0xb0, 0x6d, 0xb8, 0xc3, 0x8d, 0x5b, 0xa0, 0x37, 0xf1,
                                        0x36, 0x3e, 0x11, 0x85, 0x50, 0xaa, 0xd9, 0x46, 0x06, 0xe2, 0x68,
                                        0x35, 0xa0, 0x1a, 0xf0, 0x50, 0x78, 0x53, 0x3c, 0xc2, 0x5f, 0x2f,
                                        0x39, 0x57, 0x3c, 0x04, 0xb6, 0x32, 0xf6, 0x2f, 0x68, 0xc2, 0x94,
                                        0xab, 0x31, 0xf2, 0xa3, 0xe2, 0xa1, 0xa0, 0xd8, 0xc2, 0xbe, 0x51};
    digest_by(blocks, message, sizeof message, hex);
    CHECK_STRING(hex, "6595a2ef537a69ba8583dfbf7f5bec0ab1f93ce4c8ee1916eff44a93af5749c4");
}

static void forms(void) {
    enum { LONGEST = 5000, ROUNDS = 300 };
    sha256_blocks *native = sha256_blocks_native();
    check_form(sha256_blocks_portable);
    if (!native) {
        puts("this processor has no instructions for SHA-256: only the portable form is tested");
        return;
    }
    check_form(native);
    uint8_t *text = malloc(LONGEST + 1);
    uint32_t state = 1;
    for (int round = 0; round < ROUNDS; round++) {
        char one[SHA256_HEX_SIZE], other[SHA256_HEX_SIZE], whole[SHA256_HEX_SIZE];
        state = state * 1664525 + 1013904223; /* Numerical Recipes */
        size_t length = (state >> 8) % LONGEST, shift = state >> 7 & 1;
        for (size_t i = 0; i < length; i++)
            text[shift + i] = (uint8_t)((state = state * 1664525 + 1013904223) >> 24);
        digest_by(sha256_blocks_portable, text + shift, length, one);
        digest_by(native, text + shift, length, other);
        sha256_of(text + shift, length, whole);
        CHECK_STRING(other, one);
        CHECK_STRING(whole, one);
    }
    free(text);
}

static void files(void) {
    char path[] = "/tmp/unbake-sha256-XXXXXX";
    int fd = mkstemp(path);
    CHECK(fd >= 0);
    char *text = malloc(MILLION);
    memset(text, 'a', MILLION);
    CHECK(write(fd, text, MILLION) == MILLION);
    close(fd);
    char hex[SHA256_HEX_SIZE];
    struct error err;
    CHECK(sha256_of_file(path, hex, &err) == STATUS_OK);
    CHECK_STRING(hex, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    free(text);
    unlink(path);
    CHECK(sha256_of_file(path, hex, &err) == STATUS_NOT_FOUND);
    CHECK(sha256_of_file("/", hex, &err) == STATUS_IO);
}

int main(void) {
    known_digests();
    split_updates();
    forms();
    files();
    return check_result();
}
