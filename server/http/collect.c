/* collect.c -- /v1/collect: removes what has expired, or (dry run) lists it. */
#include "common/clock.h"
#include "server/data/collector.h"
#include "server/http/handlers.h"
#include "server/http/retention.h"
#include "server/transport/problem.h"

struct found {
    cJSON *items;
    uint64_t bytes;
};

static void add_item(void *user, const struct expired *e, uint64_t files, uint64_t bytes) {
    struct found *found = user;
    char time[CLOCK_TEXT_SIZE];
    cJSON *item = cJSON_CreateObject();
    clock_text(e->expires_ms, time);
    json_add_string(item, "kind", collector_kind_name(e));
    json_add_string(item, "id", e->id);
    json_add_string(item, "name", e->name);
    json_add_string(item, "expires_at", time);
    json_add_int(item, "files", (int64_t)files);
    json_add_int(item, "bytes", (int64_t)bytes);
    cJSON_AddItemToArray(found->items, item);
    found->bytes += bytes;
}

struct response *collect_now(struct api *api, struct request *r) {
    bool dry_run;
    struct error err;
    struct response *refusal = retention_dry_run(r, &dry_run);
    if (refusal)
        return refusal;
    struct found found = {.items = cJSON_CreateArray()};
    if (collector_run(&api->collector_config, dry_run, add_item, &found, &err) != STATUS_OK) {
        cJSON_Delete(found.items);
        return problem_from(r, &err);
    }
    cJSON *value = cJSON_CreateObject();
    json_add_bool(value, "dry_run", dry_run);
    json_add_number(value, "bytes", (double)found.bytes);
    json_add(value, "items", found.items);
    return response_json(200, value);
}
