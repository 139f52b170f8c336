/* checkpoint_parts.c -- the writer of checkpoint_parts.h; checkpoint_take.c is the reader. */
#include "server/worker/checkpoint_parts.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/data/layout.h"
#include "server/worker/checkpoint_part.h"

struct checkpoint_parts {
    char *dir;
    int next;                /* number of the next part */
    struct part_head newest; /* the head of the last one; number 0: none yet */
    size_t kept_count;       /* parts that are needed, oldest first */
    struct kept_part {
        int number;
        uint64_t bytes; /* of its data */
    } * kept;
};

struct checkpoint_parts *checkpoint_parts_new(const char *dir, int next) {
    struct checkpoint_parts *p = mem_calloc(1, sizeof *p);
    p->dir = mem_strdup(dir);
    p->next = next;
    return p;
}

void checkpoint_parts_free(struct checkpoint_parts *p) {
    if (!p)
        return;
    part_head_release(&p->newest);
    mem_free(p->kept);
    mem_free(p->dir);
    mem_free(p);
}

static bool is_carried_away(const struct checkpoint_parts *p) {
    if (p->newest.number == 0)
        return true;
    char *path = layout_part(p->dir, p->newest.number);
    bool is_gone = access(path, F_OK) != 0;
    mem_free(path);
    return is_gone;
}

/* Whether the next part may leave tiles to those before it: they are of the same arrays, and do not take too much. */
static bool may_refer(const struct checkpoint_parts *p, const struct checkpoint_file *f) {
    uint64_t kept = 0, state = 0;
    bool is_same = p->newest.number > 0 && p->newest.array_count == f->array_count;
    for (size_t i = 0; is_same && i < f->array_count; i++) {
        is_same =
            p->newest.array[i].bytes == f->array[i].bytes && strcmp(p->newest.array[i].name, f->array[i].name) == 0;
        state += f->array[i].bytes;
    }
    for (size_t i = 0; i < p->kept_count; i++)
        kept += p->kept[i].bytes;
    return is_same && kept <= PARTS_STRETCH * state && p->next - p->newest.first < PARTS_KEPT_MAX;
}

/* The head of the next part; *data_bytes: of the tiles that it holds itself. */
static struct part_head make_head(const struct checkpoint_parts *p, const struct checkpoint_file *f,
                                  uint64_t *data_bytes) {
    bool refers = may_refer(p, f);
    struct part_head head = {.number = p->next,
                             .first = p->next,
                             .format = STATE_FORMAT,
                             .program = mem_strdup(UNBAKE_VERSION),
                             .fingerprint = mem_strdup(f->fingerprint),
                             .iteration = f->iteration,
                             .digest = checkpoint_file_digest(f->array, f->array_count, f->iteration, f->fingerprint),
                             .array_count = f->array_count,
                             .array = mem_calloc(f->array_count ? f->array_count : 1, sizeof *head.array)};
    *data_bytes = 0;
    for (size_t i = 0; i < f->array_count; i++) {
        const struct stored_array *from = &f->array[i];
        struct part_array *to = &head.array[i];
        *to = (struct part_array){.name = mem_strdup(from->name),
                                  .bytes = from->bytes,
                                  .tile_count = from->tile_count,
                                  .tile = mem_calloc(from->tile_count ? from->tile_count : 1, sizeof *to->tile)};
        for (size_t t = 0; t < to->tile_count; t++) {
            const struct part_tile *before = refers ? &p->newest.array[i].tile[t] : NULL;
            if (before && before->hash == from->tile[t].hash) {
                to->tile[t] = *before;
            } else {
                to->tile[t] = (struct part_tile){.hash = from->tile[t].hash, .part = p->next, .offset = *data_bytes};
                *data_bytes += checkpoint_file_tile_bytes(from->bytes, t);
            }
            head.first = to->tile[t].part < head.first ? to->tile[t].part : head.first;
        }
    }
    return head;
}

static enum status write_data(int fd, const char *path, const struct part_head *head, const struct state_array *array,
                              struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < head->array_count; i++)
        for (size_t t = 0; t < head->array[i].tile_count && status == STATUS_OK; t++)
            if (head->array[i].tile[t].part == head->number)
                status = file_write_all(fd, (const char *)array[i].data + t * CHECKPOINT_TILE_BYTES,
                                        checkpoint_file_tile_bytes(array[i].bytes, t), path, err);
    return status;
}

/* No sync: the part does not outlive the machine here, but where it is carried to. */
static enum status write_file(const char *path, const struct part_head *head, const struct state_array *array,
                              uint64_t *head_bytes, struct error *err) {
    char *temporary = mem_printf("%s.tmp", path), *text = part_head_text(head);
    *head_bytes = strlen(text);
    int fd = open(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600);
    enum status status = fd < 0 ? error_set_errno(err, errno, "cannot create %s", temporary)
                                : file_write_all(fd, text, *head_bytes, temporary, err);
    if (status == STATUS_OK)
        status = write_data(fd, temporary, head, array, err);
    if (fd >= 0 && close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot write %s", temporary);
    if (status == STATUS_OK && rename(temporary, path) != 0)
        status = error_set_errno(err, errno, "cannot rename %s", temporary);
    if (status != STATUS_OK)
        unlink(temporary);
    mem_free(text);
    mem_free(temporary);
    return status;
}

/* The part is there: parts that it does not need are forgotten. */
static void keep(struct checkpoint_parts *p, struct part_head *head, uint64_t data_bytes) {
    size_t kept = 0;
    for (size_t i = 0; i < p->kept_count; i++)
        if (p->kept[i].number >= head->first)
            p->kept[kept++] = p->kept[i];
    p->kept = mem_realloc_array(p->kept, kept + 1, sizeof *p->kept);
    p->kept[kept] = (struct kept_part){.number = head->number, .bytes = data_bytes};
    p->kept_count = kept + 1;
    part_head_release(&p->newest);
    p->newest = *head;
    *head = (struct part_head){0};
    p->next++;
}

enum status checkpoint_parts_write(struct checkpoint_parts *p, const struct checkpoint_file *f,
                                   const struct state_array *array, size_t count, bool must, struct written_part *part,
                                   struct error *err) {
    uint64_t data_bytes, head_bytes;
    *part = (struct written_part){0};
    if (count != f->array_count || (!must && !is_carried_away(p)))
        return STATUS_OK;
    struct part_head head = make_head(p, f, &data_bytes);
    char *path = layout_part(p->dir, head.number);
    enum status status = write_file(path, &head, array, &head_bytes, err);
    if (status == STATUS_OK) {
        *part = (struct written_part){.number = head.number, .first = head.first, .bytes = head_bytes + data_bytes};
        keep(p, &head, data_bytes);
    }
    part_head_release(&head);
    mem_free(path);
    return status;
}
