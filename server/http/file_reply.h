/* file_reply.h -- the reply that sends a file which a worker wrote: an output, a scene's picture. Tags, ranges, and
 * what keeps it from acting in a browser. */
#ifndef UNBAKE_HTTP_FILE_REPLY_H
#define UNBAKE_HTTP_FILE_REPLY_H

#include "server/transport/message.h"
#include "server/uploads/digests.h"

/* Sends the open file `fd` (taken), of which `file` tells what it is; 304 or 416 where that is the answer. */
struct response *file_reply(const struct request *r, int fd, const struct digests_file *file, const char *content_type);

#endif
