/* handlers.h -- the functions of the route table. Each returns a reply, never NULL. */
#ifndef UNBAKE_HTTP_HANDLERS_H
#define UNBAKE_HTTP_HANDLERS_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* page.c */
struct response *page_file(struct api *api, struct request *r);

/* system.c */
struct response *system_root(struct api *api, struct request *r);
struct response *system_healthz(struct api *api, struct request *r);
struct response *system_readyz(struct api *api, struct request *r);
struct response *system_metrics(struct api *api, struct request *r);
struct response *system_openapi(struct api *api, struct request *r);
struct response *system_version(struct api *api, struct request *r);
struct response *system_settings(struct api *api, struct request *r);

/* session.c */
struct response *session_get(struct api *api, struct request *r);
struct response *session_add(struct api *api, struct request *r);
struct response *session_delete(struct api *api, struct request *r);

/* users.c */
struct response *users_list(struct api *api, struct request *r);
struct response *tokens_list(struct api *api, struct request *r);
struct response *tokens_add(struct api *api, struct request *r);
struct response *tokens_delete(struct api *api, struct request *r);

/* scenes.c */
struct response *scenes_list(struct api *api, struct request *r);
struct response *scenes_add(struct api *api, struct request *r);
struct response *scenes_get(struct api *api, struct request *r);
struct response *scenes_patch(struct api *api, struct request *r);
struct response *scenes_delete(struct api *api, struct request *r);

/* previews.c */
struct response *previews_get(struct api *api, struct request *r);

/* collect.c */
struct response *collect_now(struct api *api, struct request *r);

/* uploads.c */
struct response *uploads_options(struct api *api, struct request *r);
struct response *uploads_list(struct api *api, struct request *r);
struct response *uploads_add(struct api *api, struct request *r);
struct response *uploads_get(struct api *api, struct request *r);
struct response *uploads_patch(struct api *api, struct request *r);
struct response *uploads_delete(struct api *api, struct request *r);

/* jobs.c */
struct response *jobs_list(struct api *api, struct request *r);
struct response *jobs_get(struct api *api, struct request *r);
struct response *jobs_patch(struct api *api, struct request *r);
struct response *jobs_delete(struct api *api, struct request *r);

/* job_submit.c */
struct response *jobs_add(struct api *api, struct request *r);

/* job_files.c */
struct response *job_files_put(struct api *api, struct request *r);

/* job_action.c */
struct response *job_action_cancel(struct api *api, struct request *r);
struct response *job_action_pause(struct api *api, struct request *r);
struct response *job_action_redeliver(struct api *api, struct request *r);
struct response *job_action_resume(struct api *api, struct request *r);
struct response *job_action_retry(struct api *api, struct request *r);
struct response *job_action_extend(struct api *api, struct request *r);

/* outputs.c */
struct response *outputs_list(struct api *api, struct request *r);
struct response *outputs_get(struct api *api, struct request *r);
struct response *jobs_log(struct api *api, struct request *r);

/* nodes.c */
struct response *nodes_claim(struct api *api, struct request *r);
struct response *nodes_report(struct api *api, struct request *r);
struct response *nodes_end(struct api *api, struct request *r);

/* node_files.c */
struct response *node_files_scene(struct api *api, struct request *r);
struct response *node_files_scene_get(struct api *api, struct request *r);
struct response *node_files_checkpoint(struct api *api, struct request *r);
struct response *node_files_checkpoint_get(struct api *api, struct request *r);
struct response *node_files_checkpoint_put(struct api *api, struct request *r);
struct response *node_files_output_put(struct api *api, struct request *r);
struct response *node_files_log_put(struct api *api, struct request *r);

/* events.c */
struct response *events_get(struct api *api, struct request *r);
struct response *events_all(struct api *api, struct request *r);
/* GET of a job with ?wait=; NULL where the change has happened already. */
struct response *events_wait(struct api *api, struct request *r, const struct job *job);

#endif
