/* cut.h -- the disk as a power cut leaves it: a log (faults.h) read back, and the folder made anew as
 * it may be found when the power fails after its first k operations.
 *
 * What is certain is only what was synced: a file's bytes and length by a sync of the file, names in a
 * folder by a sync of that folder. Of all else any part may be there, and the operations of one file
 * or folder need not have reached the disk in their order. A rename is there or not, as a whole, and
 * certain when either folder was synced (every journalling file system does so). Of the last unsynced
 * write to a file that is there, the last sector holds new bytes up to some point, then old ones. */
#ifndef UNBAKE_TESTS_CHAOS_CUT_H
#define UNBAKE_TESTS_CHAOS_CUT_H

#include <sys/stat.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/rng.h"
#include "tests/chaos/faults.h"

#define CUT_SECTOR 512

enum cut_kept { CUT_NONE, CUT_ALL, CUT_RANDOM, CUT_WHOLE /* all, nothing torn: as if the power had stayed */ };

struct cut_name {
    char *name;
    int node; /* -1: none (any more) */
};

/* A file or folder that ever was. */
struct cut_node {
    uint64_t inode;
    bool is_folder;
    size_t name_count, name_capacity; /* of a folder, as it is while steps are taken */
    struct cut_name *name;
    long synced; /* the last step that did */
    size_t size; /* of a file */
    char *bytes; /* those that were written; others are 0 */
    size_t written, capacity;
    long last_write; /* the last kept step that is not certain */
};

struct cut_step {
    enum faults_op op;
    int node, folder, to_folder; /* -1: does not apply */
    char *name, *to_name;
    uint64_t a;
    const char *text; /* borrowed from the log */
    size_t length;
};

struct cut {
    struct buf log;
    size_t step_count, node_count;
    struct cut_step *step;
    struct cut_node *node; /* the first is the root */
    long synced_all;
};

/* --- names ---------------------------------------------------------------------------------- */

static inline struct cut_name *cut_find(struct cut_node *folder, const char *name) {
    for (size_t i = 0; i < folder->name_count; i++)
        if (strcmp(folder->name[i].name, name) == 0)
            return &folder->name[i];
    return NULL;
}

static inline void cut_set(struct cut_node *folder, const char *name, int node) {
    struct cut_name *found = cut_find(folder, name);
    if (!found) {
        if (folder->name_count == folder->name_capacity) {
            folder->name_capacity = 2 * folder->name_capacity + 8;
            folder->name = mem_realloc_array(folder->name, folder->name_capacity, sizeof *folder->name);
        }
        found = &folder->name[folder->name_count++];
        found->name = mem_strdup(name);
    }
    found->node = node;
}

static inline void cut_fail(const char *what, const char *path) {
    fprintf(stderr, "the log makes no sense: %s %s\n", what, path);
    exit(1);
}

/* The folder of a path below the root, and the last name; the folder is 0 and the name "" for the root. */
static inline int cut_walk(struct cut *c, const char *root, const char *path, char **name) {
    int folder = 0;
    const char *at = path + strlen(root);
    while (*at == '/')
        at++;
    for (const char *slash; (slash = strchr(at, '/')) != NULL; at = slash + 1) {
        char *part = mem_strndup(at, (size_t)(slash - at));
        struct cut_name *found = cut_find(&c->node[folder], part);
        mem_free(part);
        if (!found || found->node < 0)
            cut_fail("no folder for", path);
        folder = found->node;
    }
    *name = mem_strdup(at);
    return folder;
}

static inline int cut_by_inode(const struct cut *c, uint64_t inode) {
    for (size_t i = c->node_count; i > 0; i--)
        if (c->node[i - 1].inode == inode)
            return (int)i - 1;
    return -1;
}

/* --- reading the log -------------------------------------------------------------------------- */

