/* pack.c -- see pack.h.
 *
 * libarchive pushes what it writes and curl pulls what it sends; between the two stands a
 * buffer: when it is empty, one step is taken (an entry's header, a chunk of its content, the
 * archive's end), which fills it again. */
#include "client/pack.h"

#include <archive.h>
#include <archive_entry.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"

#define CHUNK 65536 /* bytes that are read at once */
#define DEEPEST 32  /* nested folders; a deeper path is a loop of links */

struct pack_entry {
    char *name; /* inside the archive; owned */
    uint64_t bytes;
};

struct pack {
    char *path; /* owned */
    bool is_folder;
    struct pack_entry *entry; /* [count] sorted by name; the file itself if path is not a folder */
    size_t count, capacity;
    uint64_t content_bytes;

    /* The stream. */
    struct archive *archive; /* NULL if path is not a folder, and after the end is written */
    struct buf ready;        /* written by libarchive, not yet read */
    size_t ready_taken;
    size_t next;   /* index of the next entry */
    int fd;        /* of entry[next - 1], -1 between entries */
    uint64_t left; /* bytes left of that file */
    char chunk[CHUNK];
};

static void add_entry(struct pack *p, const char *name, uint64_t bytes) {
    if (p->count == p->capacity) {
        p->capacity = p->capacity ? 2 * p->capacity : 256;
        p->entry = mem_realloc_array(p->entry, p->capacity, sizeof *p->entry);
    }
    p->entry[p->count++] = (struct pack_entry){.name = mem_strdup(name), .bytes = bytes};
    p->content_bytes += bytes;
}

static int by_name(const void *a, const void *b) {
    return strcmp(((const struct pack_entry *)a)->name, ((const struct pack_entry *)b)->name);
}

/* What stat cannot reach: the name was just listed, so what is not there is what a link leads to. */
static enum status refuse_entry(const char *path, int number, struct error *err) {
    error_set_errno(err, number, "cannot access %s", path);
    return number == ENOENT ? error_hint(err, "it is a link to what is not there: remove it, or put that in its place")
                            : err->status;
}

/* Adds the files under `folder`; their names in the archive begin with `prefix`. */
static enum status list_folder(struct pack *p, const char *folder, const char *prefix, int depth, struct error *err) {
    if (depth > DEEPEST)
        return error_set(err, STATUS_INPUT, "%s: folders are more than %d deep: do links lead back?", folder, DEEPEST);
    char **names;
    size_t count;
    enum status status = file_list(folder, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        if (names[i][0] == '.' || strcmp(names[i], "__MACOSX") == 0)
            continue;
        char *path = file_join(folder, names[i]);
        char *name = mem_printf("%s%s", prefix, names[i]);
        struct stat info;
        if (stat(path, &info) != 0)
            status = refuse_entry(path, errno, err);
        else if (S_ISREG(info.st_mode))
            add_entry(p, name, (uint64_t)info.st_size);
        else if (S_ISDIR(info.st_mode)) {
            char *inner = mem_printf("%s/", name);
            status = list_folder(p, path, inner, depth + 1, err);
            mem_free(inner);
        } else
            status = error_set(err, STATUS_INPUT, "%s is neither a file nor a folder", path);
        mem_free(name);
        mem_free(path);
    }
    file_free_names(names, count);
    return status;
}

enum status pack_open(struct pack **pack, const char *path, struct error *err) {
    struct stat info;
    *pack = NULL;
    if (stat(path, &info) != 0)
        return error_set_errno(err, errno, "cannot access %s", path);
    if (!S_ISDIR(info.st_mode) && !S_ISREG(info.st_mode))
        return error_set(err, STATUS_INPUT, "%s is neither a file nor a folder", path);
    struct pack *p = mem_calloc(1, sizeof *p);
    p->path = mem_strdup(path);
    p->is_folder = S_ISDIR(info.st_mode);
    p->fd = -1;
    buf_init(&p->ready, 64 * CHUNK);
    enum status status = STATUS_OK;
    if (p->is_folder)
        status = list_folder(p, path, "", 0, err);
    else
        add_entry(p, path, (uint64_t)info.st_size);
    if (status == STATUS_OK && p->content_bytes == 0)
        status = error_set(err, STATUS_INPUT, p->is_folder ? "%s holds no files" : "%s is empty", path);
    if (status != STATUS_OK) {
        pack_close(p);
        return status;
    }
    qsort(p->entry, p->count, sizeof *p->entry, by_name);
    status = pack_rewind(p, err);
    if (status != STATUS_OK) {
        pack_close(p);
        return status;
    }
    *pack = p;
    return STATUS_OK;
}

static void end_stream(struct pack *p) {
    if (p->archive)
        archive_write_free(p->archive); /* may flush into `ready`, which is dropped next */
    p->archive = NULL;
    buf_clear(&p->ready);
    p->ready_taken = 0;
    p->next = 0;
    if (p->fd >= 0)
        close(p->fd);
    p->fd = -1;
}

void pack_close(struct pack *p) {
    if (!p)
        return;
    end_stream(p);
    for (size_t i = 0; i < p->count; i++)
        mem_free(p->entry[i].name);
    mem_free(p->entry);
    mem_free(p->path);
    buf_release(&p->ready);
    mem_free(p);
}

size_t pack_file_count(const struct pack *p) { return p->count; }

