/* url.h -- parses http and https URLs, and encodes what becomes a part of one (RFC 3986, the parts used here). */
#ifndef UNBAKE_COMMON_URL_H
#define UNBAKE_COMMON_URL_H

#include <stdbool.h>

#include "common/buf.h"
#include "common/error.h"

#define URL_MAX_BYTES 1000 /* of a whole URL */

struct url {
    bool is_tls;
    char host[256]; /* a name or an address; IPv6 without its brackets */
    char port[6];
    const char *target; /* path and query; borrowed from the text; "" for none */
};

/* STATUS_INPUT for other schemes, user names or passwords, fragments, and invalid characters. */
enum status url_parse(const char *text, struct url *url, struct error *err);

/* Appends `text` with all but unreserved characters percent-encoded (2.1, 2.3); slashes stay where keep_slash. */
void url_encode(struct buf *out, const char *text, bool keep_slash);

#endif
