/* retention.c -- see retention.h. */
#include "server/http/retention.h"

#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/transport/problem.h"

bool retention_read(struct retention *k, const cJSON *member, cJSON *params) {
    if (strcmp(member->string, "pinned") == 0) {
        k->pin = cJSON_IsTrue(member) ? KEEP_PIN_ON : KEEP_PIN_OFF;
        if (!cJSON_IsBool(member))
            problem_param(params, "pinned", NULL, "must be true or false");
        return true;
    }
    if (strcmp(member->string, "expires_at") != 0)
        return false;
    k->sets_expiry = true;
    k->expires_ms = cJSON_IsString(member) ? clock_read(member->valuestring) : 0;
    if (k->expires_ms == 0 && !cJSON_IsNull(member))
        problem_param(params, "expires_at", "null leaves it to the configuration",
                      "must be a time in UTC, like 2030-01-31T12:00:00Z, or null");
    return true;
}

struct response *retention_dry_run(const struct request *r, bool *dry_run) {
    const char *text = target_query(&r->target, "dry_run");
    *dry_run = text && strcmp(text, "1") == 0;
    return text && !*dry_run && strcmp(text, "0") != 0 ? problem(r, 400, "dry_run must be 0 or 1") : NULL;
}

struct response *retention_would_free(struct api *api, const struct request *r, const char *path) {
    struct error err;
    uint64_t files = 0, bytes = 0;
    char *full = path ? file_join(api->config.data_dir, path) : NULL;
    enum status status = path ? file_tree_size(full, &files, &bytes, &err) : STATUS_OK;
    mem_free(full);
    if (status != STATUS_OK)
        return problem_from(r, &err);
    cJSON *value = cJSON_CreateObject();
    json_add_bool(value, "dry_run", true);
    json_add_int(value, "files", (int64_t)files);
    json_add_int(value, "bytes", (int64_t)bytes);
    return response_json(200, value);
}
