/* test_digests.c -- the hash of an output that is written, cut or unreadable while it is read: it is told, and what
 * was read is not remembered. */
#include "server/http/digests.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>

#include "tests/check.h"

#define BYTES 1000

static struct error err;
static int fd;
static enum { NOTHING, CUT, APPEND, TOUCH, INTERRUPT, FAIL } meanwhile; /* at the next read */

ssize_t pread(int from, void *data, size_t length, off_t at) {
    ssize_t (*call)(int, void *, size_t, off_t);
    int what = meanwhile;
    *(void **)&call = dlsym(RTLD_NEXT, "pread");
    meanwhile = NOTHING;
    if (what == CUT)
        CHECK(ftruncate(from, 0) == 0);
    if (what == APPEND)
        CHECK(pwrite(from, "more", 4, BYTES) == 4);
    if (what == TOUCH)
        CHECK(futimens(from, (struct timespec[]){{.tv_sec = 1}, {.tv_sec = 1}}) == 0);
    if (what == INTERRUPT || what == FAIL) {
        errno = what == FAIL ? EIO : EINTR;
        return -1;
    }
    return call(from, data, length, at);
}

static void fill(char byte) {
    char bytes[BYTES];
    memset(bytes, byte, sizeof bytes);
    CHECK(ftruncate(fd, 0) == 0 && pwrite(fd, bytes, sizeof bytes, 0) == BYTES);
}

int main(void) {
    static const struct {
        int meanwhile;
        enum status status;
        const char *word;
    } faults[] = {
        {CUT, STATUS_UNAVAILABLE, "shrank"},
        {APPEND, STATUS_UNAVAILABLE, "changed"},
        {TOUCH, STATUS_UNAVAILABLE, "changed"},
        {FAIL, STATUS_IO, "cannot read"},
    };
    char path[] = "/tmp/unbake-test-digests-XXXXXX", hex[SHA256_HEX_SIZE], wanted[SHA256_HEX_SIZE], bytes[BYTES];
    uint64_t size;
    struct digests *d = digests_new();
    fd = mkstemp(path);
    CHECK(fd >= 0);
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        fill((char)('a' + i));
        meanwhile = faults[i].meanwhile;
        enum status status = digests_of(d, fd, &size, hex, &err);
        CHECK_THAT(status == faults[i].status && strstr(err.message, faults[i].word), "%zu: %s, %s", i, status_name(status),
                   err.message);
        fill((char)('a' + i));
        memset(bytes, (int)('a' + i), sizeof bytes);
        sha256_of(bytes, sizeof bytes, wanted);
        meanwhile = INTERRUPT; /* which is no fault */
        CHECK_THAT(digests_of(d, fd, &size, hex, &err) == STATUS_OK && size == BYTES, "%s", err.message);
        CHECK_STRING(hex, wanted);
        meanwhile = FAIL; /* but it is known by now */
        CHECK(digests_of(d, fd, &size, hex, &err) == STATUS_OK && meanwhile == FAIL);
        meanwhile = NOTHING;
    }
    int folder = open("/tmp", O_RDONLY | O_DIRECTORY);
    CHECK(digests_of(d, folder, &size, hex, &err) == STATUS_CORRUPT);
    close(folder);
    CHECK(digests_of(d, -1, &size, hex, &err) == STATUS_IO);
    close(fd);
    unlink(path);
    digests_free(d);
    return check_result();
}
