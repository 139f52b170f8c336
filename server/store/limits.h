/* limits.h -- how many things there may be. */
#ifndef UNBAKE_STORE_LIMITS_H
#define UNBAKE_STORE_LIMITS_H

#include <stddef.h>

/* Limits on a number of things: in all, and of one user (0: no limit; nobody has none). One more is STATUS_LIMIT. */
struct count_limits {
    size_t all, one_user;
};

#endif
