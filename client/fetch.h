/* fetch.h -- one output of a job becomes a file.
 *
 * 1. A file has its name only when its content has the SHA-256 that the server lists; before, it is
 *    NAME.part.
 * 2. What NAME.part holds is hashed, not trusted: if the whole is wrong in the end, it is fetched
 *    from its beginning once more.
 * 3. A running job may replace an output at any time: If-Range names the version, and after a
 *    mismatch the list is asked for again. */
#ifndef UNBAKE_CLIENT_FETCH_H
#define UNBAKE_CLIENT_FETCH_H

#include "client/client.h"
#include "client/meter.h"
#include "common/sha256.h"

struct fetch {
    struct client *client;
    int64_t job;
    const char *dir;
    cJSON *outputs; /* the server's list; owned */
    struct reply reply;
    struct error *err;

    /* The current file: */
    char *name, *path, *part; /* owned */
    char sha256[SHA256_HEX_SIZE];
    uint64_t bytes;
    int fd;
    uint64_t have; /* bytes of NAME.part, all of them in `hash` */
    struct sha256 hash;
    bool resumed;
    double moved_at;          /* when bytes last arrived */
    enum status write_status; /* a local write error during the transfer */
    struct meter meter;
};

/* Asks for the list of outputs. */
enum status fetch_list(struct fetch *f);
/* Fetches the output f->name to f->path by way of f->part, and adds the outcome to `results`. */
enum status fetch_one(struct fetch *f, cJSON *results);

#endif
