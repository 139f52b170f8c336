/* page.h -- the web page: server/web/ and three.js, which the build embeds. */
#ifndef UNBAKE_HTTP_PAGE_H
#define UNBAKE_HTTP_PAGE_H

#include "server/transport/message.h"

/* The page itself, which GET / gives a browser. */
struct response *page_index(void);

#endif
