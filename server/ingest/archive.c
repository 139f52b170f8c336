/* archive.c -- see archive.h.
 *
 *   1. Every name goes through path_clean first.
 *   2. Folders are opened one component at a time from the descriptor of `dir` with O_NOFOLLOW, and files are created
 *      with O_EXCL: nothing that exists is followed or replaced.
 *   3. Bytes are counted as they are written, whatever the entry's header claims.
 *   4. An archive of too many small files is refused by its headers before any is created: creating and removing
 *      100,000 files takes 10 s, reading their headers 0.1 s.
 *   5. gzip is read through zlib: libarchive's own filter does not check the checksum. */
#include "server/ingest/archive.h"

#include <archive.h>
#include <archive_entry.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <locale.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/path.h"

#define BLOCK_BYTES ((size_t)256 << 10) /* read at once */
/* What may follow the end of a tar in the gzip stream: padding, at most one large record. */
#define COUNT_BYTES ((uint64_t)64 << 20) /* of content; larger archives are not counted beforehand */
#define GZIP_TAIL_BYTES ((size_t)16 << 20)

struct unpacking {
    struct archive *archive;
    struct archive_entry *entry; /* our own: libarchive 3.6.2 does not check the allocation of its entry */
    const char *name;            /* for messages */
    const struct archive_limits *limits;
    uint64_t packed_bytes, written_bytes, entry_count, file_count;
    int dir_fd;
    int fd;      /* of the archive; -1 if none is open or zlib owns it */
    char *block; /* [BLOCK_BYTES] */
    gzFile gzip; /* NULL: libarchive reads the file itself */
    char *gzip_block;
    struct error *err;
};

/* Translates libarchive's error: a fault of the file, unless reading it failed. Out of memory, and during format
 * detection, libarchive often sets no message or its own, and only errno is reliable: callers set it to 0 before. */
static enum status library_error(struct unpacking *u, const char *entry) {
    int number = archive_errno(u->archive);
    if (number == ENOMEM || errno == ENOMEM)
        mem_exhausted("libarchive");
    const char *said = archive_error_string(u->archive), *text = said ? said : "unknown fault";
    enum status status = number == EIO || number == EACCES || errno == EIO ? STATUS_IO : STATUS_INPUT;
    if (entry)
        return error_set(u->err, status, "%s: \"%s\" is damaged: %s", u->name, entry, text);
    if (u->entry_count == 0)
        return error_set(u->err, status, "%s cannot be read as a zip, tar, tar.gz or tar.zst archive: %s", u->name,
                         text);
    return error_set(u->err, status, "%s is damaged or cut off: %s", u->name, text);
}

static la_ssize_t read_gzip(struct archive *a, void *user, const void **block) {
    struct unpacking *u = user;
    int got = gzread(u->gzip, u->gzip_block, (unsigned)BLOCK_BYTES), fault = Z_OK;
    const char *text = gzerror(u->gzip, &fault);
    if (fault == Z_MEM_ERROR)
        mem_exhausted("zlib");
    if (got < 0 || (got == 0 && fault != Z_OK && fault != Z_STREAM_END)) {
        const char *fact = strstr(text, ">: "); /* skips zlib's name of the file, "<fd:6>" */
        archive_set_error(a, fault == Z_ERRNO ? errno : EINVAL, "gzip: %s", fact ? fact + 3 : text);
        return -1;
    }
    *block = u->gzip_block;
    return got;
}

/* The checksum is at the end of the stream, which the tar reader does not read by itself. */
static enum status finish_gzip(struct unpacking *u) {
    const void *ignored;
    la_ssize_t got = 0;
    for (size_t total = 0; u->gzip && total < GZIP_TAIL_BYTES; total += (size_t)got) {
        got = read_gzip(u->archive, u, &ignored);
        if (got <= 0)
            break;
    }
    return got < 0 ? library_error(u, NULL) : STATUS_OK;
}