static inline void cut_read_step(struct cut *c, const char *root, const struct faults_record *r, const char *text) {
    struct cut_step *s = &c->step[c->step_count++];
    char *path = mem_strndup(text, r->length), *to = NULL; /* where there are two, the NUL ends the first */
    *s = (struct cut_step){
        .op = r->op, .node = -1, .folder = -1, .to_folder = -1, .a = r->a, .text = text, .length = r->length};
    switch (s->op) {
    case OP_CREATE:
        s->folder = cut_walk(c, root, path, &s->name);
        if (*s->name) {
            s->node = (int)c->node_count++;
            c->node[s->node] = (struct cut_node){.inode = r->inode, .is_folder = r->a == 1};
            cut_set(&c->node[s->folder], s->name, s->node);
        } else { /* the root itself */
            c->node[0].inode = r->inode;
        }
        break;
    case OP_RENAME:
        s->folder = cut_walk(c, root, path, &s->name);
        to = mem_strndup(text + strlen(path) + 1, r->length - strlen(path) - 1);
        s->to_folder = cut_walk(c, root, to, &s->to_name);
        s->node = cut_by_inode(c, r->inode);
        cut_set(&c->node[s->folder], s->name, -1);
        cut_set(&c->node[s->to_folder], s->to_name, s->node);
        break;
    case OP_REMOVE:
        s->folder = cut_walk(c, root, path, &s->name);
        s->node = cut_by_inode(c, r->inode);
        cut_set(&c->node[s->folder], s->name, -1);
        break;
    case OP_MARK: s->node = r->inode ? cut_by_inode(c, r->inode) : -1; break;
    case OP_SYNC_ALL: break;
    case OP_WRITE:
    case OP_SIZE:
    case OP_GROW:
    case OP_SYNC:
        s->node = cut_by_inode(c, r->inode);
        if (s->node < 0)
            cut_fail("a file that nobody made is", s->op == OP_SYNC ? "synced" : "written");
    }
    mem_free(to);
    mem_free(path);
}

static inline void cut_read(struct cut *c, const char *log_path, const char *root) {
    struct error err;
    *c = (struct cut){0};
    buf_init(&c->log, (size_t)1 << 30);
    if (file_read(log_path, &c->log, &err) != STATUS_OK)
        cut_fail("it cannot be read:", err.message);
    size_t count = 0;
    struct faults_record r;
    for (size_t at = 0; at + sizeof r <= c->log.length; at += sizeof r + r.length, count++)
        memcpy(&r, c->log.data + at, sizeof r);
    c->step = mem_calloc(count, sizeof *c->step);
    c->node = mem_calloc(count + 1, sizeof *c->node);
    c->node[0] = (struct cut_node){.is_folder = true};
    c->node_count = 1;
    for (size_t at = 0; at + sizeof r <= c->log.length; at += sizeof r + r.length) {
        memcpy(&r, c->log.data + at, sizeof r);
        if (at + sizeof r + r.length > c->log.length)
            cut_fail("it ends in", "a record");
        cut_read_step(c, root, &r, c->log.data + at + sizeof r);
    }
}

/* --- the disk after a cut ------------------------------------------------------------------------ */

static inline void cut_size(struct cut_node *n, size_t size) {
    if (size < n->written) {
        memset(n->bytes + size, 0, n->written - size);
        n->written = size;
    }
    n->size = size;
}

static inline void cut_write(struct cut_node *n, const char *data, size_t length, size_t at) {
    size_t end = at + length;
    if (length == 0)
        return;
    if (end > n->capacity) {
        size_t grown = end + end / 2;
        n->bytes = mem_realloc_array(n->bytes, grown, 1);
        memset(n->bytes + n->capacity, 0, grown - n->capacity);
        n->capacity = grown;
    }
    memcpy(n->bytes + at, data, length);
    n->written = end > n->written ? end : n->written;
    n->size = end > n->size ? end : n->size;
}

static inline unsigned cut_draw(uint32_t *random, unsigned limit) {
    *random = rng_mix32(*random + 0x9e3779b9u);
    return *random % limit;
}

/* A write that is not certain: whole, sector by sector, or (the file's last one) torn at its end. */
static inline void cut_write_part(struct cut_node *n, const struct cut_step *s, bool is_torn, bool by_sector,
                                  uint32_t *random) {
    size_t at = (size_t)s->a, end = at + s->length, last = (end - 1) / CUT_SECTOR * CUT_SECTOR;
    if (is_torn) {
        last = last > at ? last : at;
        end = last + cut_draw(random, (unsigned)(end - last));
    }
    for (size_t from = at, to; from < end; from = to) {
        to = by_sector ? (from / CUT_SECTOR + 1) * CUT_SECTOR : end;
        to = to < end ? to : end;
        if (!by_sector || cut_draw(random, 2))
            cut_write(n, s->text + (from - at), to - from, from);
    }
}

/* Whether it was on the disk for certain before step `count`. */
static inline bool cut_is_certain(const struct cut *c, long i) {
    const struct cut_step *s = &c->step[i];
    if (i < c->synced_all)
        return true;
    if (s->op == OP_CREATE || s->op == OP_RENAME || s->op == OP_REMOVE)
        return i < c->node[s->folder].synced || (s->to_folder >= 0 && i < c->node[s->to_folder].synced);
    return i < c->node[s->node].synced;
}

