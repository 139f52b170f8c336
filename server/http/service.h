/* service.h -- builds what the handlers work with (api.h) at start, has the transport serve it, and frees it at the
 * end. */
#ifndef UNBAKE_HTTP_SERVICE_H
#define UNBAKE_HTTP_SERVICE_H

#include "common/error.h"
#include "server/http/api.h"
#include "server/transport/listener.h"

/* Builds the data folder's parts, removes leftovers of an earlier run (uploads, trash, files without a row), and
 * subscribes to the store's changes. Call before any other thread exists. */
enum status service_new(struct api **api, const struct api_config *config, struct store *store,
                        struct scheduler *scheduler, struct error *err);
/* Listens and serves (listener_start), as api->listener. config->proxies are the api's. */
enum status service_listen(struct listener **l, const struct listener_config *config, struct api *api,
                           struct error *err);
/* The listener has been stopped. */
void service_free(struct api *api);

#endif
