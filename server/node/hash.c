/* hash.c -- see hash.h. */
#include "server/node/hash.h"

#include <errno.h>
#include <unistd.h>

#include "common/mem.h"

#define READ_BYTES ((size_t)1 << 20) /* read at once */
#define HASH_STEP ((off_t)64 << 20)  /* a second, from a slow network's file system */

enum status hash_file(int fd, bool (*go_on)(void *user, struct error *err), void *user, char hex[SHA256_HEX_SIZE],
                      struct error *err) {
    struct sha256 hash;
    char *bytes = mem_alloc(READ_BYTES);
    enum status status = STATUS_OK;
    off_t at = 0, next = HASH_STEP;
    ssize_t got = 1;
    sha256_init(&hash);
    while (status == STATUS_OK && got != 0) {
        got = pread(fd, bytes, READ_BYTES, at);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            status = error_set_errno(err, errno, "cannot read a file that is to be checked");
        if (got > 0)
            sha256_update(&hash, bytes, (size_t)got);
        at += got > 0 ? got : 0;
        if (status == STATUS_OK && at >= next) {
            next = at + HASH_STEP;
            status = go_on(user, err) ? STATUS_OK : STATUS_CANCELLED;
        }
    }
    if (status == STATUS_OK)
        sha256_hex(&hash, hex);
    mem_free(bytes);
    return status;
}
