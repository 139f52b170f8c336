/* daemon_options.h -- the configuration as the parts of the daemon take it: their units, and what several options mean
 * together. Texts are borrowed from the configuration. */
#ifndef UNBAKE_SERVER_DAEMON_OPTIONS_H
#define UNBAKE_SERVER_DAEMON_OPTIONS_H

#include "server/config.h"
#include "server/executor/sites.h"
#include "server/http/api.h"
#include "server/job/scheduler.h"
#include "server/libraries.h"
#include "server/transport/listener.h"

struct scheduler_config daemon_options_scheduler(const struct config *c, const struct executor *executor,
                                                 const struct sites *sites);
/* Borrows proxies, list and sites. */
struct api_config daemon_options_api(const struct config *c, const struct proxies *proxies, const struct sites *sites,
                                     const struct api_library list[LIBRARY_COUNT]);
/* `address` becomes that of the result, which borrows it; *is_loopback: only this machine can reach it. */
struct listener_config daemon_options_listener(const struct config *c, char address[CONFIG_ADDRESS_SIZE],
                                               bool *is_loopback);

#endif
