/* admin.h -- what whoever administers the machine asks of a daemon: tokens, backups.
 *
 * state.db has one connection, ever. So a command does not open it beside a running daemon: it
 * asks the daemon, by DATA/admin.sock, a Unix socket that only the daemon's user and root can
 * open (the file's mode, and the peer's user id). No secret lies on the disk, TLS and the limits
 * on connections do not matter, and it works whatever address the daemon listens on. Where no
 * daemon runs, the command takes the data folder's lock and does the work itself, through the
 * same function (admin_request.h).
 *
 *      request  one line of JSON: {"command": ..., ...}
 *      reply    one line of JSON: {...}, or {"error", "status", "hint"}; a backup comes as an
 *               open file beside it (SCM_RIGHTS) */
#ifndef UNBAKE_ADMIN_ADMIN_H
#define UNBAKE_ADMIN_ADMIN_H

#include "common/error.h"
#include "common/json.h"
#include "server/store/store.h"

struct admin; /* the daemon's side: one thread; opaque */

/* `revoked` is called, on that thread, after tokens were revoked. */
enum status admin_start(struct admin **admin, const char *data_dir, struct store *store, void (*revoked)(void *user),
                        void *user, struct error *err);
void admin_stop(struct admin *admin); /* NULL is allowed */

/* The command's side: asks the daemon of that folder or, if none runs, does the work and says "daemon_runs": false in
 * the reply. STATUS_NOT_FOUND, with a hint: it is no data folder. *reply is the caller's (cJSON_Delete); *fd is a file
 * that came with it, or -1. */
enum status admin_call(const char *data_dir, const cJSON *request, cJSON **reply, int *fd, struct error *err);

#endif