uint64_t pack_content_bytes(const struct pack *p) { return p->content_bytes; }

static la_ssize_t take_written(struct archive *archive, void *user, const void *bytes, size_t length) {
    (void)archive;
    struct pack *p = user;
    return buf_append(&p->ready, bytes, length) ? (la_ssize_t)length : -1;
}

static enum status archive_failed(struct pack *p, struct error *err) {
    const char *why = archive_error_string(p->archive);
    return error_set(err, STATUS_INTERNAL, "cannot pack %s: %s", p->path, why ? why : "unknown");
}

enum status pack_rewind(struct pack *p, struct error *err) {
    end_stream(p);
    if (!p->is_folder)
        return STATUS_OK;
    p->archive = archive_write_new();
    if (!p->archive)
        return error_set(err, STATUS_INTERNAL, "cannot pack %s: libarchive gave no writer", p->path);
    if (archive_write_set_format_gnutar(p->archive) != ARCHIVE_OK ||
        archive_write_add_filter_none(p->archive) != ARCHIVE_OK ||
        archive_write_set_bytes_per_block(p->archive, 0) != ARCHIVE_OK ||
        archive_write_open(p->archive, p, NULL, take_written, NULL) != ARCHIVE_OK)
        return archive_failed(p, err);
    return STATUS_OK;
}

static enum status write_header(struct pack *p, const struct pack_entry *e, struct error *err) {
    struct archive_entry *header = archive_entry_new();
    archive_entry_set_pathname(header, e->name);
    archive_entry_set_filetype(header, AE_IFREG);
    archive_entry_set_perm(header, 0644);
    archive_entry_set_size(header, (la_int64_t)e->bytes);
    archive_entry_set_mtime(header, 0, 0);
    archive_entry_set_uid(header, 0);
    archive_entry_set_gid(header, 0);
    int code = archive_write_header(p->archive, header);
    archive_entry_free(header);
    return code == ARCHIVE_OK ? STATUS_OK : archive_failed(p, err);
}

static enum status open_next(struct pack *p, struct error *err) {
    const struct pack_entry *e = &p->entry[p->next];
    char *path = p->is_folder ? file_join(p->path, e->name) : mem_strdup(p->path);
    enum status status = STATUS_OK;
    p->fd = open(path, O_RDONLY | O_CLOEXEC);
    if (p->fd < 0)
        status = error_set_errno(err, errno, "cannot open %s", path);
    else if (p->archive)
        status = write_header(p, e, err);
    p->left = e->bytes;
    p->next++;
    mem_free(path);
    return status;
}

static enum status read_chunk(struct pack *p, struct error *err) {
    const struct pack_entry *e = &p->entry[p->next - 1];
    size_t wanted = p->left < CHUNK ? (size_t)p->left : CHUNK;
    ssize_t got = wanted ? read(p->fd, p->chunk, wanted) : 0;
    if (got < 0 && errno == EINTR)
        return STATUS_OK;
    if (got < 0)
        return error_set_errno(err, errno, "cannot read %s", e->name);
    if (wanted && got == 0)
        return error_set(err, STATUS_CONFLICT, "%s became shorter while it was read", e->name);
    if (p->archive && got > 0 && archive_write_data(p->archive, p->chunk, (size_t)got) != got)
        return archive_failed(p, err);
    if (!p->archive)
        buf_append(&p->ready, p->chunk, (size_t)got);
    p->left -= (uint64_t)got;
    if (p->left == 0) {
        close(p->fd);
        p->fd = -1;
    }
    return STATUS_OK;
}

static enum status write_end(struct pack *p, struct error *err) {
    enum status status = STATUS_OK;
    if (archive_write_close(p->archive) != ARCHIVE_OK)
        status = archive_failed(p, err);
    archive_write_free(p->archive);
    p->archive = NULL;
    return status;
}

enum status pack_read(struct pack *p, void *bytes, size_t room, size_t *got, struct error *err) {
    *got = 0;
    while (p->ready_taken == p->ready.length) {
        buf_clear(&p->ready);
        p->ready_taken = 0;
        enum status status;
        if (p->fd >= 0)
            status = read_chunk(p, err);
        else if (p->next < p->count)
            status = open_next(p, err);
        else if (p->archive)
            status = write_end(p, err);
        else
            return STATUS_OK;
        if (status != STATUS_OK)
            return status;
    }
    size_t available = p->ready.length - p->ready_taken;
    *got = available < room ? available : room;
    memcpy(bytes, p->ready.data + p->ready_taken, *got);
    p->ready_taken += *got;
    return STATUS_OK;
}

enum status pack_measure(struct pack *p, bool (*tick)(void *user, uint64_t done), void *user, uint64_t *length,
                         char sha256[SHA256_HEX_SIZE], struct error *err) {
    char *bytes = mem_alloc(CHUNK);
    struct sha256 hash;
    sha256_init(&hash);
    *length = 0;
    enum status status = pack_rewind(p, err);
    while (status == STATUS_OK) {
        size_t got;
        status = pack_read(p, bytes, CHUNK, &got, err);
        if (status != STATUS_OK || got == 0)
            break;
        sha256_update(&hash, bytes, got);
        *length += got;
        if (tick && !tick(user, *length))
            status = error_set(err, STATUS_CANCELLED, "interrupted while reading %s", p->path);
    }
    sha256_hex(&hash, sha256);
    mem_free(bytes);
    return status;
}
