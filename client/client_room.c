/* client_room.c -- see client_room.h. */
#include "client/client_room.h"

#include <stdlib.h>
#include <string.h>

#include "client/upload.h"
#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/reading.h"
#include "common/url.h"

#define PATIENCE_SEC 600.0 /* while the server is away */
#define TRIES_MAX 4        /* pauses between looks grow up to 1.6 s */

/* --- what is given ------------------------------------------------------------------------ */

enum status client_room_reading_of(const char *const *words, size_t count, cJSON **reading, struct error *err) {
    cJSON *given = cJSON_CreateObject();
    struct reading parsed = reading_default();
    enum status status = STATUS_OK;
    *reading = NULL;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = reading_parse_assignment(words[i], given, err);
    if (status == STATUS_OK)
        status = reading_parse(given, &parsed, err);
    if (status == STATUS_OK)
        *reading = reading_json(&parsed);
    reading_release(&parsed);
    cJSON_Delete(given);
    return status;
}

static enum status read_options(struct client_room *room, const struct options *o, struct error *err) {
    const char **words = mem_array(o->given_count + 1, sizeof *words);
    size_t count = 0;
    for (size_t i = 0; i < o->given_count; i++)
        if (strcmp(o->given[i].option->name, "scene-set") == 0)
            words[count++] = o->given[i].text;
    enum status status = count ? client_room_reading_of(words, count, &room->reading, err) : STATUS_OK;
    mem_free(words);
    return status;
}

/* "photos/living-room.tar.gz" -> "living-room"; "." -> the folder's own name. */
static char *room_name(const char *path) {
    static const char *const endings[] = {".zip", ".tar", ".tar.gz", ".tgz", ".tar.zst"};
    char *whole = realpath(path, NULL);
    const char *base = whole ? strrchr(whole, '/') + 1 : path;
    size_t length = strlen(base);
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++) {
        size_t ending = strlen(endings[i]);
        if (length > ending && strcmp(base + length - ending, endings[i]) == 0) {
            length -= ending;
            break;
        }
    }
    char *name = mem_strndup(base, length > 200 ? 200 : length);
    free(whole);
    return *name ? name : (mem_free(name), mem_strdup("room"));
}

static bool on_measured(void *user, uint64_t done) {
    struct client_room *room = user;
    meter_update(&room->meter, (double)done);
    return !request_interrupted(room->client->request);
}

static enum status measure(struct client_room *room, const char *path, struct error *err) {
    struct client *c = room->client;
    char sha256[SHA256_HEX_SIZE];
    enum status status = pack_open(&room->pack, path, err);
    if (status == STATUS_NOT_FOUND || status == STATUS_INPUT) {
        err->status = STATUS_INPUT;
        return *err->hint ? STATUS_INPUT : error_hint(err, "ROOM is a folder or an archive");
    }
    if (status != STATUS_OK)
        return status;
    room->name = room_name(path);
    meter_begin(&room->meter, c->quiet || c->json ? NULL : &c->err, "reading", 0.0,
                (double)pack_content_bytes(room->pack));
    status = pack_measure(room->pack, on_measured, room, &room->length, sha256, err);
    meter_end(&room->meter);
    if (status == STATUS_OK)
        room->scene = mem_strdup(sha256);
    return status;
}

/* --- what is there ------------------------------------------------------------------------ */

enum status client_room_fetch(struct client_room *room, struct reply *reply, struct error *err) {
    struct buf path;
    buf_init(&path, 4096);
    buf_puts(&path, "/v1/scenes/");
    url_encode(&path, room->scene, false);
    enum status status = request_get(room->client->request, buf_text(&path), reply, err);
    buf_release(&path);
    if (status != STATUS_OK)
        return status;
    cJSON_Delete(room->found);
    room->found = cJSON_Duplicate(reply->json, true);
    return STATUS_OK;
}

enum status client_room_open(struct client_room *room, struct client *c, const struct options *o, const char *path,
                             const char *scene, struct reply *reply, struct error *err) {
    *room = (struct client_room){.client = c};
    enum status status = read_options(room, o, err);
    if (status != STATUS_OK)
        return status;
    if (scene)
        room->scene = mem_strdup(scene);
    else
        status = measure(room, path, err);
    if (status == STATUS_OK)
        status = client_room_fetch(room, reply, err);
    return status == STATUS_NOT_FOUND && reply->code == 404 ? STATUS_OK : status;
}

void client_room_release(struct client_room *room) {
    pack_close(room->pack);
    mem_free(room->name);
    mem_free(room->scene);
    cJSON_Delete(room->reading);
    cJSON_Delete(room->found);
    *room = (struct client_room){0};
}

