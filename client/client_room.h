/* client_room.h -- a room on its way to the server: measured, sent unless its content is there already, read as the
 * user says, checked.
 *
 *      client_room_open ──> client_room_send ──> client_room_wait
 *
 * 1. The room is read once for its SHA-256, which is the scene's id: content that is there is not sent again.
 * 2. A reading that is given (--scene-set) counts also for content that is there: it is checked again then. So is a
 *    scene that was rejected. */
#ifndef UNBAKE_CLIENT_CLIENT_ROOM_H
#define UNBAKE_CLIENT_CLIENT_ROOM_H

#include "client/client.h"
#include "client/meter.h"
#include "client/pack.h"

struct client_room {
    struct client *client;
    struct pack *pack; /* NULL where the scene was named */
    char *name;        /* of the room, NULL where the scene was named; owned */
    char *scene;       /* id, or its beginning where it was named; owned */
    uint64_t length;   /* of the upload, bytes */
    bool was_sent;
    cJSON *reading; /* as --scene-set has it; NULL: nothing was given; owned */
    cJSON *found;   /* the scene as the server showed it last; NULL: it is not there; owned */
    struct meter meter;
};

/* `kind`: OPTION_TEXT, or OPTION_LIST where there may be several. */
#define ROOM_OPTIONS(kind)                                                                                             \
    {"scene", 0, kind, "SCENE", "a room that is there already, instead of ROOM"}, {                                    \
        "scene-set", 0, OPTION_LIST, "KEY=VALUE",                                                                      \
            "how the room is to be read: transforms, mesh, axes, mesh_axes, scale, shift, coordinates, lens, "         \
            "distortion or exposures"                                                                                  \
    }

/* What is there of a room: of the folder or archive at `path`, or of the scene (one of them is NULL), which is to be
 * read as the options say. STATUS_OK also where it is not on the server. */
enum status client_room_open(struct client_room *room, struct client *c, const struct options *o, const char *path,
                             const char *scene, struct reply *reply, struct error *err);
void client_room_release(struct client_room *room);

/* Asks the server for the scene. */
enum status client_room_fetch(struct client_room *room, struct reply *reply, struct error *err);
/* "ready", "" where it is not there; borrowed. */
const char *client_room_state(const struct client_room *room);
/* Whether client_room_send changes what the server has: the content, or how it is read. */
bool client_room_is_to_change(const struct client_room *room);
/* Sends the content, or gives the scene its reading, where that is needed. */
enum status client_room_send(struct client_room *room, struct reply *reply, struct error *err);
/* Has a scene checked again that is there as it is to be. */
enum status client_room_check_again(struct client_room *room, struct reply *reply, struct error *err);
/* Waits for the end of its check, through restarts of the server; also returns when the scene waits for room on the
 * server's disk. */
enum status client_room_wait(struct client_room *room, struct reply *reply, struct error *err);

/* KEY=VALUE words as a reading, with defaults left out; the caller's. */
enum status client_room_reading_of(const char *const *words, size_t count, cJSON **reading, struct error *err);

#endif
