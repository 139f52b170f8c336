/* callbacks.h -- what libmicrohttpd calls in the course of a request; `listener` is the struct listener. */
#ifndef UNBAKE_TRANSPORT_CALLBACKS_H
#define UNBAKE_TRANSPORT_CALLBACKS_H

#include "server/transport/exchange.h"

/* The request line has arrived. Makes the exchange. */
void *callbacks_on_target(void *listener, const char *target, struct MHD_Connection *connection);
/* Called for the head, for each part of the body, and at the end of the body. */
enum MHD_Result callbacks_on_request(void *listener, struct MHD_Connection *connection, const char *url,
                                     const char *method, const char *version, const char *data, size_t *length,
                                     void **context);
/* The reply has been sent, or the connection has failed. Frees the exchange. */
void callbacks_on_completed(void *listener, struct MHD_Connection *connection, void **context,
                            enum MHD_RequestTerminationCode code);

#endif
