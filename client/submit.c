/* submit.c -- `submit`: a room goes up, a job is queued on it.
 *
 * 1. The room is read once for its SHA-256, which is the scene's id: what the server has already
 *    is not sent.
 * 2. The job is checked by the server (a dry run) before anything is sent, so that a mistyped
 *    setting does not cost an upload.
 * 3. The upload names its SHA-256; a room that changed meanwhile is refused by the server. What was
 *    broken off goes on where it was (upload.h).
 * 4. The job is queued under an idempotency key: however often the request is sent, one job. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "client/commands.h"
#include "client/meter.h"
#include "client/pack.h"
#include "client/upload.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/settings.h"

const struct client_option submit_options[] = {
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job; else the room's name"},
    {"set", 's', OPTION_LIST, "KEY=VALUE", "a setting; `unbake settings` lists them"},
    {"priority", 'p', OPTION_WHOLE, "N", "-100 to 100, larger goes first (0)"},
    {"label", 'l', OPTION_LIST, "KEY=VALUE", "a label of your own"},
    {"scene", 0, OPTION_TEXT, "SCENE", "a room that is there already, instead of ROOM"},
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job and its room"},
    {"webhook", 0, OPTION_TEXT, "URL",
     "is told of the job's states, signed with $UNBAKE_WEBHOOK_SECRET (whsec_ and base64)"},
    {"watch", 'w', OPTION_FLAG, NULL, "follow the job to its end, as `unbake watch` does"},
    {"dry-run", 0, OPTION_FLAG, NULL, "check the settings and the room; send and queue nothing"},
    {0},
};

struct submission {
    struct client *client;
    struct pack *pack; /* NULL with --scene */
    char *name;        /* of the room; owned */
    char *scene;       /* id, or what --scene says; owned */
    uint64_t length;   /* of the upload */
    cJSON *job;        /* the body of POST /v1/jobs; owned */
    bool present;      /* the server has the scene, and has not rejected it */
    struct meter meter;
};

/* --- the job ------------------------------------------------------------------------------- */

enum status label_add(cJSON *labels, const char *text, struct error *err) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text)
        return error_set(err, STATUS_INPUT, "label \"%.100s\" is not of the form key=value", text);
    char *key = mem_strndup(text, (size_t)(equals - text));
    enum status status = STATUS_OK;
    if (cJSON_GetObjectItemCaseSensitive(labels, key))
        status = error_set(err, STATUS_INPUT, "label %s is given twice", key);
    else
        json_add_string(labels, key, equals + 1);
    mem_free(key);
    return status;
}

static enum status describe_job(struct submission *s, const struct options *o, struct error *err) {
    enum status status = STATUS_OK;
    cJSON *settings = cJSON_CreateObject(), *labels = cJSON_CreateObject();
    s->job = cJSON_CreateObject();
    for (size_t i = 0; i < o->given_count && status == STATUS_OK; i++) {
        const struct options_given *given = &o->given[i];
        if (strcmp(given->option->name, "set") == 0)
            status = settings_parse_assignment(given->text, settings, err);
        else if (strcmp(given->option->name, "label") == 0)
            status = label_add(labels, given->text, err);
    }
    json_add(s->job, "settings", settings);
    json_add(s->job, "labels", labels);
    if (options_flag(o, "share"))
        json_add_bool(s->job, "shared", true);
    json_add_int(s->job, "priority", options_whole(o, "priority", 0));
    const char *name = options_text(o, "name", s->name), *url = options_text(o, "webhook", NULL);
    const char *secret = getenv("UNBAKE_WEBHOOK_SECRET"); /* a command line is for all to read */
    if (name)
        json_add_string(s->job, "name", name);
    if (url && !(secret && *secret) && status == STATUS_OK) {
        error_set(err, STATUS_INPUT, "--webhook needs a secret to sign its messages with");
        status = error_hint(err, "put 16 characters or more into UNBAKE_WEBHOOK_SECRET");
    } else if (url && status == STATUS_OK) {
        cJSON *webhook = cJSON_AddObjectToObject(s->job, "webhook");
        json_add_string(webhook, "url", url);
        json_add_string(webhook, "secret", secret);
    }
    return status;
}

