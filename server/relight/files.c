/* files.c -- see files.h. */
#include "server/relight/files.h"

#include "common/file.h"
#include "common/mem.h"

char *files_path(const struct relight_job *job, const char *name) {
    return job->files ? file_join(job->files, name) : mem_strdup(name);
}
