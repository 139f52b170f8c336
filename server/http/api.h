/* api.h -- what every handler works with: the daemon's parts, limits and counters. */
#ifndef UNBAKE_HTTP_API_H
#define UNBAKE_HTTP_API_H

#include <stdatomic.h>

#include "server/data/collector.h"
#include "server/data/folder.h"
#include "server/job/scheduler.h"
#include "server/store/store.h"
#include "server/transport/message.h"

#define API_NAME_MAX_BYTES 200  /* of the name that a user gives a scene, an upload or a job */
#define API_LABEL_MAX_BYTES 100 /* of the name of a label, and of its text */

struct api_library {
    const char *name, *version;
};

struct proxies; /* address.h */

enum api_access {
    API_ACCESS_AUTO,   /* open until the first token is made, then tokens only */
    API_ACCESS_TOKENS, /* tokens only */
    API_ACCESS_OPEN    /* anybody, as admin */
};

struct api_config {
    const char *data_dir;
    int max_attempts;
    double small_render_cost; /* as in scheduler_config.h */
    size_t queue_limit;       /* queued jobs */
    size_t user_queue_limit;  /* queued jobs of one user; 0: no limit */
    size_t user_max_jobs;     /* jobs of one user, in any state; 0: no limit */
    uint64_t user_max_bytes;  /* what one user keeps; 0: no limit */
    uint64_t max_upload_bytes;
    uint64_t min_free_bytes;      /* of the disk; uploads leave at least this much free */
    uint64_t admin_free_bytes;    /* more of it, kept for admins */
    unsigned user_pledge_percent; /* share of the free space that one user's unfinished uploads may reserve; 0: all */
    size_t max_streams;           /* event streams at once */
    size_t user_max_streams, user_max_uploads, user_max_checks; /* of one user; 0: no limit */
    double keepalive_sec;
    enum api_access access;
    const struct proxies *proxies; /* trusted to name client addresses (address.h); NULL: none */
    bool is_tls;                   /* connections are encrypted by this daemon */
    int64_t scene_keep_ms, job_keep_ms, upload_keep_ms,
        empty_upload_ms /* 0: as upload_keep_ms */; /* see store/retention.h */
    const char *server_names;                       /* host names besides loopback's; separated by spaces or commas */
    const char *executors; /* names of those that jobs may run on; separated by spaces or commas; NULL: any */
    void (*executor_metrics)(const void *user, struct buf *b); /* appends theirs to /metrics; NULL: none */
    const void *executor_user;
    const struct api_library *libraries;
    size_t library_count;
};

struct hub;            /* events/hub.h */
struct digests;        /* uploads/digests.h */
struct resumables;     /* uploads/resumable.h */
struct arrivals;       /* uploads/upload.h */
struct listener;       /* transport/listener.h */
struct request_counts; /* request_counts.h */
struct auth_throttle;  /* auth_throttle.h */
struct readiness;      /* readiness.h */

struct api {
    struct api_config config; /* pointers in it are borrowed */
    struct store *store;      /* borrowed */
    struct folder folder;     /* the data folder */
    struct collector_config collector_config;
    struct scheduler *scheduler; /* borrowed */
    struct hub *hub;
    struct digests *digests;
    struct resumables *resumables;
    struct arrivals *arrivals;
    struct readiness *readiness;
    struct listener *listener; /* NULL before it listens; for metrics */
    struct request_counts *request_counts;
    struct auth_throttle *auth_throttle; /* on wrong tokens */
    atomic_ullong uploaded_bytes;
};

#endif
