/* scene_body.h -- the body of POST /v1/scenes, a bundle, on its way to disk. */
#ifndef UNBAKE_HTTP_SCENE_BODY_H
#define UNBAKE_HTTP_SCENE_BODY_H

#include "server/http/api.h"
#include "server/transport/message.h"

/* Start of the body of r, which goes on as whole_body.h: sets r->upload, or refuses with a reply. */
struct response *scene_body_begin(struct api *api, struct request *r);

#endif
