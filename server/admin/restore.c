/* restore.c -- `unbaked restore`: a data folder out of a backup with outputs. Every file is held against the digest
 * that the backup has for it; the database is put in place last, so that a daemon finds a whole data folder or none. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "server/admin/commands.h"
#include "server/admin/copy.h"
#include "server/data/folder.h"
#include "server/data/layout.h"
#include "server/store/contents.h"

#define SUMS_MAX_BYTES ((size_t)1 << 30) /* of SHA256SUMS: ten million files */

const struct command_option restore_flags[] = {
    {"skip-damaged", 0, OPTION_FLAG, NULL, "leave out files that are missing or damaged; ends with 1 then"},
    COMMAND_HELP_FLAG,
    {0},
};

struct restoring {
    const char *backup, *data;
    struct copy copy;
    bool skips;
    size_t damaged;
};

/* Creates the folder, or checks that it is empty. As root, new files go to the folder's owner. */
static enum status prepare(struct restoring *r, struct error *err) {
    char **names;
    size_t count;
    struct stat info;
    enum status status = file_make_dirs(r->data, err);
    if (status == STATUS_OK)
        status = file_list(r->data, &names, &count, err);
    if (status != STATUS_OK)
        return status;
    for (size_t i = 0; i < count; i++)
        if (strcmp(names[i], "lost+found") != 0 && status == STATUS_OK)
            status = error_set(err, STATUS_CONFLICT, "%s is not empty: it has %.80s", r->data, names[i]);
    file_free_names(names, count);
    if (status != STATUS_OK)
        return error_hint(err, "move it away first, or name another folder");
    r->copy.to = open(r->data, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (r->copy.to < 0 || fstat(r->copy.to, &info) != 0)
        return error_set_errno(err, errno, "cannot open %s", r->data);
    r->copy.owner = geteuid() == 0 ? info.st_uid : (uid_t)-1;
    r->copy.group = info.st_gid;
    return STATUS_OK;
}

static enum status open_backup(struct restoring *r, struct buf *sums, struct error *err) {
    struct stat info;
    if (stat(r->backup, &info) != 0)
        return error_set_errno(err, errno, "cannot access %s", r->backup);
    char *list = file_join(r->backup, BACKUP_SUMS);
    enum status status = STATUS_OK;
    if (!S_ISDIR(info.st_mode) || !file_is_in(r->backup, BACKUP_SUMS)) {
        error_set(err, STATUS_INPUT, "%s is not a folder that `unbaked backup --with-outputs` made", r->backup);
        status = error_hint(err, "a database alone is put back by copying it to state.db in an empty data folder");
    }
    if (status == STATUS_OK)
        status = file_read(list, sums, err);
    if (status == STATUS_OK && (r->copy.from = open(r->backup, O_RDONLY | O_DIRECTORY | O_CLOEXEC)) < 0)
        status = error_set_errno(err, errno, "cannot open %s", r->backup);
    mem_free(list);
    return status;
}

static void tell_damage(struct restoring *r, const char *path, const char *what) {
    r->damaged++;
    fprintf(stderr, "unbaked: %s/%s %s\n", r->backup, path, what);
}

/* Copies one file and checks the copy's digest. */
static enum status restore_file(struct restoring *r, const char *path, const char *wanted, struct error *err) {
    bool exists;
    char hex[SHA256_HEX_SIZE], *copy = file_join(r->data, path);
    enum status status = copy_file(&r->copy, path, &exists, err);
    if (status == STATUS_OK && !exists) {
        tell_damage(r, path, "is missing");
    } else if (status == STATUS_OK) {
        status = sha256_of_file(copy, hex, err);
        if (status == STATUS_OK && strcmp(hex, wanted) != 0) {
            tell_damage(r, path, "is damaged: its SHA-256 is not the one in " BACKUP_SUMS);
            unlink(copy);
        }
    }
    mem_free(copy);
    return status;
}

/* Splits "DIGEST  PATH", in place. */
static enum status read_line(const struct restoring *r, char *line, size_t number, char **digest, char **path,
                             struct error *err) {
    *digest = line;
    *path = line + SHA256_HEX_SIZE + 1;
    if (strlen(line) > SHA256_HEX_SIZE + 1 && strspn(line, "0123456789abcdef") == SHA256_HEX_SIZE - 1 &&
        memcmp(line + SHA256_HEX_SIZE - 1, "  ", 2) == 0 && copy_path_is_plain(*path)) {
        line[SHA256_HEX_SIZE - 1] = '\0';
        return STATUS_OK;
    }
    return error_set(err, STATUS_INPUT, "%s/%s:%zu: is not a digest, two blanks and the path of a file", r->backup,
                     BACKUP_SUMS, number);
}

/* Restores all files except the database, whose digest is copied to `database`. */
static enum status restore_files(struct restoring *r, char *sums, char database[SHA256_HEX_SIZE], struct error *err) {
    enum status status = STATUS_OK;
    char *digest, *path;
    *database = '\0';
    for (size_t number = 1; status == STATUS_OK && sums && *sums; number++) {
        char *line = strsep(&sums, "\n");
        status = read_line(r, line, number, &digest, &path, err);
        if (status == STATUS_OK && strcmp(path, LAYOUT_STATE) == 0)
            memcpy(database, digest, SHA256_HEX_SIZE);
        else if (status == STATUS_OK)
            status = restore_file(r, path, digest, err);
    }
    return status;
}

static enum status restore_database(struct restoring *r, const char *digest, struct contents *contents,
                                    struct error *err) {
    size_t before = r->damaged;
    char *path = layout_state(r->data);
    enum status status = STATUS_OK;
    if (syncfs(r->copy.to) != 0)
        status = error_set_errno(err, errno, "cannot write all of %s", r->data);
    if (status == STATUS_OK && !*digest)
        tell_damage(r, LAYOUT_STATE, "is missing");
    else if (status == STATUS_OK)
        status = restore_file(r, LAYOUT_STATE, digest, err);
    if (status == STATUS_OK && r->damaged > before)
        status = error_set(err, STATUS_CORRUPT, "a backup without its database is incomplete");
    if (status == STATUS_OK)
        status = contents_read(contents, path, err);
    if (status == STATUS_OK && syncfs(r->copy.to) != 0)
        status = error_set_errno(err, errno, "cannot write all of %s", r->data);
    mem_free(path);
    return status;
}

/* Removes what was restored: a daemon must not find a part. */
static void clear(const struct restoring *r) {
    char *parts[] = {layout_state(r->data), layout_scenes(r->data), layout_jobs(r->data), layout_lock(r->data)};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        file_remove_tree(parts[i], NULL);
        mem_free(parts[i]);
    }
}

