/* reply.h -- an exchange's reply on its way to the client: a text, a file, or a stream that waits for events. */
#ifndef UNBAKE_TRANSPORT_REPLY_H
#define UNBAKE_TRANSPORT_REPLY_H

#include "server/transport/exchange.h"

/* Hands x->reply to the library. MHD_NO: the connection must be closed. */
enum MHD_Result reply_queue(struct exchange *x);
/* Sends x->reply while the request's body is still arriving. */
void reply_early(struct exchange *x);
/* Resumes all waiting streams, which end once is_closing is set. The mutex is held. */
void reply_end_streams(struct listener *l);

#endif
