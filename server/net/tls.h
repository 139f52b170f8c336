/* tls.h -- the daemon's certificate and key, read again while connections are served. tls.c is the
 * only include of GnuTLS.
 *
 * The certificate in use is one of the process: libmicrohttpd asks for it without saying for whom. */
#ifndef UNBAKE_NET_TLS_H
#define UNBAKE_NET_TLS_H

#include <stddef.h>

#include "common/error.h"

/* A GnuTLS priority string. TLS 1.2 only with forward secrecy: no static RSA, and no SHA-1 in MACs or signatures. */
#define TLS_PRIORITIES                                                                                                 \
    "NORMAL:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-RSA:-SHA1:-SIGN-RSA-SHA1:-SIGN-DSA-SHA1:-SIGN-ECDSA-SHA1"

struct tls; /* opaque */

/* PEM files: a chain, the server's certificate first, and its key. */
enum status tls_new(struct tls **tls, const char *certificate_file, const char *key_file, struct error *err);
/* Reads the files again, for connections that begin from now on. On an error the old certificate stays in use. */
enum status tls_reload(struct tls *tls, struct error *err);
void tls_free(struct tls *tls); /* NULL is allowed; no connection may be left */

/* The value for MHD_OPTION_HTTPS_CERT_CALLBACK. */
void *tls_certificate_callback(void);
/* Writes into a connection's session, past libmicrohttpd; sends only what fits at once. */
void tls_send(void *session, const void *data, size_t length);

const char *tls_library_version(void); /* GnuTLS's */

/* Days until the file's first certificate expires (negative: days since), for `unbaked doctor`. */
enum status tls_days_left(const char *certificate_file, double *days, struct error *err);

#endif
