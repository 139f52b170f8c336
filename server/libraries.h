/* libraries.h -- the libraries that this program runs with, as they say themselves. */
#ifndef UNBAKE_SERVER_LIBRARIES_H
#define UNBAKE_SERVER_LIBRARIES_H

#define LIBRARY_COUNT 19        /* that the Makefile links */
#define LIBRARY_VERSION_SIZE 24 /* bytes with the NUL */

struct library {
    const char *name; /* static storage */
    char version[LIBRARY_VERSION_SIZE];
};

/* All that the Makefile links. */
void libraries_list(struct library list[LIBRARY_COUNT]);
/* "libmicrohttpd 0.9.75, sqlite ..."; the caller's (mem_free). */
char *libraries_text(void);
/* What one of them was built without, though some rooms need it, as a sentence; NULL: nothing. */
const char *libraries_lack(void);

#endif
