/* submit.c -- `submit`: sends a room and queues a job on it.
 *
 * 1. The server checks the job's settings (a dry run) before anything is sent, so that a mistyped setting does not cost
 *    an upload.
 * 2. The room is sent, unless its content is there already, and checked by the server (client_room.h). A job on a room
 *    that is rejected, or whose mesh and photographs do not fit, is not queued.
 * 3. The job is queued under an idempotency key: however often the request is sent, one job results. */
#include <string.h>

#include "client/commands.h"
#include "client/findings.h"
#include "client/client_room.h"
#include "client/new_job.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/settings.h"

const struct client_option submit_options[] = {
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job; else the room's name"},
    {"set", 's', OPTION_LIST, "KEY=VALUE", "a setting; `unbake settings` lists them"},
    NEW_JOB_OPTIONS,
    ROOM_OPTIONS,
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job and its room"},
    WATCH_OPTION,
    {"dry-run", 0, OPTION_FLAG, NULL, "check the settings and the room, which is sent for that; queue nothing"},
    {0},
};

struct submission {
    struct client *client;
    struct client_room room;
    cJSON *job; /* the body of POST /v1/jobs; owned */
};

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

/* Has the server check the job. What is wrong with a scene that is about to be sent, or read otherwise, is no fault yet. */
static enum status check(struct submission *s, bool is_to_change, struct reply *reply, struct error *err) {
    struct request_call call = {.method = "POST", .path = "/v1/jobs?dry_run=1", .body = s->job, .same_twice = true};
    enum status status = request_run(s->client->request, &call, reply, err);
    if (status == STATUS_OK || !is_to_change)
        return status;
    bool does_not_fit = reply->code == 409;
    return does_not_fit || (reply->code == 422 && only_scene_is_missing(reply)) ? STATUS_OK : status;
}

static void print_dry_run(struct submission *s, const struct reply *reply) {
    struct client *c = s->client;
    const struct client_room *room = &s->room;
    if (c->json) {
        cJSON *object = cJSON_Duplicate(reply->json, true);
        const cJSON *fit =
            cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(room->found, "facts"), "fit");
        json_add_int(object, "upload_bytes", room->was_sent ? (int64_t)room->length : 0);
        json_add(object, "fit", fit ? cJSON_Duplicate(fit, true) : cJSON_CreateNull());
        findings_add(object, room->found);
        client_print_json(c, object);
        cJSON_Delete(object);
    } else if (!c->quiet) {
        printf("the settings are accepted\n");
        client_say(c, "scene %.12s is on the server (%s)", room->scene, member_text(reply->json, "scene_state"));
    }
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
    struct client_room *room = &s->room;
    bool dry_run = options_flag(o, "dry-run");
    s->job = cJSON_CreateObject();
    enum status status = new_job_describe(s->job, o, settings_parse_assignment, err);
    if (status == STATUS_OK)
        status = client_room_open(room, s->client, o, reply, err);
    if (status != STATUS_OK)
        return status;
    if (room->name && !cJSON_HasObjectItem(s->job, "name"))
        json_add_string(s->job, "name", room->name);
    json_add_string(s->job, "scene", room->scene);
    bool is_to_change = client_room_is_to_change(room),
         is_checked = strcmp(client_room_state(room), SCENE_STATE_READY) == 0;
    status = check(s, is_to_change && (room->pack || room->found), reply, err);
    if (dry_run && status == STATUS_OK && is_checked && !is_to_change)
        findings_note(s->client, room->found);
    if (status != STATUS_OK || (dry_run && is_checked && !is_to_change))
        return status;
    status = client_room_send(room, reply, err);
    if (status == STATUS_OK)
        status = client_room_wait(room, reply, err);
    if (status == STATUS_OK)
        findings_note(s->client, room->found);
    if (status != STATUS_OK)
        return status;
    return dry_run ? check(s, false, reply, err) : new_job_queue(s->client, s->job, reply, err);
}

/* A refusal's JSON tells what the check has found, too. */
static int fail(struct submission *s, struct reply *reply, struct error *err) {
    if (err->status == STATUS_CANCELLED)
        error_hint(err, "no job was queued; the same command continues where this one stopped");
    if (reply->code >= 400 && cJSON_IsObject(reply->json) && s->room.found)
        findings_add(reply->json, s->room.found);
    return client_fail(s->client, reply, err);
}

int submit_run(struct client *c, const struct options *o) {
    struct submission s = {.client = c};
    struct reply reply;
    struct error err;
    reply_init(&reply);
    int code = CLIENT_OK;
    int64_t job = 0;
    enum status status = submit(&s, o, &reply, &err);
    if (status != STATUS_OK) {
        code = fail(&s, &reply, &err);
    } else if (options_flag(o, "dry-run")) {
        print_dry_run(&s, &reply);
    } else {
        job = member_whole(reply.json, "id", 0);
        print_job(&s, reply.json);
    }
    client_room_release(&s.room);
    cJSON_Delete(s.job);
    reply_release(&reply);
    return job && options_flag(o, "watch") ? watch_job(c, job, true) : code;
}
