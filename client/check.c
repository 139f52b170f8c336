/* check.c -- `check`: whether the server can work with a room, before any job. */
#include <string.h>

#include "client/client_room.h"
#include "client/collection.h"
#include "client/commands.h"
#include "client/findings.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"

const struct command_option check_options[] = {
    ROOM_OPTIONS(OPTION_TEXT),
    {"pictures", 0, OPTION_TEXT, "DIR", "keep the pictures of the check there: the mesh over photographs, a plan"},
    FORMAT_OPTION,
    {0},
};

#define PICTURE_MAX ((size_t)64 << 20) /* bytes; the check's are about 1 MiB */
#define TRIES_MAX 5                    /* of a picture whose transfer breaks off */

static bool on_bytes(void *user, const struct reply *reply, const char *bytes, size_t length) {
    (void)reply;
    return buf_append(user, bytes, length);
}

/* The whole of it, into *out. */
static enum status fetch(struct client *c, const char *href, struct buf *out, struct reply *reply, struct error *err) {
    struct request_call call = {.path = href, .sink = on_bytes, .user = out, .once = true};
    enum status status = STATUS_UNAVAILABLE;
    for (int tries = 0; tries < TRIES_MAX && status == STATUS_UNAVAILABLE; tries++) {
        if (tries > 0 && !request_pause(c->request, tries, reply->retry_after_sec))
            return error_set(err, STATUS_CANCELLED, "interrupted");
        buf_clear(out);
        status = request_run(c->request, &call, reply, err);
    }
    return status;
}

static enum status fetch_picture(struct client *c, const cJSON *preview, const char *dir, struct reply *reply,
                                 struct error *err) {
    const char *name = member_text(preview, "name"), *href = member_text(preview, "href");
    if (!get_name_is_safe(name) || strchr(name, '/') || strncmp(href, "/v1/", 4) != 0) {
        reply->code = 0;
        return error_set(err, STATUS_CORRUPT, "the server lists a picture with an unsafe name: %.200s", name);
    }
    struct buf bytes;
    buf_init(&bytes, PICTURE_MAX);
    enum status status = fetch(c, href, &bytes, reply, err);
    if (status == STATUS_OK) {
        char *path = file_join(dir, name);
        status = file_replace(path, buf_text(&bytes), bytes.length, err);
        if (status != STATUS_OK)
            reply->code = 0; /* the failure is ours */
        mem_free(path);
    }
    buf_release(&bytes);
    return status;
}

static enum status fetch_pictures(struct client *c, const cJSON *scene, const char *dir, struct reply *reply,
                                  struct error *err) {
    const cJSON *preview;
    const cJSON *previews = member_items(cJSON_GetObjectItemCaseSensitive(scene, "facts"), "previews");
    enum status status = cJSON_GetArraySize(previews) > 0 ? file_make_dirs(dir, err) : STATUS_OK;
    if (status != STATUS_OK)
        reply->code = 0;
    cJSON_ArrayForEach(preview, previews) {
        if (status == STATUS_OK)
            status = fetch_picture(c, preview, dir, reply, err);
    }
    if (status == STATUS_OK)
        client_note(c, "%d picture%s in %s", cJSON_GetArraySize(previews), cJSON_GetArraySize(previews) == 1 ? "" : "s",
                    dir);
    return status;
}

/* A scene that an older server has checked knows nothing of its fit. Where it cannot be checked again, as for want of
 * the right to, it is shown as it is. */
static enum status renew(struct client_room *room, struct reply *reply, struct error *err) {
    if (strcmp(client_room_state(room), SCENE_STATE_READY) != 0 || *findings_fit(room->found) ||
        client_room_check_again(room, reply, err) != STATUS_OK)
        return STATUS_OK;
    return client_room_wait(room, reply, err);
}

static enum status check(struct client_room *room, const struct options *o, struct reply *reply, struct error *err) {
    const char *dir = options_text(o, "pictures", NULL);
    bool is_new = client_room_is_to_change(room);
    enum status status = client_room_send(room, reply, err);
    if (status == STATUS_OK)
        status = client_room_wait(room, reply, err);
    if (status == STATUS_OK && !is_new)
        status = renew(room, reply, err);
    return status == STATUS_OK && dir ? fetch_pictures(room->client, room->found, dir, reply, err) : status;
}

static int verdict(const struct client_room *room) {
    if (strcmp(client_room_state(room), SCENE_STATE_REJECTED) == 0)
        return CLIENT_REFUSED;
    bool fits = strcmp(findings_fit(room->found), "no") != 0;
    return fits && strcmp(client_room_state(room), SCENE_STATE_READY) == 0 ? CLIENT_OK : CLIENT_CONFLICT;
}

/* The end of the command. */
static int show(struct client_room *room, struct reply *reply, struct error *err, enum status status) {
    struct client *c = room->client;
    if (status == STATUS_CANCELLED)
        error_hint(err, "the same command continues where this one stopped");
    if (status != STATUS_OK)
        return client_fail(c, reply, err);
    if (c->json) {
        client_print_json(c, room->found);
    } else if (!c->quiet) {
        field_print(c, "scene", member_text(room->found, "id"));
        field_print(c, "state", client_room_state(room));
        findings_print(c, room->found);
    }
    return verdict(room);
}

int check_run(struct client *c, const struct options *o) {
    const char *scene = options_text(o, "scene", NULL);
    struct client_room room = {.client = c};
    struct reply reply;
    struct error err;
    reply_init(&reply);
    enum status status = STATUS_OK;
    if ((scene != NULL) == (o->word_count == 1)) {
        error_set(&err, STATUS_INPUT, scene ? "ROOM and --scene exclude each other" : "missing argument ROOM");
        status = error_hint(&err, "an example: unbake check living-room/");
    }
    if (status == STATUS_OK)
        status = client_room_open(&room, c, o, scene ? NULL : o->word[0], scene, &reply, &err);
    if (status == STATUS_OK)
        status = check(&room, o, &reply, &err);
    int code = show(&room, &reply, &err, status);
    client_room_release(&room);
    reply_release(&reply);
    return code;
}

int check_set_run(struct client *c, const struct options *o) {
    struct client_room room = {.client = c};
    struct reply reply;
    struct error err;
    reply_init(&reply);
    enum status status = STATUS_OK;
    if (o->word_count < 2)
        status = error_set(&err, STATUS_INPUT, "missing argument SCENE");
    for (const struct command_option *own = collection_options; own->name && status == STATUS_OK; own++)
        if (options_flag(o, own->name))
            status = error_set(&err, STATUS_INPUT, "--%s does not go with `scenes set`", own->name);
    if (status == STATUS_OK)
        status = client_room_reading_of(o->word + 2, o->word_count - 2, &room.reading, &err);
    if (status == STATUS_OK) {
        room.scene = mem_strdup(o->word[1]);
        status = client_room_fetch(&room, &reply, &err);
    }
    if (status == STATUS_OK)
        status = client_room_check_again(&room, &reply, &err);
    if (status == STATUS_OK)
        status = client_room_wait(&room, &reply, &err);
    int code = show(&room, &reply, &err, status);
    client_room_release(&room);
    reply_release(&reply);
    return code;
}
