/* retention.h -- options and columns on how long the server keeps things and their disk usage. */
#ifndef UNBAKE_CLIENT_RETENTION_H
#define UNBAKE_CLIENT_RETENTION_H

#include "client/client.h"

/* For tables of options. */
#define KEEPING_OPTIONS                                                                                                \
    {"pin", 0, OPTION_FLAG, NULL, "keep it for good"}, {"unpin", 0, OPTION_FLAG, NULL, "no longer"}, {                 \
        "keep-days", 0, OPTION_SECONDS, "N", "remove it N days from now; 0: as the server's rules say"                 \
    }

/* Adds what those options request to the body of a PATCH. */
enum status retention_describe(const struct options *o, cJSON *body, struct error *err);

/* "pinned", the time left ("3d 4h"), or "" where a job, scene or upload does not expire. */
void retention_text(char out[16], const cJSON *thing);
/* The same in full: "never: pinned", or the time; borrowed. */
const char *retention_time(const cJSON *thing);
/* Disk usage of a job or scene on the server ("1.5 GiB"), or "" if unknown. */
void retention_disk(char out[16], const cJSON *thing);
/* "kept for good", "removed in 3d04h", or "". */
void retention_sentence(char out[40], const cJSON *thing);

#endif
