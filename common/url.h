/* url.h -- the http and https URLs that we call, taken apart (RFC 3986, the part that matters). */
#ifndef UNBAKE_COMMON_URL_H
#define UNBAKE_COMMON_URL_H

#include <stdbool.h>

#include "common/error.h"

#define URL_MAX_BYTES 1000

struct url {
    bool is_tls;
    char host[256]; /* a name or an address; IPv6 without its brackets */
    char port[6];
    const char *target; /* path and query; borrowed from the text; "" for none */
};

/* STATUS_INPUT for other schemes, names with a user or a password, fragments, and characters that
 * no URL has. */
enum status url_parse(const char *text, struct url *url, struct error *err);

#endif
