/* test_sha256.c -- the vectors of FIPS 180-4 and its appendix, split in every way, and files. */
#include "common/sha256.h"

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
    files();
    return check_result();
}
