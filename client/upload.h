/* upload.h -- sends a room so that no byte is sent twice (tus protocol 1.0.0, tus.io). The server counts what it has
 * on disk. After a broken connection, or a restart of the server or of this program, the upload resumes there; it is
 * found again by the SHA-256 of the whole. */
#ifndef UNBAKE_CLIENT_UPLOAD_H
#define UNBAKE_CLIENT_UPLOAD_H

#include "client/client.h"
#include "client/pack.h"

struct client_upload {
    struct client *client;
    struct pack *pack;
    const char *name, *sha256; /* name of the room; SHA-256 of the whole stream */
    const char *reading;       /* how the room is to be read, JSON; NULL: not given */
    uint64_t length;           /* of the stream, bytes */
};

/* Returns when the server has everything and the scene exists. Retries until --retry seconds (600) after the last
 * byte was sent. */
enum status upload_send(const struct client_upload *u, struct reply *reply, struct error *err);

#endif
