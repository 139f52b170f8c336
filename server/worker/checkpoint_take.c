/* checkpoint_take.c -- checkpoint_parts_take of checkpoint_parts.h. Parts come from another machine: nothing in them is
 * believed that is not checked. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/hash64.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/worker/checkpoint_part.h"
#include "server/worker/checkpoint_parts.h"

struct taking {
    struct checkpoint_file *f;
    const char *dir;
    struct part_head head; /* of the newest part */
    struct open_part {
        int fd; /* -1: not opened yet */
        uint64_t data_start;
    } * part;          /* [part_count], from head.first on */
    size_t part_count; /* 0: none is open */
    void *bytes;       /* of one tile */
};

static enum status open_part(const struct taking *t, int number, struct part_head *head, struct open_part *part,
                             struct error *err) {
    char *path = layout_part(t->dir, number);
    part->fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    *head = (struct part_head){0};
    enum status status = part->fd >= 0     ? part_head_read(head, part->fd, path, &part->data_start, err)
                         : errno == ENOENT ? error_set(err, STATUS_CORRUPT, "%s is missing", path)
                                           : error_set_errno(err, errno, "cannot open %s", path);
    if (status == STATUS_OK && head->number != number)
        status = error_set(err, STATUS_CORRUPT, "%s says that it is part %d", path, head->number);
    mem_free(path);
    return status;
}

/* Opens the newest part and checks what its head says of the whole. */
static enum status begin(struct taking *t, int newest, struct error *err) {
    struct open_part part = {.fd = -1};
    enum status status = open_part(t, newest, &t->head, &part, err);
    if (status == STATUS_OK && newest - t->head.first >= PARTS_KEPT_MAX)
        status = error_set(err, STATUS_CORRUPT, "it has more than %d parts", PARTS_KEPT_MAX);
    if (status != STATUS_OK) {
        if (part.fd >= 0)
            close(part.fd);
        return status;
    }
    t->part_count = (size_t)(newest - t->head.first) + 1;
    t->part = mem_array(t->part_count, sizeof *t->part);
    for (size_t i = 0; i + 1 < t->part_count; i++)
        t->part[i] = (struct open_part){.fd = -1};
    t->part[t->part_count - 1] = part;
    if (t->head.format < 1 || t->head.format > STATE_FORMAT)
        return error_set(err, STATUS_CORRUPT, "it has format %d, this program reads up to %d", t->head.format,
                         STATE_FORMAT);
    if (strcmp(t->head.fingerprint, t->f->fingerprint) != 0)
        return error_set(err, STATUS_CORRUPT, "it belongs to another scene, another reading of it or other settings");
    return STATUS_OK;
}

static void end(struct taking *t) {
    for (size_t i = 0; i < t->part_count; i++)
        if (t->part[i].fd >= 0)
            close(t->part[i].fd);
    mem_free(t->part);
    mem_free(t->bytes);
    part_head_release(&t->head);
}

