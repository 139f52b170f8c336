/* auth.h -- who asks, and whether they may: tokens on the way in, access to what a path names.
 *
 * A token comes as `Authorization: Bearer TOKEN` or, from the web page, in a cookie that no script
 * can read (POST /v1/session sets it). The token itself never appears in a log, a reply or a URL. */
#ifndef UNBAKE_HTTP_AUTH_H
#define UNBAKE_HTTP_AUTH_H

#include "server/http/api.h"
#include "server/http/message.h"

#define AUTH_COOKIE "unbake_token"

/* Whether callers without a token are let in, as admins. */
bool auth_is_open(const struct api *api);

/* Fills r->caller; NULL, or the refusal: 401 without a valid token, 403 where the token's role may
 * not use the route at all. */
struct response *auth_check(struct api *api, struct request *r);

/* To a caller whose token is not valid: 401, or 429 where its address has presented too many (auth_throttle.h). Logged, with
 * the address and without the token. */
struct response *auth_reject(struct api *api, struct request *r);

/* The job or scene that the path names at its third part. False with *refusal: 404 where there is
 * none that the caller may read, in the same words whether it exists or not; 403 where `needed`
 * is ACCESS_CHANGE and the caller may only read. What is found is the caller's to release. */
bool auth_job(struct api *api, const struct request *r, enum access needed, struct job *job, struct response **refusal);
/* The job's number alone, 0 with *refusal. */
int64_t auth_job_id(struct api *api, const struct request *r, enum access needed, struct response **refusal);
bool auth_scene(struct api *api, const struct request *r, enum access needed, struct scene_row *row,
                struct response **refusal);
/* The scene of that id, or its beginning of 8 digits or more, where the caller may read it. */
enum status auth_find_scene(struct api *api, const struct request *r, const char *id, struct scene_row *row,
                            struct error *err);

#endif
