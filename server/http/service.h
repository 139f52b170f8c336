/* service.h -- builds what the handlers work with (api.h) at start, and frees it at the end. */
#ifndef UNBAKE_HTTP_SERVICE_H
#define UNBAKE_HTTP_SERVICE_H

#include "common/error.h"
#include "server/http/api.h"

/* Builds the data folder's parts, removes leftovers of an earlier run (uploads, trash, files without a row), and
 * subscribes to the store's changes. Call before any other thread exists. */
enum status service_new(struct api **api, const struct api_config *config, struct store *store,
                        struct scheduler *scheduler, struct error *err);
void service_free(struct api *api);

#endif
