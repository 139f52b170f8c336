/* test_digests.c -- the hash of an output that is written, cut or unreadable while it is read: it is told. */
#include "server/uploads/digests.h"

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

static bool is_of(const struct file_version *v, char byte, const char *hex) {
    char wanted[SHA256_HEX_SIZE], bytes[BYTES];
    memset(bytes, byte, sizeof bytes);
    sha256_of(bytes, sizeof bytes, wanted);
    return v->bytes == BYTES && strcmp(hex, wanted) == 0;
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
    char path[] = "/tmp/unbake-test-digests-XXXXXX", hex[SHA256_HEX_SIZE];
    struct file_version v;
    fd = mkstemp(path);
    CHECK(fd >= 0);
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        fill((char)('a' + i));
        meanwhile = faults[i].meanwhile;
        enum status status = digests_hash(fd, NULL, &v, hex, &err);
        CHECK_THAT(status == faults[i].status && strstr(err.message, faults[i].word), "%zu: %s, %s", i,
                   status_name(status), err.message);
        fill((char)('a' + i));
        meanwhile = INTERRUPT; /* which is no fault */
        CHECK_THAT(digests_hash(fd, NULL, &v, hex, &err) == STATUS_OK, "%s", err.message);
        CHECK(is_of(&v, (char)('a' + i), hex));
    }
    atomic_bool stopping = true;
    CHECK(digests_hash(fd, &stopping, &v, hex, &err) == STATUS_CANCELLED);
    int folder = open("/tmp", O_RDONLY | O_DIRECTORY);
    CHECK(digests_hash(folder, NULL, &v, hex, &err) == STATUS_CORRUPT);
    close(folder);
    CHECK(digests_hash(-1, NULL, &v, hex, &err) == STATUS_IO);
    close(fd);
    unlink(path);
    return check_result();
}
