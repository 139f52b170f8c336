/* backup.c -- `unbaked backup`: a copy of the database and, with --with-outputs, of the files that it names.
 *
 * The daemon goes on meanwhile: jobs end, outputs come, things are removed. So the database is copied first, then the
 * files that this copy names; and again, as long as files are missing that it says are whole, because they were removed
 * or replaced after the copy. The files that are there already are not copied again: a later round takes moments.
 * What the last copy does not name is left out.
 *
 * Files of scenes and outputs are never changed in place, only removed or replaced by rename, so that they may be
 * shared with the data folder (copy.h). Checkpoints are: those of jobs that run are left out, such a job begins anew;
 * the others are copied, or share blocks. */
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
#include "server/admin/admin.h"
#include "server/admin/commands.h"
#include "server/admin/copy.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/store/contents.h"

#define ROUNDS_MAX 5 /* copies of the database and the files until both fit together; what does not then is left out */

const struct command_option backup_flags[] = {
    {"with-outputs", 0, OPTION_FLAG, NULL, "the files of scenes and jobs too; FILE is a folder then"},
    INVOCATION_FLAGS,
    COMMAND_HELP_FLAG,
    {0},
};

/* --- the database -------------------------------------------------------------------------- */

/* Copies what fd holds to a new file `path`. */
static enum status write_out(int fd, int out, const char *path, uint64_t *bytes, struct error *err) {
    char chunk[65536];
    enum status status = STATUS_OK;
    ssize_t got = 0;
    *bytes = 0;
    while (status == STATUS_OK && (got = read(fd, chunk, sizeof chunk)) > 0) {
        status = file_write_all(out, chunk, (size_t)got, path, err);
        *bytes += (uint64_t)got;
    }
    if (status == STATUS_OK && (got < 0 || fsync(out) != 0))
        status = error_set_errno(err, errno, "cannot write %s", path);
    return status;
}

/* Makes a copy of the database, which appears complete and durable, and only under a new name: an earlier backup may
 * be all that is left. */
static enum status keep_database(int fd, const char *path, uint64_t *bytes, struct error *err) {
    char *part = mem_printf("%s.part-XXXXXX", path);
    int out = mkostemp(part, O_CLOEXEC); /* 0600 */
    bool is_made = out >= 0;
    enum status status = is_made ? STATUS_OK : error_set_errno(err, errno, "cannot create %s", part);
    if (status == STATUS_OK)
        status = write_out(fd, out, part, bytes, err);
    if (status == STATUS_OK)
        status = file_rename_new(part, path, err);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err);
    else if (is_made)
        unlink(part);
    if (is_made)
        close(out);
    mem_free(part);
    return status;
}

/* A copy of the database, as an open file. */
static enum status ask_for_copy(const char *data_dir, int *fd, struct error *err) {
    cJSON *request = cJSON_CreateObject(), *reply = NULL;
    json_add_string(request, "command", "backup");
    enum status status = admin_call(data_dir, request, &reply, fd, err);
    if (status == STATUS_OK && *fd < 0)
        status = error_set(err, STATUS_INTERNAL, "the daemon sent no copy");
    cJSON_Delete(request);
    cJSON_Delete(reply);
    return status;
}

static enum status check_new(const char *path, struct error *err) {
    struct stat info;
    if (lstat(path, &info) != 0)
        return STATUS_OK; /* a missing path is reported when it is opened */
    error_set(err, STATUS_CONFLICT, "%s is there already, and a backup overwrites nothing", path);
    return error_hint(err, "name another, as %s-$(date +%%F)", path);
}

static enum status backup_database(const char *data_dir, const char *path, struct error *err) {
    uint64_t bytes = 0;
    int fd = -1;
    enum status status = ask_for_copy(data_dir, &fd, err);
    if (status == STATUS_OK)
        status = keep_database(fd, path, &bytes, err);
    if (fd >= 0)
        close(fd);
    if (status == STATUS_OK)
        printf("%s: %llu bytes\n", path, (unsigned long long)bytes);
    return status;
}

/* --- with outputs -------------------------------------------------------------------------- */

struct making {
    const char *data_dir;
    char *folder; /* the backup, under a temporary name; owned */
    struct copy copy;
    struct contents contents;
    size_t damaged; /* in the last round: outputs and archives that are missing or not as announced */
    bool is_last;   /* report them */
};

static enum status copy_database(struct making *m, struct error *err) {
    uint64_t bytes;
    int fd = -1;
    char *path = layout_state(m->folder);
    enum status status = ask_for_copy(m->data_dir, &fd, err);
    int out = status == STATUS_OK ? open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : -1;
    if (status == STATUS_OK && out < 0)
        status = error_set_errno(err, errno, "cannot create %s", path);
    if (status == STATUS_OK)
        status = write_out(fd, out, path, &bytes, err);
    if (out >= 0)
        close(out);
    if (fd >= 0)
        close(fd);
    contents_release(&m->contents);
    if (status == STATUS_OK)
        status = contents_read(&m->contents, path, err);
    mem_free(path);
    return status;
}

