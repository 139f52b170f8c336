/* announce.c -- see announce.h. */
#include "server/worker/announce.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#include "common/protocol.h"
#include "common/sha256.h"

enum status announce_file(struct progress *progress, const char *type, const char *path, const char *name,
                          const char *content_type, uint64_t *bytes, struct error *err) {
    char hex[SHA256_HEX_SIZE];
    enum status status = sha256_of_file(path, hex, err);
    return status == STATUS_OK ? announce_known(progress, type, path, name, content_type, hex, bytes, err) : status;
}

enum status announce_known(struct progress *progress, const char *type, const char *path, const char *name,
                           const char *content_type, const char *sha256, uint64_t *bytes, struct error *err) {
    struct stat info;
    if (stat(path, &info) != 0)
        return error_set_errno(err, errno, "cannot access %s", path);
    progress_file(progress, type, name, (uint64_t)info.st_size, sha256, content_type);
    if (bytes)
        *bytes = (uint64_t)info.st_size;
    return STATUS_OK;
}

const char *announce_content_type(const char *name) {
    static const struct {
        const char *ending, *type;
    } known[] = {{".exr", "image/x-exr"}, {".png", "image/png"}, {".json", MIME_JSON}};
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof known / sizeof *known; i++)
        if (strcmp(dot, known[i].ending) == 0)
            return known[i].type;
    return "application/octet-stream";
}
