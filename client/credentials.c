/* credentials.c -- see credentials.h. */
#include "client/credentials.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

#define FILE_MAX_BYTES ((size_t)1 << 20) /* of the file of tokens */

char *credentials_folder_file(const char *name) {
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    if (config && config[0] == '/')
        return mem_printf("%s/unbake/%s", config, name);
    return home && home[0] == '/' ? mem_printf("%s/.config/unbake/%s", home, name) : NULL;
}

/* The file's text, "" where there is none. */
static enum status read_all(const char *path, struct buf *text, struct error *err) {
    struct stat info;
    buf_init(text, FILE_MAX_BYTES);
    if (stat(path, &info) != 0)
        return errno == ENOENT || errno == ENOTDIR ? STATUS_OK : error_set_errno(err, errno, "cannot access %s", path);
    if ((info.st_mode & 077) != 0 || info.st_uid != geteuid()) {
        error_set(err, STATUS_IO, "%s can be read by others: its tokens are not used", path);
        return error_hint(err, "chmod 600 %s", path);
    }
    return file_read(path, text, err);
}

/* Whether `line` belongs to that server; *token is then what follows its URL. */
static bool is_of(const char *line, const char *server, const char **token) {
    size_t length = strlen(server);
    if (strncmp(line, server, length) != 0 || line[length] != ' ')
        return false;
    *token = line + length + 1;
    return true;
}

enum status credentials_find(const char *server, char **token, struct error *err) {
    struct buf text;
    char *path = credentials_folder_file("tokens");
    *token = NULL;
    if (!path)
        return STATUS_OK;
    enum status status = read_all(path, &text, err);
    const char *found;
    for (const char *line = buf_text(&text); status == STATUS_OK && *line;) {
        if (!*token && is_of(line, server, &found))
            *token = mem_strndup(found, strcspn(found, "\r\n"));
        line += strcspn(line, "\n");
        line += *line == '\n';
    }
    buf_release(&text);
    mem_free(path);
    return status;
}

enum status credentials_read(const char *path, char **token, struct error *err) {
    struct buf text;
    *token = NULL;
    if (access(path, F_OK) != 0)
        return error_set_errno(err, errno, "cannot read the token in %s", path);
    enum status status = read_all(path, &text, err);
    const char *begin = buf_text(&text) + strspn(buf_text(&text), " \t\r\n");
    size_t length = 0;
    while (begin[length] > ' ' && begin[length] <= '~') /* what a token may have */
        length++;
    if (status == STATUS_OK && (length == 0 || begin[length + strspn(begin + length, " \t\r\n")] != '\0'))
        status = error_set(err, STATUS_INPUT, "%s does not hold a token, and nothing else", path);
    if (status == STATUS_OK)
        *token = mem_strndup(begin, length);
    buf_release(&text);
    return status;
}

/* Unlike file_replace, never makes the file readable by others, not even for a moment. */
static enum status replace(const char *path, const struct buf *text, struct error *err) {
    char *temporary = mem_printf("%s.XXXXXX", path);
    enum status status = STATUS_OK;
    int fd = mkostemp(temporary, O_CLOEXEC); /* mode 0600 */
    if (fd < 0) {
        status = error_set_errno(err, errno, "cannot create a file beside %s", path);
        mem_free(temporary);
        return status;
    }
    status = file_write_all(fd, buf_text(text), text->length, path, err);
    if (status == STATUS_OK && fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync %s", path);
    close(fd);
    if (status == STATUS_OK && rename(temporary, path) != 0)
        status = error_set_errno(err, errno, "cannot rename to %s", path);
    if (status != STATUS_OK)
        unlink(temporary);
    mem_free(temporary);
    return status;
}

enum status credentials_keep(const char *server, const char *token, struct error *err) {
    struct buf text, kept;
    char *path = credentials_folder_file("tokens");
    if (!path)
        return error_set(err, STATUS_IO, "there is no home folder to keep a token in: HOME is not set");
    char *dir = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    buf_init(&kept, FILE_MAX_BYTES);
    enum status status = read_all(path, &text, err);
    const char *other;
    for (const char *line = buf_text(&text); status == STATUS_OK && *line;) {
        size_t length = strcspn(line, "\n");
        if (length > 0 && !is_of(line, server, &other)) {
            buf_append(&kept, line, length);
            buf_puts(&kept, "\n");
        }
        line += length + (line[length] == '\n');
    }
    if (token)
        buf_printf(&kept, "%s %s\n", server, token);
    if (status == STATUS_OK)
        status = file_make_dirs(dir, err);
    if (status == STATUS_OK)
        status = replace(path, &kept, err);
    buf_release(&text);
    buf_release(&kept);
    mem_free(dir);
    mem_free(path);
    return status;
}
