/* auth.h -- who asks, and whether they may: tokens on the way in, access to what a path names.
 *
 * A token comes as `Authorization: Bearer TOKEN` or, from the web page, in a cookie that no script
 * can read (POST /v1/session sets it). The token itself never appears in a log, a reply or a URL. */
#ifndef UNBAKE_HTTP_AUTH_H
#define UNBAKE_HTTP_AUTH_H

#include "server/http/api.h"
#include "server/transport/message.h"

#define AUTH_COOKIE "unbake_token"

/* Whether callers without a token are admitted, as admins. */
bool auth_is_open(const struct api *api);

/* Fills r->caller; NULL, or the refusal: 401 without a valid token, 403 where the token's role may
 * not use the route at all. */
struct response *auth_check(struct api *api, struct request *r);

/* The token of Authorization: Bearer; false where there is none. */
bool auth_bearer(const struct request *r, char token[TOKEN_SIZE]);

#define AUTH_EXPIRED "urn:unbake:token-expired" /* type of the 401 that says so */

/* The reply to a token that store_token_find has refused with `err` (NULL: an attempt's): 401, or 429 after too many
 * invalid ones from that address (auth_throttle.h). Logs the address, never the token. */
struct response *auth_reject(struct api *api, struct request *r, const struct error *err);

/* Loads the job or scene that the third segment of the path names; the caller releases it. false, with *refusal: 404
 * where there is none that the caller may read (the same words whether it exists or not), 403 where `needed` is
 * ACCESS_CHANGE and the caller may only read. */
bool auth_job(struct api *api, const struct request *r, enum access needed, struct job *job, struct response **refusal);
/* Only the job's number; 0 with *refusal. */
int64_t auth_job_id(struct api *api, const struct request *r, enum access needed, struct response **refusal);
bool auth_scene(struct api *api, const struct request *r, enum access needed, struct scene_row *row,
                struct response **refusal);
/* The scene with that id, or with an id that begins with these 8 or more digits, if the caller may read it. */
enum status auth_find_scene(struct api *api, const struct request *r, const char *id, struct scene_row *row,
                            struct error *err);

#endif
