/* views.h -- rows of the store as the JSON that openapi.json describes. */
#ifndef UNBAKE_HTTP_VIEWS_H
#define UNBAKE_HTTP_VIEWS_H

#include "common/json.h"
#include "server/store/store.h"
#include "server/transport/message.h"

/* Adds a time as RFC 3339, null where it is 0. */
void view_add_time(cJSON *object, const char *key, int64_t unix_ms);

/* As `who` sees it: the URL of its webhook is shown to its owner only. */
cJSON *view_job(const struct job *job, const struct caller *who);
cJSON *view_scene(const struct scene_row *row);
cJSON *view_upload(const struct upload_row *row);
cJSON *view_output(int64_t job_id, const struct output_row *row);

/* Reads `limit` of a list's query; or *refusal. */
size_t view_limit(const struct request *r, struct response **refusal);
/* {"items", "next"} and Link. `next` is the cursor, "" on the last page. Takes items. */
struct response *view_page(const struct request *r, cJSON *items, const char *next);

/* The reply to GET with that ETag: 304 where the caller has it. Takes value. */
struct response *view_tagged(const struct request *r, cJSON *value, const char *etag);

#endif
