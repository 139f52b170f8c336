/* limits.c -- see limits.h. */
#include "server/http/limits.h"

#include <stdio.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/transport/problem.h"
#include "server/uploads/upload.h"

#define ADMIN_STREAMS 10 /* one stream in ten is kept for admins */

bool limits_bind(const struct request *r) { return r->caller.user_id > 0 && r->caller.role != ROLE_ADMIN; }

/* Names the option, and who can change it. */
static struct response *refuse(const struct request *r, int status, const char *option, const char *hint,
                               char *detail) {
    char *full = mem_printf("%s%san administrator can raise the option %s", hint, *hint ? "; " : "", option);
    struct response *reply = problem_full(r, status, detail, full, NULL);
    mem_free(full);
    mem_free(detail);
    return reply;
}

/* Uploads under way: in parts, and in one request each. */
static enum status count_uploads(struct api *api, const struct request *r, size_t *count, struct error *err) {
    enum status status = store_user_uploads(api->store, r->caller.user_id, count, err);
    *count += arrivals_of(api->arrivals, r->caller.user_id, NULL).count;
    return status;
}

static struct response *check_count(struct api *api, const struct request *r) {
    size_t uploads = 0, most = api->config.user_max_uploads;
    struct error err;
    if (most > 0 && count_uploads(api, r, &uploads, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (most > 0 && uploads >= most)
        return refuse(
            r, 429, "user_max_uploads", "finish or remove some",
            mem_printf("%zu of your uploads are under way already, and one user may have %zu", uploads, most));
    return NULL;
}

static struct response *check_pledge(struct api *api, const struct request *r, uint64_t bytes) {
    uint64_t room, pledged, keep = api->config.min_free_bytes + api->config.admin_free_bytes;
    struct error err;
    if (api->config.user_pledge_percent == 0)
        return NULL;
    if (file_free_bytes(api->config.data_dir, &room, &err) != STATUS_OK ||
        store_user_pledged(api->store, r->caller.user_id, clock_unix_ms() - api->config.empty_upload_ms, &pledged,
                           &err) != STATUS_OK)
        return problem_from(r, &err);
    pledged += arrivals_of(api->arrivals, r->caller.user_id, NULL).pledged;
    /* Pledged bytes are allocated already: they are no longer free. */
    uint64_t share = ((room > keep ? room - keep : 0) + pledged) / 100 * api->config.user_pledge_percent;
    if (pledged + bytes <= share)
        return NULL;
    return refuse(
        r, 507, "user_pledge_percent", "finish or remove an upload that is under way",
        mem_printf("your uploads under way reserve %llu MiB, and %llu MiB more are needed: the limit of one user"
                   " is %u %% of the free space, %llu MiB",
                   (unsigned long long)(pledged >> 20), (unsigned long long)(bytes >> 20),
                   api->config.user_pledge_percent, (unsigned long long)(share >> 20)));
}

struct response *limits_check_checks(struct api *api, const struct request *r) {
    size_t checks, uploads, most = api->config.user_max_checks;
    struct error err;
    if (!limits_bind(r) || most == 0)
        return NULL;
    if (store_user_checks(api->store, r->caller.user_id, &checks, &err) != STATUS_OK ||
        count_uploads(api, r, &uploads, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (checks + uploads < most)
        return NULL;
    return refuse(
        r, 429, "user_max_checks", "finish or remove uploads, and wait until scenes are checked",
        mem_printf("%zu of your scenes wait to be checked already, and %zu uploads are under way; the limit of"
                   " one user is %zu together",
                   checks, uploads, most));
}

struct response *limits_check_upload(struct api *api, const struct request *r, uint64_t bytes) {
    if (!limits_bind(r))
        return NULL;
    struct response *refusal = check_count(api, r);
    if (!refusal)
        refusal = limits_check_checks(api, r);
    return refusal ? refusal : check_pledge(api, r, bytes);
}

struct response *limits_check_file(struct api *api, const struct request *r, uint64_t bytes) {
    if (!limits_bind(r))
        return NULL;
    struct response *refusal = check_count(api, r);
    return refusal ? refusal : check_pledge(api, r, bytes);
}

struct hub_limits limits_of_streams(const struct api *api, const struct request *r) {
    size_t most = api->config.max_streams;
    bool is_bound = limits_bind(r);
    return (struct hub_limits){
        .of_all = is_bound ? most - most / ADMIN_STREAMS : most,
        .of_user = is_bound ? api->config.user_max_streams : 0,
    };
}

struct response *limits_refuse_stream(const struct api *api, const struct request *r, enum hub_answer answer) {
    size_t of_one = api->config.user_max_streams;
    if (answer == HUB_USER_FULL)
        return refuse(r, 429, "user_max_streams", "close some, or follow all jobs with one stream of /v1/events",
                      mem_printf("you have %zu event streams already, the limit of one user", of_one));
    return problem_full(r, 503, "the limit of event streams is reached",
                        "an administrator can raise the option max_streams", NULL);
}
