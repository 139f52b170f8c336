/* service.h -- what the handlers work with (api.h), made at the start and taken apart at the end. */
#ifndef UNBAKE_HTTP_SERVICE_H
#define UNBAKE_HTTP_SERVICE_H

#include "common/error.h"
#include "server/http/api.h"

/* Makes the data folder's parts, removes what an earlier life left half done (uploads, trash,
 * files without a row), and listens to the store's changes. Before any other thread. */
enum status service_new(struct api **api, const struct api_config *config, struct store *store,
                        struct scheduler *scheduler, struct error *err);
void service_free(struct api *api);

#endif