const char *client_room_state(const struct client_room *room) { return member_text(room->found, "state"); }

static bool is_state(const struct client_room *room, const char *state) {
    return strcmp(client_room_state(room), state) == 0;
}

static bool reads_otherwise(const struct client_room *room) {
    const cJSON *reading = cJSON_GetObjectItemCaseSensitive(room->found, "reading");
    return room->reading && !(cJSON_IsObject(reading) && cJSON_Compare(room->reading, reading, true));
}

bool client_room_is_to_change(const struct client_room *room) {
    return !room->found || is_state(room, SCENE_STATE_REJECTED) || reads_otherwise(room);
}

/* --- sending ------------------------------------------------------------------------------ */

static enum status upload(struct client_room *room, struct reply *reply, struct error *err) {
    char size[16], *reading = room->reading ? json_text(room->reading) : NULL;
    struct client_upload u = {.client = room->client,
                              .pack = room->pack,
                              .name = room->name,
                              .sha256 = room->scene,
                              .reading = reading,
                              .length = room->length};
    enum status status = upload_send(&u, reply, err);
    mem_free(reading);
    format_bytes(size, (double)room->length);
    room->was_sent = status == STATUS_OK;
    if (status == STATUS_OK)
        client_note(room->client, "sent %s (%zu file%s, %s)", room->name, pack_file_count(room->pack),
                    pack_file_count(room->pack) == 1 ? "" : "s", size);
    return status;
}

/* Puts the scene back into `checking`. */
static enum status give_reading(struct client_room *room, const cJSON *reading, struct reply *reply,
                                struct error *err) {
    cJSON *body = cJSON_CreateObject();
    char *path = mem_printf("/v1/scenes/%s", member_text(room->found, "id"));
    json_add(body, "reading", cJSON_IsObject(reading) ? cJSON_Duplicate(reading, true) : cJSON_CreateObject());
    struct request_call call = {.method = "PATCH", .path = path, .body = body, .same_twice = true};
    enum status status = request_run(room->client->request, &call, reply, err);
    if (status == STATUS_OK) {
        cJSON_Delete(room->found);
        room->found = cJSON_Duplicate(reply->json, true);
    }
    mem_free(path);
    cJSON_Delete(body);
    return status;
}

enum status client_room_check_again(struct client_room *room, struct reply *reply, struct error *err) {
    const cJSON *present = cJSON_GetObjectItemCaseSensitive(room->found, "reading");
    return give_reading(room, room->reading ? room->reading : present, reply, err);
}

enum status client_room_send(struct client_room *room, struct reply *reply, struct error *err) {
    enum status status = STATUS_OK;
    if (!room->found && !room->pack)
        return client_room_fetch(room, reply, err); /* says that there is none */
    if (!room->found) {
        status = upload(room, reply, err);
        if (status == STATUS_OK)
            status = client_room_fetch(room, reply, err);
        /* An upload that had begun before may have said nothing of it, and jobs may keep the scene as it was. */
        if (status == STATUS_OK && reads_otherwise(room))
            status = client_room_check_again(room, reply, err);
        return status;
    }
    if (room->pack)
        client_note(room->client, "the server has this room already");
    return client_room_is_to_change(room) ? client_room_check_again(room, reply, err) : STATUS_OK;
}

static bool is_checked(const struct client_room *room) {
    return !is_state(room, SCENE_STATE_CHECKING) ||
           cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(room->found, "problems")) > 0;
}

enum status client_room_wait(struct client_room *room, struct reply *reply, struct error *err) {
    struct client *c = room->client;
    double patience = c->retry_sec >= 0.0 ? c->retry_sec : PATIENCE_SEC, answered_at = clock_sec();
    enum status status = STATUS_OK;
    bool was_told = false;
    for (int tries = 0; status == STATUS_OK && !is_checked(room); tries++) {
        if (tries == TRIES_MAX && !was_told)
            client_note(c, "the server checks the room");
        was_told = was_told || tries == TRIES_MAX;
        if (!request_pause(c->request, tries < TRIES_MAX ? tries : TRIES_MAX, -1.0))
            return error_set(err, STATUS_CANCELLED, "interrupted");
        status = client_room_fetch(room, reply, err);
        if (status == STATUS_OK)
            answered_at = clock_sec();
        else if (status == STATUS_UNAVAILABLE && clock_sec() - answered_at < patience)
            status = STATUS_OK;
    }
    return status;
}
