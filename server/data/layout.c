/* layout.c -- see layout.h. */
#include "server/data/layout.h"

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

char *layout_log(const char *work_dir) { return in(work_dir, "worker.log"); }

char *layout_archive(const char *work_dir) { return in(work_dir, "archive"); }

char *layout_files(const char *work_dir) { return in(work_dir, "files"); }

char *layout_previews(const char *work_dir) { return in(work_dir, "previews"); }

char *layout_preview(const char *work_dir, const char *name) {
    return in_folder(work_dir, "previews", mem_strdup(name));
}

char *layout_checkpoint(const char *work_dir) { return in(work_dir, "checkpoint.db"); }

char *layout_checkpoint_journal(const char *work_dir) { return in(work_dir, "checkpoint.db-journal"); }

char *layout_out(const char *work_dir) { return in(work_dir, "out"); }

char *layout_output(const char *work_dir, const char *name) { return in_folder(work_dir, "out", mem_strdup(name)); }