static void tell_damage(struct making *m, const char *path, const char *what) {
    m->damaged++;
    if (m->is_last)
        fprintf(stderr, "unbaked: %s %s\n", path, what);
}

/* An output of a job that has ended must be as announced; one of another job may be newer. */
static enum status copy_output(struct making *m, const struct contents_job *job, const struct contents_output *output,
                               struct error *err) {
    char *folder = layout_attempt(NULL, job->id, output->attempt), *path = layout_output(folder, output->name);
    char *copy = NULL;
    char hex[SHA256_HEX_SIZE] = "";
    bool exists = false;
    enum status status = STATUS_OK;
    if (copy_path_is_plain(path))
        status = copy_file(&m->copy, path, &exists, err);
    if (status == STATUS_OK && job->is_terminal && !exists)
        tell_damage(m, path, "is missing");
    if (status == STATUS_OK && job->is_terminal && exists) {
        copy = file_join(m->folder, path);
        status = sha256_of_file(copy, hex, err);
        if (status == STATUS_OK && strcmp(hex, output->sha256) != 0)
            tell_damage(m, path, "is not as it was announced");
    }
    mem_free(copy);
    mem_free(path);
    mem_free(folder);
    return status;
}

static enum status copy_job(struct making *m, const struct contents_job *job, struct error *err) {
    char *folder = layout_job(NULL, job->id), *log = layout_log(folder), *holder = NULL;
    enum status status = STATUS_OK;
    bool exists;
    for (size_t i = 0; status == STATUS_OK && i < job->count; i++)
        status = copy_output(m, job, &m->contents.outputs[job->first + i], err);
    m->copy.may_link = false;
    if (status == STATUS_OK && !job->is_running)
        status = copy_file(&m->copy, log, &exists, err);
    if (status == STATUS_OK && !job->is_running)
        status = attempt_folder_with_checkpoint(m->data_dir, job->id, &holder, err);
    if (status == STATUS_OK) /* that of an earlier round, if another attempt has it now */
        status = attempt_folder_drop_checkpoint(m->folder, job->id, err);
    if (status == STATUS_OK && holder) {
        char *checkpoint = layout_checkpoint_folder(holder);
        status = copy_tree(&m->copy, checkpoint, err);
        mem_free(checkpoint);
    }
    m->copy.may_link = true;
    mem_free(holder);
    mem_free(log);
    mem_free(folder);
    return status;
}

static enum status copy_scene(struct making *m, const struct contents_scene *scene, struct error *err) {
    char *path = layout_scene(NULL, scene->id), *archive = layout_archive(path);
    enum status status = copy_tree(&m->copy, path, err);
    if (status == STATUS_OK && scene->is_ready && !file_is_in(m->folder, archive))
        tell_damage(m, archive, "is missing");
    mem_free(archive);
    mem_free(path);
    return status;
}

static enum status copy_files(struct making *m, struct error *err) {
    enum status status = STATUS_OK;
    m->damaged = 0;
    for (size_t i = 0; status == STATUS_OK && i < m->contents.scene_count; i++)
        status = copy_scene(m, &m->contents.scenes[i], err);
    for (size_t i = 0; status == STATUS_OK && i < m->contents.job_count; i++)
        status = copy_job(m, &m->contents.jobs[i], err);
    return status;
}

static bool is_named(const struct contents *c, bool is_scene, const char *name) {
    for (size_t i = 0; is_scene && i < c->scene_count; i++)
        if (strcmp(c->scenes[i].id, name) == 0)
            return true;
    for (size_t i = 0; !is_scene && i < c->job_count; i++)
        if (c->jobs[i].id == strtoll(name, NULL, 10))
            return true;
    return false;
}

/* Removes files that the last copy of the database does not name, and checkpoints of jobs that have started
 * meanwhile, which may be half old, half new. */
static enum status leave_out(const struct making *m, struct error *err) {
    enum status status = STATUS_OK;
    for (int is_scene = 0; is_scene < 2; is_scene++) {
        char *inner = is_scene ? layout_scenes(NULL) : layout_jobs(NULL);
        char *folder = file_join(m->folder, inner), **names = NULL;
        size_t count = 0;
        if (status == STATUS_OK && file_is_in(m->folder, inner))
            status = file_list(folder, &names, &count, err);
        for (size_t i = 0; status == STATUS_OK && i < count; i++) {
            char *path = file_join(folder, names[i]);
            if (!is_named(&m->contents, is_scene, names[i]))
                status = file_remove_tree(path, err);
            mem_free(path);
        }
        file_free_names(names, count);
        mem_free(folder);
        mem_free(inner);
    }
    for (size_t i = 0; status == STATUS_OK && i < m->contents.job_count; i++) {
        if (m->contents.jobs[i].is_running)
            status = attempt_folder_drop_checkpoint(m->folder, m->contents.jobs[i].id, err);
    }
    return status;
}

