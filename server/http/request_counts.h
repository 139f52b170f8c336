/* request_counts.h -- counts requests by route and status. Thread-safe. */
#ifndef UNBAKE_HTTP_REQUEST_COUNTS_H
#define UNBAKE_HTTP_REQUEST_COUNTS_H

#include "common/buf.h"
#include "server/transport/message.h"

struct request_counts; /* opaque */

struct request_counts *request_counts_new(void);
void request_counts_free(struct request_counts *t);
void request_counts_add(struct request_counts *t, const struct request *r,
                        int status); /* status 0: no reply was sent */
/* Appends a line `name{method="GET",route="/v1/jobs",code="200"} 7` for every count above 0. */
void request_counts_print(struct request_counts *t, const char *name, struct buf *b);

#endif