/* Reads a tile into t->bytes and checks it. */
static enum status read_tile(struct taking *t, const struct part_tile *tile, size_t bytes, struct error *err) {
    struct open_part *part = &t->part[tile->part - t->head.first];
    enum status status = STATUS_OK;
    if (part->fd < 0) {
        struct part_head head;
        status = open_part(t, tile->part, &head, part, err);
        part_head_release(&head);
    }
    size_t done = 0;
    while (status == STATUS_OK && done < bytes) {
        ssize_t got =
            pread(part->fd, (char *)t->bytes + done, bytes - done, (off_t)(part->data_start + tile->offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            status = error_set_errno(err, errno, "cannot read part %d", tile->part);
        else if (got == 0)
            status = error_set(err, STATUS_CORRUPT, "part %d is cut off", tile->part);
        done += got > 0 ? (size_t)got : 0;
    }
    if (status == STATUS_OK && hash64(t->bytes, bytes, 0) != tile->hash)
        status = error_set(err, STATUS_CORRUPT, "a tile of part %d fails its check", tile->part);
    return status;
}

/* Enters array number `i` with its tiles, the first of which gets the row *row. */
static enum status enter_array(struct taking *t, size_t i, struct stored_array *to, int64_t *row, struct error *err) {
    const struct part_array *from = &t->head.array[i];
    *to = (struct stored_array){.name = mem_strdup(from->name),
                                .bytes = from->bytes,
                                .tile_count = from->tile_count,
                                .tile = mem_calloc(from->tile_count ? from->tile_count : 1, sizeof *to->tile)};
    enum status status = sql_run(&t->f->sql, err, "INSERT INTO arrays (number, name, bytes) VALUES (?, ?, ?)", "iti",
                                 (int64_t)i, from->name, (int64_t)from->bytes);
    for (size_t n = 0; n < from->tile_count && status == STATUS_OK; n++) {
        size_t bytes = checkpoint_file_tile_bytes(from->bytes, n);
        to->tile[n] = (struct checkpoint_tile){.row = (*row)++, .hash = from->tile[n].hash};
        status = read_tile(t, &from->tile[n], bytes, err);
        if (status == STATUS_OK)
            status = sql_run(
                &t->f->sql, err, "INSERT INTO tiles (id, array, number, hash, data) VALUES (?, ?, ?, ?, ?)", "iiiib",
                to->tile[n].row, (int64_t)i, (int64_t)n, (int64_t)from->tile[n].hash, (const void *)t->bytes, bytes);
    }
    return status;
}

static enum status enter_heads(struct taking *t, const struct stored_array *array, struct error *err) {
    const struct part_head *head = &t->head;
    char format[48];
    if (checkpoint_file_digest(array, head->array_count, head->iteration, head->fingerprint) != head->digest)
        return error_set(err, STATUS_CORRUPT, "the digest of its tiles does not match");
    snprintf(format, sizeof format, "PRAGMA user_version=%d", head->format);
    enum status status = sql_run(
        &t->f->sql, err, "INSERT INTO newest (id, fingerprint, program, iteration, digest) VALUES (1, ?, ?, ?, ?)",
        "ttii", head->fingerprint, head->program, (int64_t)head->iteration, (int64_t)head->digest);
    return status == STATUS_OK ? sql_script(&t->f->sql, format, err) : status;
}

/* Replaces what the file holds by what the parts do, in one transaction. */
static enum status enter(struct taking *t, struct error *err) {
    struct checkpoint_file *f = t->f;
    size_t count = t->head.array_count;
    struct stored_array *array = mem_calloc(count ? count : 1, sizeof *array);
    int64_t row = 1;
    t->bytes = mem_alloc(CHECKPOINT_TILE_BYTES);
    enum status status = sql_begin(&f->sql, err);
    if (status == STATUS_OK) {
        status = sql_script(&f->sql, "DELETE FROM newest; DELETE FROM arrays; DELETE FROM tiles", err);
        for (size_t i = 0; i < count && status == STATUS_OK; i++)
            status = enter_array(t, i, &array[i], &row, err);
        if (status == STATUS_OK)
            status = enter_heads(t, array, err);
        status = sql_end(&f->sql, status, err);
    }
    if (status != STATUS_OK) {
        checkpoint_file_release(array, count);
        return status;
    }
    checkpoint_file_forget(f);
    f->array = array;
    f->array_count = count;
    f->next_row = row;
    f->iteration = t->head.iteration;
    f->format = t->head.format;
    f->program = mem_strdup(t->head.program);
    f->complete = true;
    return STATUS_OK;
}

enum status checkpoint_parts_take(struct checkpoint_file *f, const char *dir, int *next, char note[512],
                                  struct error *err) {
    struct taking t = {.f = f, .dir = dir};
    struct error why;
    int *numbers;
    size_t count;
    note[0] = '\0';
    *next = 1;
    enum status status = file_list_numbered(dir, layout_part_number, &numbers, &count, err);
    if (status == STATUS_OK && count > 0) {
        *next = numbers[count - 1] + 1;
        status = begin(&t, numbers[count - 1], &why);
        if (status == STATUS_OK)
            status = enter(&t, &why);
        end(&t);
        if (status == STATUS_CORRUPT) {
            snprintf(note, 512, "the checkpoint that was sent cannot be used: %.400s", why.message);
            status = STATUS_OK;
        } else if (status != STATUS_OK && err) {
            *err = why;
        }
    }
    /* The oldest first: what is left by a crash is no whole checkpoint. */
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        char *path = layout_part(dir, numbers[i]);
        status = file_remove_tree(path, err);
        mem_free(path);
    }
    mem_free(numbers);
    return status;
}
