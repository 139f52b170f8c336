/* layout.c -- see layout.h. */
#include "server/data/layout.h"

#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"

static char *in(const char *dir, const char *name) { return dir ? file_join(dir, name) : mem_strdup(name); }

/* DIR/FOLDER/NAME; takes name. */
static char *in_folder(const char *dir, const char *folder, char *name) {
    char *inner = file_join(folder, name), *path = in(dir, inner);
    mem_free(inner);
    mem_free(name);
    return path;
}

char *layout_state(const char *data_dir) { return in(data_dir, LAYOUT_STATE); }

char *layout_reserve(const char *data_dir) { return in(data_dir, "reserve"); }

char *layout_lock(const char *data_dir) { return in(data_dir, "lock"); }

char *layout_socket(const char *data_dir) { return in(data_dir, LAYOUT_SOCKET); }

char *layout_probe(const char *data_dir) { return in(data_dir, "doctor-" LAYOUT_RANDOM); }

char *layout_scenes(const char *data_dir) { return in(data_dir, "scenes"); }

char *layout_scene(const char *data_dir, const char *scene_id) {
    return in_folder(data_dir, "scenes", mem_strdup(scene_id));
}

char *layout_jobs(const char *data_dir) { return in(data_dir, "jobs"); }

char *layout_job(const char *data_dir, int64_t job_id) {
    return in_folder(data_dir, "jobs", mem_printf("%lld", (long long)job_id));
}

char *layout_job_files(const char *data_dir, int64_t job_id) {
    return in_folder(data_dir, "jobs", mem_printf("%lld/files", (long long)job_id));
}

char *layout_job_file(const char *data_dir, int64_t job_id, const char *name) {
    return in_folder(data_dir, "jobs", mem_printf("%lld/files/%s", (long long)job_id, name));
}

#define ATTEMPT "attempt-"

char *layout_attempt(const char *data_dir, int64_t job_id, int number) {
    return in_folder(data_dir, "jobs", mem_printf("%lld/" ATTEMPT "%d", (long long)job_id, number));
}

/* N of "PREFIXN", as this file writes it; 0: it is no such name. */
static int number_after(const char *prefix, const char *name) {
    const char *digits = name + strlen(prefix);
    if (strncmp(name, prefix, strlen(prefix)) != 0 || *digits < '1' || *digits > '9' || strlen(digits) > 9 ||
        strspn(digits, "0123456789") != strlen(digits))
        return 0;
    return (int)strtol(digits, NULL, 10);
}

int layout_attempt_number(const char *name) { return number_after(ATTEMPT, name); }

char *layout_uploads(const char *data_dir) { return in(data_dir, "uploads"); }

char *layout_upload(const char *data_dir, const char *upload_id) {
    return in_folder(data_dir, "uploads", mem_strdup(upload_id));
}

char *layout_trash(const char *data_dir) { return in(data_dir, "trash"); }

char *layout_trash_file(const char *data_dir, const char *name) {
    return in_folder(data_dir, "trash", mem_strdup(name));
}

char *layout_message(const char *data_dir, int64_t message_id) {
    return in_folder(data_dir, "trash", mem_printf("message-%lld", (long long)message_id));
}

char *layout_order(const char *work_dir) { return in(work_dir, "job.json"); }

char *layout_log(const char *dir) { return in(dir, "worker.log"); }

char *layout_archive(const char *work_dir) { return in(work_dir, "archive"); }

char *layout_files(const char *work_dir) { return in(work_dir, "files"); }

char *layout_file_list(const char *work_dir) { return in(work_dir, "files.json"); }

char *layout_truth(const char *room) { return in(room, "truth/objects.json"); }

char *layout_previews(const char *work_dir) { return in(work_dir, "previews"); }

char *layout_preview(const char *work_dir, const char *name) {
    return in_folder(work_dir, "previews", mem_strdup(name));
}

#define CHECKPOINT "checkpoint.db"
#define CHECKPOINT_JOURNAL CHECKPOINT "-journal" /* as SQLite names it */

char *layout_checkpoint_folder(const char *work_dir) { return in(work_dir, "checkpoint"); }

char *layout_checkpoint(const char *work_dir) { return in(work_dir, "checkpoint/" CHECKPOINT); }

char *layout_checkpoint_journal(const char *work_dir) { return in(work_dir, "checkpoint/" CHECKPOINT_JOURNAL); }

bool layout_is_checkpoint(const char *name) {
    return strcmp(name, CHECKPOINT) == 0 || strcmp(name, CHECKPOINT_JOURNAL) == 0;
}

#define PART "part-"

char *layout_part(const char *checkpoint_folder, int number) {
    char *name = mem_printf(PART "%d", number), *path = in(checkpoint_folder, name);
    mem_free(name);
    return path;
}

int layout_part_number(const char *name) { return number_after(PART, name); }

char *layout_former_checkpoint(const char *job_dir) { return in(job_dir, CHECKPOINT); }

char *layout_former_journal(const char *job_dir) { return in(job_dir, CHECKPOINT_JOURNAL); }

char *layout_checkpoint_unready(const char *work_dir) { return in(work_dir, "checkpoint.unready"); }

char *layout_out(const char *work_dir) { return in(work_dir, "out"); }

char *layout_output(const char *work_dir, const char *name) { return in_folder(work_dir, "out", mem_strdup(name)); }
