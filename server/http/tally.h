/* tally.h -- how many requests each route has answered with each status. Thread-safe. */
#ifndef UNBAKE_HTTP_TALLY_H
#define UNBAKE_HTTP_TALLY_H

#include "common/buf.h"
#include "server/http/message.h"

struct tally; /* opaque */

struct tally *tally_new(void);
void tally_free(struct tally *t);
void tally_add(struct tally *t, const struct request *r, int status); /* status 0: none was sent */
/* Appends `name{method="GET",route="/v1/jobs",code="200"} 7` a line, for all that is not 0. */
void tally_print(struct tally *t, const char *name, struct buf *b);

#endif