/* Opens the file with zlib if it is gzip. */
static bool open_gzip(struct unpacking *u) {
    unsigned char magic[2] = {0, 0};
    if (pread(u->fd, magic, 2, 0) != 2 || magic[0] != 0x1f || magic[1] != 0x8b)
        return false;
    u->gzip = gzdopen(u->fd, "rb");
    if (!u->gzip)
        mem_exhausted("zlib");
    u->fd = -1;
    u->gzip_block = mem_alloc(BLOCK_BYTES);
    return true;
}

/* archive_read_open and archive_read_open_fd, which in libarchive 3.6.2 do not check their first allocation; existing
 * state is kept. */
static int open_stream(struct unpacking *u) {
    struct archive *a = u->archive;
    if (archive_read_set_callback_data(a, u) != ARCHIVE_OK)
        return ARCHIVE_FATAL;
    if (!open_gzip(u))
        return archive_read_open_fd(a, u->fd, BLOCK_BYTES);
    return archive_read_set_read_callback(a, read_gzip) == ARCHIVE_OK ? archive_read_open1(a) : ARCHIVE_FATAL;
}

/* Only the documented formats and filters: each is a parser of hostile input. */
static enum status open_archive(struct unpacking *u, const char *path) {
    struct archive *a = u->archive;
    struct stat info;
    u->fd = open(path, O_RDONLY | O_CLOEXEC);
    if (u->fd < 0 || fstat(u->fd, &info) != 0)
        return error_set_errno(u->err, errno, "cannot open %s", u->name);
    u->packed_bytes = (uint64_t)info.st_size;
    if (archive_read_support_format_zip(a) != ARCHIVE_OK || archive_read_support_format_tar(a) != ARCHIVE_OK ||
        archive_read_support_filter_zstd(a) != ARCHIVE_OK) {
        if (archive_errno(a) == ENOMEM)
            mem_exhausted("libarchive");
        return error_set(u->err, STATUS_INTERNAL, "libarchive lacks zip, tar or zstd: %s", archive_error_string(a));
    }
    errno = 0;
    return open_stream(u) == ARCHIVE_OK ? STATUS_OK : library_error(u, NULL);
}

/* Description of an entry that is neither file nor folder; NULL for these two. */
static const char *forbidden_kind(struct archive_entry *entry) {
    if (archive_entry_hardlink(entry))
        return "a hard link";
    switch (archive_entry_filetype(entry)) {
    case AE_IFREG:
    case AE_IFDIR: return NULL;
    case AE_IFLNK: return "a symbolic link";
    case AE_IFCHR:
    case AE_IFBLK: return "a device";
    case AE_IFIFO: return "a pipe";
    case AE_IFSOCK: return "a socket";
    default: return "of an unknown kind";
    }
}

static enum status check_entry(struct unpacking *u, struct archive_entry *entry, const char *path) {
    const char *kind = forbidden_kind(entry);
    if (kind)
        return error_set(u->err, STATUS_INPUT, "%s: \"%s\" is %s; only files and folders are taken", u->name, path,
                         kind);
    if (archive_entry_is_encrypted(entry)) {
        error_set(u->err, STATUS_INPUT, "%s: \"%s\" is encrypted", u->name, path);
        return error_hint(u->err, "pack it again without a password");
    }
    if (archive_entry_size_is_set(entry) && archive_entry_size(entry) > 0 &&
        (uint64_t)archive_entry_size(entry) > u->limits->total_bytes)
        return error_set(u->err, STATUS_LIMIT,
                         "%s: \"%s\" says it is %" PRId64 " bytes; a bundle may unpack to %" PRIu64, u->name, path,
                         (int64_t)archive_entry_size(entry), u->limits->total_bytes);
    return STATUS_OK;
}

/* Opens the folder `path` below the root, creating missing ones; -1 with *err set. An empty path duplicates the
 * root's descriptor. */