static inline void cut_take(struct cut *c, long i, bool is_torn, bool by_sector, uint32_t *random) {
    const struct cut_step *s = &c->step[i];
    struct cut_node *n = s->node >= 0 ? &c->node[s->node] : NULL;
    switch (s->op) {
    case OP_CREATE:
        if (n)
            cut_set(&c->node[s->folder], s->name, s->node);
        break;
    case OP_RENAME:
        cut_set(&c->node[s->folder], s->name, -1);
        cut_set(&c->node[s->to_folder], s->to_name, s->node);
        break;
    case OP_REMOVE: cut_set(&c->node[s->folder], s->name, -1); break;
    case OP_WRITE: cut_write_part(n, s, is_torn, by_sector, random); break;
    case OP_SIZE: cut_size(n, (size_t)s->a); break;
    case OP_GROW: cut_size(n, s->a > n->size ? (size_t)s->a : n->size); break;
    case OP_SYNC:
    case OP_SYNC_ALL:
    case OP_MARK: break;
    }
}

/* Writes what is below the node into the new folder `path`; DATA/reserve, which is large and means
 * nothing, is left out. */
static inline void cut_put(const struct cut *c, int node, const char *path) {
    const struct cut_node *n = &c->node[node];
    if (!n->is_folder) {
        int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
        if (fd < 0 || file_write_all(fd, n->bytes, n->written, path, NULL) != STATUS_OK ||
            ftruncate(fd, (off_t)n->size) != 0)
            cut_fail("it cannot be made:", path);
        close(fd);
        return;
    }
    if (mkdir(path, 0750) != 0)
        cut_fail("it cannot be made:", path);
    for (size_t i = 0; i < n->name_count; i++) {
        if (n->name[i].node < 0 || (node == 0 && strcmp(n->name[i].name, "reserve") == 0))
            continue;
        char *inner = file_join(path, n->name[i].name);
        cut_put(c, n->name[i].node, inner);
        mem_free(inner);
    }
}

static inline void cut_clear(struct cut *c) {
    c->synced_all = -1;
    for (size_t i = 0; i < c->node_count; i++) {
        struct cut_node *n = &c->node[i];
        for (size_t k = 0; k < n->name_count; k++)
            mem_free(n->name[k].name);
        n->name_count = 0;
        n->size = 0;
        if (n->written)
            memset(n->bytes, 0, n->written);
        n->written = 0;
        n->synced = n->last_write = -1;
    }
}

/* Makes `path`, which must not be there, as the data folder may be after the first `count` steps. */
static inline void cut_make(struct cut *c, size_t count, enum cut_kept kept, uint32_t random, const char *path) {
    unsigned char *keep = mem_calloc(count + 1, 1);
    bool by_sector = kept == CUT_RANDOM && cut_draw(&random, 2);
    cut_clear(c);
    for (size_t i = 0; i < count; i++) {
        if (c->step[i].op == OP_SYNC)
            c->node[c->step[i].node].synced = (long)i;
        else if (c->step[i].op == OP_SYNC_ALL)
            c->synced_all = (long)i;
    }
    for (size_t i = 0; i < count; i++) {
        const struct cut_step *s = &c->step[i];
        if (s->op >= OP_SYNC && s->op != OP_RENAME && s->op != OP_REMOVE)
            continue;
        bool is_certain = cut_is_certain(c, (long)i);
        keep[i] = is_certain || kept == CUT_ALL || kept == CUT_WHOLE ||
                  (kept == CUT_RANDOM && ((by_sector && s->op == OP_WRITE) || cut_draw(&random, 2)));
        if (keep[i] && !is_certain && s->op == OP_WRITE)
            c->node[s->node].last_write = (long)i;
        keep[i] = (unsigned char)(keep[i] ? 1 + !is_certain : 0);
    }
    for (size_t i = 0; i < count; i++)
        if (keep[i]) {
            int node = c->step[i].node;
            bool is_torn = kept != CUT_WHOLE && node >= 0 && c->node[node].last_write == (long)i;
            cut_take(c, (long)i, is_torn, by_sector && keep[i] == 2, &random);
        }
    cut_put(c, 0, path);
    mem_free(keep);
}

static inline void cut_release(struct cut *c) {
    cut_clear(c);
    for (size_t i = 0; i < c->node_count; i++) {
        mem_free(c->node[i].name);
        mem_free(c->node[i].bytes);
    }
    for (size_t i = 0; i < c->step_count; i++) {
        mem_free(c->step[i].name);
        mem_free(c->step[i].to_name);
    }
    mem_free(c->node);
    mem_free(c->step);
    buf_release(&c->log);
}

#endif