/* --- the room ------------------------------------------------------------------------------ */

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
    struct submission *s = user;
    meter_update(&s->meter, (double)done);
    return !request_interrupted(s->client->request);
}

static struct terminal *meter_terminal(struct client *c) { return c->quiet || c->json ? NULL : &c->err; }

static enum status measure(struct submission *s, const char *room, struct error *err) {
    char sha256[SHA256_HEX_SIZE];
    enum status status = pack_open(&s->pack, room, err);
    if (status == STATUS_NOT_FOUND || status == STATUS_INPUT) {
        err->status = STATUS_INPUT;
        return error_hint(err, "ROOM is a folder or an archive");
    }
    if (status != STATUS_OK)
        return status;
    s->name = room_name(room);
    meter_begin(&s->meter, meter_terminal(s->client), "reading", 0.0, (double)pack_content_bytes(s->pack));
    status = pack_measure(s->pack, on_measured, s, &s->length, sha256, err);
    meter_end(&s->meter);
    if (status == STATUS_OK)
        s->scene = mem_strdup(sha256);
    return status;
}

static enum status ask_for_scene(struct submission *s, struct reply *reply, struct error *err) {
    char *path = mem_printf("/v1/scenes/%s", s->scene);
    enum status status = request_get(s->client->request, path, reply, err);
    mem_free(path);
    if (status == STATUS_NOT_FOUND && reply->code == 404)
        return STATUS_OK;
    if (status == STATUS_OK) /* a rejected one is sent again: it is then checked again */
        s->present = strcmp(member_text(reply->json, "state"), SCENE_STATE_REJECTED) != 0;
    return status;
}

static enum status upload(struct submission *s, struct reply *reply, struct error *err) {
    struct client_upload u = {
        .client = s->client, .pack = s->pack, .name = s->name, .sha256 = s->scene, .length = s->length};
    char size[16];
    enum status status = upload_send(&u, reply, err);
    format_bytes(size, (double)s->length);
    if (status == STATUS_OK)
        client_note(s->client, "sent %s (%zu file%s, %s)", s->name, pack_file_count(s->pack),
                    pack_file_count(s->pack) == 1 ? "" : "s", size);
    return status;
}

/* --- queueing ------------------------------------------------------------------------------ */

/* That the server does not know the scene is no fault where it is about to be sent. */
static bool only_scene_is_missing(struct reply *reply) {
    cJSON *faults = cJSON_GetObjectItemCaseSensitive(reply->json, "invalid_params");
    int count = cJSON_GetArraySize(faults);
    for (int i = count; i-- > 0;)
        if (strcmp(member_text(cJSON_GetArrayItem(faults, i), "name"), "scene") == 0)
            cJSON_DeleteItemFromArray(faults, i);
    return count > 0 && cJSON_GetArraySize(faults) == 0;
}

static enum status check(struct submission *s, struct reply *reply, struct error *err) {
    struct request_call call = {.method = "POST", .path = "/v1/jobs?dry_run=1", .body = s->job, .same_twice = true};
    enum status status = request_run(s->client->request, &call, reply, err);
    bool to_be_sent = s->pack && !s->present;
    if (status != STATUS_OK && reply->code == 422 && to_be_sent && only_scene_is_missing(reply))
        return STATUS_OK;
    return status;
}

static enum status queue(struct submission *s, struct reply *reply, struct error *err) {
    unsigned char random[16];
    char header[64] = "Idempotency-Key: ";
    if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random)
        return error_set_errno(err, errno, "cannot get random numbers");
    for (size_t i = 0; i < sizeof random; i++)
        snprintf(header + 17 + 2 * i, 3, "%02x", random[i]);
    struct request_call call = {
        .method = "POST", .path = "/v1/jobs", .header = {header}, .body = s->job, .same_twice = true};
    return request_run(s->client->request, &call, reply, err);
}

