/* render_request.h -- the settings of a render in POST /v1/jobs: checked, and what they mean beforehand. */
#ifndef UNBAKE_HTTP_JOBS_RENDER_REQUEST_H
#define UNBAKE_HTTP_JOBS_RENDER_REQUEST_H

#include "common/json.h"
#include "server/http/api.h"
#include "server/transport/message.h"

struct render_request {
    const cJSON *settings; /* borrowed; NULL: none were given */
    char **file;           /* [file_count] names of the files to be sent; owned */
    size_t file_count;
    double cost; /* paths: pixels times samples times pictures, at most; 0: not known before the room is read */
};

/* Checks the settings (NULL: none); all faults are added to `params`, with "settings." before their names. *q, which is
 * zero, needs render_request_release in any case. */
void render_request_read(struct render_request *q, const cJSON *settings, cJSON *params);
/* Finds the cost, from the cameras of the job `source`, and adds to `params` what the settings name that its room has
 * not. */
void render_request_check_room(struct api *api, struct render_request *q, int64_t source, cJSON *params);
/* Adds what a dry run tells: files, paths, whether it is small. */
void render_request_describe(const struct api *api, const struct render_request *q, cJSON *value);
void render_request_release(struct render_request *q);

#endif
