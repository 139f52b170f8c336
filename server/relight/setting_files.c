/* setting_files.c -- see setting_files.h. */
#include "server/relight/setting_files.h"

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"

#define REPORT_MAX_BYTES ((size_t)256 << 20) /* of report.json: some 1 KiB a segment and view */

char *setting_files_path(const struct relight_job *job, const char *name) {
    return job->files ? file_join(job->files, name) : mem_strdup(name);
}

cJSON *setting_files_report(const struct relight_job *job) {
    cJSON *report = NULL;
    char *path = file_join(job->outputs, OUTPUT_REPORT);
    if (json_read(path, REPORT_MAX_BYTES, &report, NULL) != STATUS_OK || !report)
        report = cJSON_CreateObject();
    mem_free(path);
    return report;
}