static void print_dry_run(struct submission *s, const struct reply *reply) {
    struct client *c = s->client;
    bool checked = reply->code == 200;
    if (c->json) {
        cJSON *object = checked ? cJSON_Duplicate(reply->json, true) : cJSON_CreateObject();
        if (!checked) {
            json_add_bool(object, "dry_run", true);
            json_add_string(object, "scene", s->scene);
            json_add_string(object, "scene_state", NULL);
            json_add(object, "settings", cJSON_Duplicate(cJSON_GetObjectItemCaseSensitive(s->job, "settings"), true));
        }
        json_add_int(object, "upload_bytes", s->pack && !s->present ? (int64_t)s->length : 0);
        client_print_json(c, object);
        cJSON_Delete(object);
        return;
    }
    if (c->quiet)
        return;
    char size[16];
    format_bytes(size, (double)s->length);
    printf("the settings are accepted\n");
    if (s->pack && !s->present)
        printf("scene %.12s is not on the server: %s would be sent\n", s->scene, size);
    else
        client_say(c, "scene %.12s is on the server (%s)", s->scene, member_text(reply->json, "scene_state"));
}

static void print_job(struct submission *s, const cJSON *job) {
    struct client *c = s->client;
    if (c->json) {
        client_print_json(c, job);
    } else if (c->quiet) {
        printf("%.0f\n", member_number(job, "id", 0.0));
    } else {
        struct buf name;
        buf_init(&name, 4096);
        terminal_clean(&name, member_text(job, "name"));
        printf("job %.0f is queued: %s (scene %.12s)\n", member_number(job, "id", 0.0), buf_text(&name),
               member_text(job, "scene"));
        buf_release(&name);
    }
    fflush(stdout);
}

static enum status submit(struct submission *s, const struct options *o, struct reply *reply, struct error *err) {
    const char *scene = options_text(o, "scene", NULL);
    if ((scene != NULL) == (o->word_count == 1)) {
        error_set(err, STATUS_INPUT, scene ? "ROOM and --scene exclude each other" : "missing argument ROOM");
        return error_hint(err, "an example: unbake submit living-room/ --watch");
    }
    s->scene = scene ? mem_strdup(scene) : NULL;
    s->present = scene != NULL;
    enum status status = describe_job(s, o, err);
    if (status == STATUS_OK && !scene)
        status = measure(s, o->word[0], err);
    if (status != STATUS_OK)
        return status;
    if (s->name && !cJSON_HasObjectItem(s->job, "name"))
        json_add_string(s->job, "name", s->name);
    json_add_string(s->job, "scene", s->scene);
    if (!scene)
        status = ask_for_scene(s, reply, err);
    if (status == STATUS_OK)
        status = check(s, reply, err);
    if (status != STATUS_OK || options_flag(o, "dry-run"))
        return status;
    if (!s->present)
        status = upload(s, reply, err);
    else if (!scene)
        client_note(s->client, "the server has this room already");
    return status == STATUS_OK ? queue(s, reply, err) : status;
}

int submit_run(struct client *c, const struct options *o) {
    struct submission s = {.client = c};
    struct reply reply;
    struct error err;
    reply_init(&reply);
    int code = CLIENT_OK;
    int64_t job = 0;
    enum status status = submit(&s, o, &reply, &err);
    if (status == STATUS_CANCELLED)
        error_hint(&err, "no job was queued; the same command continues where this one stopped");
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (options_flag(o, "dry-run"))
        print_dry_run(&s, &reply);
    else {
        job = member_whole(reply.json, "id", 0);
        print_job(&s, reply.json);
    }
    pack_close(s.pack);
    mem_free(s.name);
    mem_free(s.scene);
    cJSON_Delete(s.job);
    reply_release(&reply);
    return job && options_flag(o, "watch") ? watch_job(c, job, true) : code;
}
