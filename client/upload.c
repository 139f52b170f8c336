/* upload.c -- see upload.h.
 *
 *      find ──(none)──> create ──> ask where it stands ──> send the rest ──> whole
 *        ^                │              │   ^                 │
 *        └───(gone)───────┴──────────────┘   └──(broken off)───┘
 *
 * Every request is tried once; the loop around them sees to the next try. */
#include "client/upload.h"

#include <string.h>

#include "client/meter.h"
#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"

#define PATIENCE_SEC 600.0 /* without a byte, after which an upload is given up; --retry sets it */
#define READING_MAX 400    /* bytes; what the server takes of Upload-Metadata is 1000, a longer one comes by PATCH */
#define SILENCE_SEC 60.0   /* the connection is dead after this long without traffic */
#define VERSION_FIELD "Tus-Resumable: " TUS_VERSION

struct upload_sending {
    const struct client_upload *u;
    char *path;       /* of the upload; NULL: not found or created yet; owned */
    uint64_t offset;  /* bytes that the server has */
    uint64_t pack_at; /* the stream's next byte */
    double moved_at;  /* when bytes were last sent */
    bool was_lost;    /* the user was told that the connection is lost */
    struct meter meter;
};

/* Standard base64 of `text`, appended. */
static void put_base64(struct buf *out, const char *text) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t left = strlen(text); left > 0;) {
        const unsigned char *at = (const unsigned char *)text;
        size_t count = left < 3 ? left : 3;
        unsigned bits =
            (unsigned)at[0] << 16 | (count > 1 ? (unsigned)at[1] << 8 : 0u) | (count > 2 ? (unsigned)at[2] : 0u);
        buf_printf(out, "%c%c%c%c", digits[bits >> 18], digits[bits >> 12 & 63],
                   count > 1 ? digits[bits >> 6 & 63] : '=', count > 2 ? digits[bits & 63] : '=');
        text += count;
        left -= count;
    }
}

static enum status find(struct upload_sending *s, struct reply *reply, struct error *err) {
    char *path = mem_printf("/v1/uploads?sha256=%s", s->u->sha256);
    struct request_call call = {.path = path, .once = true};
    enum status status = request_run(s->u->client->request, &call, reply, err);
    const cJSON *item;
    const cJSON *items = member_items(reply->json, "items");
    cJSON_ArrayForEach(item, items) {
        const char *self = member_text(cJSON_GetObjectItemCaseSensitive(item, "links"), "self");
        bool unfinished = !*member_text(item, "scene");
        if (!s->path && unfinished && *self == '/' && member_number(item, "length", 0.0) == (double)s->u->length)
            s->path = mem_strdup(self);
    }
    mem_free(path);
    return status;
}

static enum status create(struct upload_sending *s, struct reply *reply, struct error *err) {
    struct buf metadata;
    char length[64];
    buf_init(&metadata, 4096);
    buf_puts(&metadata, "Upload-Metadata: name ");
    put_base64(&metadata, s->u->name);
    buf_puts(&metadata, ",sha256 ");
    put_base64(&metadata, s->u->sha256);
    if (s->u->reading && strlen(s->u->reading) <= READING_MAX) {
        buf_puts(&metadata, ",reading ");
        put_base64(&metadata, s->u->reading);
    }
    snprintf(length, sizeof length, "Upload-Length: %llu", (unsigned long long)s->u->length);
    struct request_call call = {
        .method = "POST", .path = "/v1/uploads", .once = true, .header = {VERSION_FIELD, length, buf_text(&metadata)}};
    enum status status = request_run(s->u->client->request, &call, reply, err);
    if (status == STATUS_OK && reply->location[0] == '/')
        s->path = mem_strdup(reply->location);
    else if (status == STATUS_OK)
        status = error_set(err, STATUS_UNAVAILABLE, "the server made an upload but sent no Location");
    buf_release(&metadata);
    return status;
}

/* Takes the offset from a reply. */
static enum status take_offset(struct upload_sending *s, const struct reply *reply, struct error *err) {
    if (reply->upload_offset < 0 || (uint64_t)reply->upload_offset > s->u->length)
        return error_set(err, STATUS_UNAVAILABLE, "the server sent no valid Upload-Offset");
    if ((uint64_t)reply->upload_offset > s->offset)
        s->moved_at = clock_sec();
    s->offset = (uint64_t)reply->upload_offset;
    return STATUS_OK;
}

static enum status ask(struct upload_sending *s, struct reply *reply, struct error *err) {
    struct request_call call = {
        .method = "HEAD", .path = s->path, .header = {VERSION_FIELD}, .once = true, .silence_sec = SILENCE_SEC};
    enum status status = request_run(s->u->client->request, &call, reply, err);
    return status == STATUS_OK ? take_offset(s, reply, err) : status;
}

/* --- the rest of the bytes ----------------------------------------------------------------- */