static enum status restore(struct restoring *r, struct contents *contents, struct error *err) {
    struct buf sums;
    char database[SHA256_HEX_SIZE];
    int lock_fd = -1;
    buf_init(&sums, SUMS_MAX_BYTES);
    enum status status = open_backup(r, &sums, err);
    if (status == STATUS_OK)
        status = prepare(r, err);
    bool is_ours = status == STATUS_OK;
    if (status == STATUS_OK)
        status = folder_lock(r->data, &lock_fd, err);
    if (status == STATUS_OK && r->copy.owner != (uid_t)-1 && fchown(lock_fd, r->copy.owner, r->copy.group) != 0)
        status = error_set_errno(err, errno, "cannot give %s to its owner", r->data);
    if (status == STATUS_OK)
        status = restore_files(r, sums.length > 0 ? sums.data : NULL, database, err);
    if (status == STATUS_OK && r->damaged > 0 && !r->skips) {
        error_set(err, STATUS_CORRUPT, "%zu files of %s are missing or damaged: nothing is restored", r->damaged,
                  r->backup);
        status = error_hint(err, "--skip-damaged restores the others");
    }
    if (status == STATUS_OK)
        status = restore_database(r, database, contents, err);
    if (status != STATUS_OK && is_ours)
        clear(r);
    if (lock_fd >= 0)
        close(lock_fd);
    buf_release(&sums);
    return status;
}

int restore_command(int argc, char **argv) {
    struct invocation in;
    struct contents contents = {0};
    struct error err;
    int code = command_begin(NULL, &in, argc, argv, restore_flags, 2, 2);
    if (code < 0) {
        struct restoring r = {.backup = in.arguments.word[0],
                              .data = in.arguments.word[1],
                              .skips = invocation_has(&in, "skip-damaged"),
                              .copy = {.from = -1, .to = -1}};
        enum status status = restore(&r, &contents, &err);
        if (status == STATUS_OK)
            printf("%s: %zu scenes, %zu jobs, %zu outputs; %llu files with %llu bytes, %s\n", r.data,
                   contents.scene_count, contents.job_count, contents.output_count,
                   (unsigned long long)r.copy.file_count, (unsigned long long)r.copy.byte_count,
                   r.damaged ? "without those named above" : "all digests match");
        code = status != STATUS_OK ? command_failed(&err) : r.damaged ? EXIT_FAILURE : EXIT_SUCCESS;
        if (r.copy.to >= 0)
            close(r.copy.to);
        if (r.copy.from >= 0)
            close(r.copy.from);
    }
    contents_release(&contents);
    invocation_release(&in);
    return code;
}