static int open_folder(struct unpacking *u, const char *path, size_t length, enum status *status) {
    int at = fcntl(u->dir_fd, F_DUPFD_CLOEXEC, 0);
    for (size_t start = 0; at >= 0 && start < length;) {
        size_t n = strcspn(path + start, "/");
        n = start + n > length ? length - start : n;
        char *part = mem_strndup(path + start, n);
        int next = -1;
        if (mkdirat(at, part, 0700) == 0 || errno == EEXIST)
            next = openat(at, part, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        mem_free(part);
        int number = errno;
        close(at);
        errno = number;
        at = next;
        start += n + 1;
    }
    if (at < 0 && (errno == ENOTDIR || errno == ELOOP))
        *status =
            error_set(u->err, STATUS_INPUT, "%s: \"%.*s\" is both a file and a folder", u->name, (int)length, path);
    else if (at < 0)
        *status = error_set_errno(u->err, errno, "cannot make folder %.*s", (int)length, path);
    return at;
}

static enum status count_bytes(struct unpacking *u, size_t bytes) {
    u->written_bytes += bytes;
    if (u->written_bytes > u->limits->total_bytes)
        return error_set(u->err, STATUS_LIMIT, "%s unpacks to more than %" PRIu64 " bytes, the limit", u->name,
                         u->limits->total_bytes);
    if (u->written_bytes > ARCHIVE_RATIO_FREE_BYTES &&
        (double)u->written_bytes > u->limits->ratio * (double)u->packed_bytes)
        return error_set(u->err, STATUS_LIMIT, "%s unpacks to more than %.0f times its size of %" PRIu64 " bytes",
                         u->name, u->limits->ratio, u->packed_bytes);
    return STATUS_OK;
}

static enum status write_content(struct unpacking *u, int fd, const char *path) {
    for (;;) {
        errno = 0;
        la_ssize_t got = archive_read_data(u->archive, u->block, BLOCK_BYTES);
        if (got == 0)
            return STATUS_OK;
        /* a warning means a wrong checksum or size: the content is not usable either */
        if (got < 0)
            return library_error(u, path);
        enum status status = count_bytes(u, (size_t)got);
        if (status == STATUS_OK)
            status = file_write_all(fd, u->block, (size_t)got, path, u->err);
        if (status != STATUS_OK)
            return status;
    }
}

static enum status unpack_file(struct unpacking *u, const char *path) {
    enum status status = STATUS_OK;
    const char *base = path_base(path);
    size_t folder_length = base > path ? (size_t)(base - path) - 1 : 0;
    int folder = open_folder(u, path, folder_length, &status);
    if (folder < 0)
        return status;
    int fd = openat(folder, base, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (fd < 0 && errno == EEXIST)
        status = error_set(u->err, STATUS_INPUT, "%s holds \"%s\" twice", u->name, path);
    else if (fd < 0)
        status = error_set_errno(u->err, errno, "cannot create %s", path);
    close(folder);
    if (fd < 0)
        return status;
    status = write_content(u, fd, path);
    if (close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(u->err, errno, "cannot write %s", path);
    u->file_count++;
    return status;
}

static enum status unpack_entry(struct unpacking *u, struct archive_entry *entry) {
    const char *raw = archive_entry_pathname_utf8(entry);
    if (!raw)
        raw = archive_entry_pathname(entry);
    if (!raw || raw[0] == '\0')
        return error_set(u->err, STATUS_INPUT, "%s: entry %" PRIu64 " has no name in UTF-8", u->name, u->entry_count);
    char *path;
    enum status status = path_clean(raw, &path, u->err);
    if (status != STATUS_OK)
        return error_prefix(u->err, "%s", u->name);
    if (path_is_litter(path))
        goto out;
    status = check_entry(u, entry, path);
    if (status != STATUS_OK)
        goto out;
    if (archive_entry_filetype(entry) == AE_IFDIR) {
        int folder = open_folder(u, path, strlen(path), &status);
        if (folder >= 0)
            close(folder);
    } else if (path[0] == '\0') {
        status =
            error_set(u->err, STATUS_INPUT, "%s: entry %" PRIu64 " is a file without a name", u->name, u->entry_count);
    } else {
        status = unpack_file(u, path);
    }
out:
    mem_free(path);
    return status;
}

static enum status check_count(struct unpacking *u) {
    if (++u->entry_count <= u->limits->file_count)
        return STATUS_OK;
    return error_set(u->err, STATUS_LIMIT, "%s holds more than %" PRIu64 " files, the limit", u->name,
                     u->limits->file_count);
}

/* Counts the headers at the archive's beginning. Other errors are left for unpack_all to report. */
static enum status count_entries(struct unpacking *u) {
    uint64_t bytes = 0;
    while (bytes <= COUNT_BYTES) {
        int result = archive_read_next_header2(u->archive, u->entry);
        if (result != ARCHIVE_OK && result != ARCHIVE_WARN)
            return STATUS_OK;
        int64_t size = archive_entry_size_is_set(u->entry) ? archive_entry_size(u->entry) : 0;
        bytes += size > 0 ? (uint64_t)size : 0;
        enum status status = check_count(u);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status unpack_all(struct unpacking *u) {
    for (;;) {
        errno = 0;
        int result = archive_read_next_header2(u->archive, u->entry);
        if (result == ARCHIVE_EOF)
            break;
        /* warnings concern attributes and names; names are checked below */
        if (result != ARCHIVE_OK && result != ARCHIVE_WARN)
            return library_error(u, NULL);
        enum status status = check_count(u);
        if (status == STATUS_OK)
            status = unpack_entry(u, u->entry);
        if (status != STATUS_OK)
            return status;
    }
    if (u->file_count == 0)
        return error_set(u->err, STATUS_INPUT, "%s holds no files", u->name);
    return finish_gzip(u);
}

/* Reads the archive from its beginning and calls `work` with it open. */
static enum status read_archive(struct unpacking *u, const char *path, enum status (*work)(struct unpacking *u)) {
    u->archive = archive_read_new();
    u->entry = archive_entry_new();
    u->fd = -1;
    u->entry_count = 0;
    if (!u->archive || !u->entry)
        mem_exhausted("libarchive");
    enum status status = open_archive(u, path);
    if (status == STATUS_OK)
        status = work(u);
    archive_read_free(u->archive);
    archive_entry_free(u->entry);
    if (u->gzip)
        gzclose_r(u->gzip);
    u->gzip = NULL;
    if (u->fd >= 0)
        close(u->fd);
    mem_free(u->gzip_block);
    u->gzip_block = NULL;
    return status;
}

static enum status count_and_unpack(struct unpacking *u, const char *path, const char *dir) {
    enum status status = read_archive(u, path, count_entries);
    if (status != STATUS_OK)
        return status;
    if (mkdir(dir, 0700) != 0)
        return error_set_errno(u->err, errno, "cannot create folder %s", dir);
    u->dir_fd = open(dir, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    status = u->dir_fd < 0 ? error_set_errno(u->err, errno, "cannot open folder %s", dir)
                           : read_archive(u, path, unpack_all);
    if (u->dir_fd >= 0)
        close(u->dir_fd);
    if (status != STATUS_OK)
        file_remove_tree(dir, NULL);
    return status;
}

enum status archive_unpack(const char *path, const char *name, const char *dir, const struct archive_limits *limits,
                           struct error *err) {
    struct unpacking u = {.name = name, .limits = limits, .err = err, .dir_fd = -1, .block = mem_alloc(BLOCK_BYTES)};
    /* libarchive converts names to the locale's character set and drops what it cannot convert; the daemon's "C"
     * locale is ASCII only. Set for this thread and this call. */
    locale_t utf8 = newlocale(LC_CTYPE_MASK, "C.UTF-8", (locale_t)0), previous = (locale_t)0;
    if (utf8)
        previous = uselocale(utf8);
    else if (errno == ENOMEM)
        mem_exhausted("libc");
    enum status status = count_and_unpack(&u, path, dir);
    if (utf8) {
        uselocale(previous);
        freelocale(utf8);
    }
    mem_free(u.block);
    return status;
}
