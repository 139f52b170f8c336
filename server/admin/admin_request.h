/* admin_request.h -- what can be asked of a daemon's administration, and the work: tokens, usage, backups. The daemon
 * does it, or the command itself where none runs (admin.h).
 *
 *      {"command": "token-add", "name", "role", "expires_ms"}   {"id", "token", "role", "has_admin"}
 *      {"command": "token-list"}                  {"items": [{"id", "user", "role", "created_ms", "expires_ms"}, ...]}
 *      {"command": "token-revoke", "which"}       {"count"}
 *      {"command": "usage"}                       {"items": [{"user", "month", "cpu_sec"}, ...]}
 *      {"command": "backup"}                      {}, and an open file: the copy of state.db
 *
 * expires_ms 0: never. Without a role the first token makes an admin, later ones users. has_admin: whether any token
 * that is valid now is an admin's. */
#ifndef UNBAKE_ADMIN_ADMIN_REQUEST_H
#define UNBAKE_ADMIN_ADMIN_REQUEST_H

#include "common/error.h"
#include "common/json.h"
#include "server/store/store.h"

/* Adds members to *reply; *fd, if one is made, is the caller's. */
enum status admin_request_do(const char *data_dir, struct store *store, const cJSON *request, cJSON *reply, int *fd,
                             struct error *err);

#endif