/* Appends the lines of all files below `path`, a folder of the backup ("": all of it). */
static enum status list_sums(const char *folder, const char *path, struct buf *sums, struct error *err) {
    char **names, *whole = *path ? file_join(folder, path) : mem_strdup(folder), hex[SHA256_HEX_SIZE];
    size_t count;
    enum status status = file_list(whole, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct stat info;
        char *inner = *path ? file_join(path, names[i]) : mem_strdup(names[i]), *full = file_join(folder, inner);
        if (lstat(full, &info) != 0)
            status = error_set_errno(err, errno, "cannot access %s", full);
        else if (S_ISDIR(info.st_mode))
            status = list_sums(folder, inner, sums, err);
        else if ((status = sha256_of_file(full, hex, err)) == STATUS_OK)
            buf_printf(sums, "%s  %s\n", hex, inner);
        mem_free(full);
        mem_free(inner);
    }
    file_free_names(names, count);
    mem_free(whole);
    return status;
}

/* The list of files, all on the disk, and the final name. */
static enum status finish(const struct making *m, const char *path, struct error *err) {
    struct buf sums;
    buf_init(&sums, SIZE_MAX / 2);
    char *list = file_join(m->folder, BACKUP_SUMS);
    enum status status = list_sums(m->folder, "", &sums, err);
    if (status == STATUS_OK)
        status = file_replace(list, buf_text(&sums), sums.length, err);
    if (status == STATUS_OK && syncfs(m->copy.to) != 0)
        status = error_set_errno(err, errno, "cannot write all of %s", m->folder);
    if (status == STATUS_OK)
        status = file_rename_new(m->folder, path, err);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err);
    mem_free(list);
    buf_release(&sums);
    return status;
}

static enum status open_folders(struct making *m, struct error *err) {
    if (!mkdtemp(m->folder)) /* 0700: it holds hashes of tokens, and everybody's rooms */
        return error_set_errno(err, errno, "cannot make the folder %s", m->folder);
    m->copy.to = open(m->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    m->copy.from = open(m->data_dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (m->copy.to < 0 || m->copy.from < 0)
        return error_set_errno(err, errno, "cannot open %s", m->copy.to < 0 ? m->folder : m->data_dir);
    return STATUS_OK;
}

static enum status backup_all(const char *data_dir, const char *path, bool *is_damaged, struct error *err) {
    struct making m = {.data_dir = data_dir,
                       .folder = mem_printf("%s.part-XXXXXX", path),
                       .copy = {.from = -1, .to = -1, .may_link = true, .owner = (uid_t)-1}};
    enum status status = open_folders(&m, err);
    for (int round = 1; status == STATUS_OK && round <= ROUNDS_MAX; round++) {
        m.is_last = round == ROUNDS_MAX;
        status = copy_database(&m, err);
        if (status == STATUS_OK)
            status = copy_files(&m, err);
        if (m.damaged == 0)
            break;
    }
    if (status == STATUS_OK)
        status = leave_out(&m, err);
    if (status == STATUS_OK)
        status = finish(&m, path, err);
    if (status == STATUS_OK)
        printf("%s: %zu scenes, %zu jobs, %zu outputs; %llu files with %llu bytes, %llu of them shared with %s\n", path,
               m.contents.scene_count, m.contents.job_count, m.contents.output_count,
               (unsigned long long)m.copy.file_count, (unsigned long long)m.copy.byte_count,
               (unsigned long long)m.copy.shared_count, data_dir);
    else if (m.copy.to >= 0)
        file_remove_tree(m.folder, NULL);
    *is_damaged = m.damaged > 0;
    if (m.copy.to >= 0)
        close(m.copy.to);
    if (m.copy.from >= 0)
        close(m.copy.from);
    contents_release(&m.contents);
    mem_free(m.folder);
    return status;
}

int backup_command(int argc, char **argv) {
    struct invocation in;
    struct error err;
    bool is_damaged = false;
    int code = command_begin(CONFIG_FILE_DEFAULT, &in, argc, argv, backup_flags, 1, 1);
    if (code < 0) {
        enum status status = check_new(in.arguments.word[0], &err);
        if (status == STATUS_OK && invocation_has(&in, "with-outputs"))
            status = backup_all(in.config.data_dir, in.arguments.word[0], &is_damaged, &err);
        else if (status == STATUS_OK)
            status = backup_database(in.config.data_dir, in.arguments.word[0], &err);
        code = status != STATUS_OK ? command_failed(&err) : is_damaged ? EXIT_FAILURE : EXIT_SUCCESS;
    }
    invocation_release(&in);
    return code;
}
