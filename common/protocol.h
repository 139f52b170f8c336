/* protocol.h -- the words that daemon, worker and client share over HTTP. */
#ifndef UNBAKE_COMMON_PROTOCOL_H
#define UNBAKE_COMMON_PROTOCOL_H

#define PROTOCOL_DEFAULT_SERVER "http://127.0.0.1:7117" /* where the daemon listens unless it is told otherwise */

#define UNBAKE_VERSION "0.1.0"
#define PROTOCOL_API "v1" /* the first part of every path; names and meanings in it only grow */

/* A webhook's secret as standardwebhooks.com writes it: this and the base64 of a key of so many bytes. The text of any
 * other secret is the key itself. */
#define WEBHOOK_SECRET_PREFIX "whsec_"
#define WEBHOOK_KEY_MIN 24 /* bytes, both */
#define WEBHOOK_KEY_MAX 64

/* Event types of GET /v1/jobs/{id}/events. */
#define EVENT_STATE "state"
#define EVENT_PROGRESS "progress"
#define EVENT_METRIC "metric"
#define EVENT_PREVIEW "preview"
#define EVENT_OUTPUT "output"
#define EVENT_LOG "log"
#define EVENT_RESYNC "resync" /* events that the reader has not seen are gone: it must GET the current state */

/* Job states; see server/job/job.h for the diagram. */
#define JOB_STATE_QUEUED "queued"
#define JOB_STATE_RUNNING "running"
#define JOB_STATE_PAUSED "paused"
#define JOB_STATE_SUCCEEDED "succeeded"
#define JOB_STATE_FAILED "failed"
#define JOB_STATE_CANCELLED "cancelled"
#define JOB_WAITING_IN "waiting in " /* the reason of a running job that waits in a cluster's queue begins so */

/* Kinds of jobs. */
#define JOB_KIND_RECONSTRUCT "reconstruct"
#define JOB_KIND_RENDER "render"     /* pictures of a reconstruction under another light */
#define JOB_KIND_EVALUATE "evaluate" /* a reconstruction compared with the truth of its room */

/* Scene states. */
#define SCENE_STATE_RECEIVING "receiving"
#define SCENE_STATE_CHECKING "checking"
#define SCENE_STATE_READY "ready"
#define SCENE_STATE_REJECTED "rejected"

#define TUS_VERSION "1.0.0" /* of the protocol of /v1/uploads: tus.io */

#define NODE_CLAIMANT_FIELD                                                                                            \
    "Unbake-Claimant"      /* header in which an `unbaked node` identifies itself: random hex digits */
#define NODE_LOG_MAX 65536 /* bytes of the end of a worker's log that a node sends */

#define MIME_JSON "application/json"
#define MIME_PROBLEM "application/problem+json"
#define MIME_TUS "application/offset+octet-stream" /* the body of a PATCH to /v1/uploads/ID */
#define MIME_SSE "text/event-stream"
#define MIME_NDJSON "application/x-ndjson"

#endif