static enum status read_pack(void *user, void *bytes, size_t room, size_t *got, struct error *err) {
    struct upload_sending *s = user;
    enum status status = pack_read(s->u->pack, bytes, room, got, err);
    s->pack_at += *got;
    return status;
}

/* Moves the stream to the upload's offset. */
static enum status seek_pack(void *user, struct error *err) {
    struct upload_sending *s = user;
    enum status status = STATUS_OK;
    if (s->pack_at > s->offset || s->pack_at == 0) {
        status = pack_rewind(s->u->pack, err);
        s->pack_at = 0;
    }
    char *bytes = mem_alloc(65536);
    while (status == STATUS_OK && s->pack_at < s->offset) {
        uint64_t left = s->offset - s->pack_at;
        size_t got = 0;
        status = read_pack(s, bytes, left < 65536 ? (size_t)left : 65536, &got, err);
        if (status == STATUS_OK && got == 0)
            status = error_set(err, STATUS_CONFLICT, "%s became shorter while it was sent", s->u->name);
        if (status == STATUS_OK && request_interrupted(s->u->client->request))
            status = error_set(err, STATUS_CANCELLED, "interrupted");
    }
    mem_free(bytes);
    return status;
}

static void on_sent(void *user, double sent) {
    struct upload_sending *s = user;
    double done = (double)s->offset + sent;
    if (done > s->meter.done)
        s->moved_at = clock_sec();
    meter_update(&s->meter, done);
}

static enum status send_rest(struct upload_sending *s, struct reply *reply, struct error *err) {
    struct client *c = s->u->client;
    char offset[64];
    snprintf(offset, sizeof offset, "Upload-Offset: %llu", (unsigned long long)s->offset);
    struct request_call call = {
        .method = "PATCH",
        .path = s->path,
        .header = {VERSION_FIELD, offset},
        .content_type = MIME_TUS,
        .read = read_pack,
        .rewind = seek_pack,
        .read_length = s->u->length - s->offset,
        .tick = on_sent,
        .user = s,
        .silence_sec = SILENCE_SEC,
        .once = true,
    };
    meter_begin(&s->meter, c->quiet || c->json ? NULL : &c->err, "sending", (double)s->offset, (double)s->u->length);
    enum status status = request_run(c->request, &call, reply, err);
    meter_end(&s->meter);
    return status == STATUS_OK ? take_offset(s, reply, err) : status;
}

/* --- the loop ------------------------------------------------------------------------------ */

/* One round; STATUS_OK also if more rounds are needed. */
static enum status advance(struct upload_sending *s, struct reply *reply, struct error *err) {
    enum status status = STATUS_OK;
    if (!s->path) {
        status = find(s, reply, err);
        bool was_found = s->path != NULL;
        if (status == STATUS_OK && !was_found)
            status = create(s, reply, err);
        if (status == STATUS_OK && was_found)
            status = ask(s, reply, err);
        if (status == STATUS_OK && s->offset > 0) {
            char done[16], all[16];
            format_bytes(done, (double)s->offset);
            format_bytes(all, (double)s->u->length);
            client_note(s->u->client, "%s of %s are on the server already: going on from there", done, all);
        }
    } else {
        status = ask(s, reply, err);
    }
    return status == STATUS_OK && s->offset < s->u->length ? send_rest(s, reply, err) : status;
}

/* Whether a failure may be temporary. Forgets an upload that is gone. */
static bool is_passing(struct upload_sending *s, const struct reply *reply, enum status status) {
    if (status == STATUS_NOT_FOUND && reply->code == 404 && s->path) {
        mem_free(s->path);
        s->path = NULL;
        s->offset = 0;
        return true;
    }
    /* 409: another client sends the same room, or an earlier request of ours still hangs. */
    return status == STATUS_UNAVAILABLE || (status == STATUS_CONFLICT && reply->code == 409);
}

enum status upload_send(const struct client_upload *u, struct reply *reply, struct error *err) {
    struct client *c = u->client;
    double patience = c->retry_sec >= 0.0 ? c->retry_sec : PATIENCE_SEC;
    struct upload_sending s = {.u = u, .moved_at = clock_sec()};
    enum status status;
    for (int tries = 0;; tries++) {
        uint64_t before = s.offset;
        status = advance(&s, reply, err);
        if (status == STATUS_OK && s.offset == u->length)
            break;
        if (status != STATUS_OK && !is_passing(&s, reply, status))
            break;
        if (status != STATUS_OK && clock_sec() - s.moved_at > patience)
            break;
        if (s.offset > before)
            tries = 0;
        if (status == STATUS_UNAVAILABLE && !s.was_lost)
            client_note(c, "%s; trying for %.0f s", err->message, patience);
        s.was_lost = status == STATUS_UNAVAILABLE;
        if (status != STATUS_OK && !request_pause(c->request, tries, reply->retry_after_sec)) {
            status = error_set(err, STATUS_CANCELLED, "interrupted");
            break;
        }
    }
    mem_free(s.path);
    return status;
}
