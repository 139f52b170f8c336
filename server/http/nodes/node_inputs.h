/* node_inputs.h -- what a job that runs elsewhere reads: of a reconstruction the scene's files; of a render
 * outputs/NAME, the outputs of the job that it reads, and files/NAME, the files that were sent with it. Nodes keep them
 * under an id: the scene's or, of a render, the SHA-256 of the list, so that renders that read the same share it. */
#ifndef UNBAKE_HTTP_NODES_NODE_INPUTS_H
#define UNBAKE_HTTP_NODES_NODE_INPUTS_H

#include "common/json.h"
#include "server/http/api.h"

/* [{"name","bytes","sha256"},...]; the caller's. */
enum status node_inputs_list(struct api *api, const struct job *job, char id[SCENE_ID_SIZE], cJSON **list,
                             struct error *err);
/* Opens one of them; *fd is the caller's, -1 on errors. */
enum status node_inputs_open(struct api *api, const struct job *job, const char *name, int *fd, struct error *err);

#endif
