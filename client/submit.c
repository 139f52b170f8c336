/* submit.c -- `submit`: sends rooms and queues jobs on them: one for each room and combination of a matrix.
 *
 * 1. The server checks the jobs' settings (a dry run) before anything is sent, so that a mistyped setting does not cost
 *    an upload.
 * 2. A room is sent, unless its content is there already, and checked by the server (client_room.h). A job on a room
 *    that is rejected, or whose mesh and photographs do not fit, is not queued.
 * 3. Each job is queued under an idempotency key: however often the request is sent, one job results.
 * 4. Jobs of one command have one label `group`. Where the user has named it, jobs that are in the group already are
 *    not queued again: a command that was interrupted may be repeated. */
#include <string.h>

#include "client/client_room.h"
#include "client/commands.h"
#include "client/findings.h"
#include "client/format.h"
#include "client/matrix.h"
#include "client/new_job.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/random_hex.h"
#include "common/settings.h"
#include "common/url.h"

const struct command_option submit_options[] = {
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job; else the room's name"},
    {"set", 's', OPTION_LIST, "KEY=VALUE", "a setting; `unbake settings` lists them"},
    {"matrix", 'm', OPTION_LIST, "KEY=A,B,...",
     "a job for each value (A;B where values have commas); several: for each combination"},
    NEW_JOB_OPTIONS,
    FORMAT_OPTION,
    ROOM_OPTIONS(OPTION_LIST),
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job and its room"},
    WATCH_OPTION,
    {"dry-run", 0, OPTION_FLAG, NULL, "check the settings and the room, which is sent for that; queue nothing"},
    {0},
};

#define GROUP_DIGITS 8     /* hex, of its value: no two groups of a user have one */
#define GROUP "group"      /* label of what was submitted together */
#define NAME_MAX_BYTES 200 /* of a job's name, as the server takes it */

struct submission {
    struct client *client;
    const struct options *options;
    struct matrix matrix;
    bool is_one;     /* one room, one job */
    bool is_checked; /* the server has accepted the settings */
    cJSON *base;     /* what the bodies of POST /v1/jobs have in common; owned */
    cJSON *present;  /* jobs of the group that are there already; NULL: not asked for; owned */
    struct client_room room;
    int64_t *queued; /* [queued_count] numbers of jobs; owned */
    size_t room_count, queued_count, present_count;
};

/* --- what is asked for --------------------------------------------------------------------- */

static const char *group_of(const struct submission *s) {
    return member_text(cJSON_GetObjectItemCaseSensitive(s->base, "labels"), GROUP);
}

/* Finds what is in the group already, or makes one. */
static enum status join_group(struct submission *s, struct reply *reply, struct error *err) {
    char name[GROUP_DIGITS + 1];
    if (*group_of(s)) {
        struct buf path;
        buf_init(&path, 1024);
        buf_puts(&path, "/v1/jobs?label=" GROUP "%3D");
        url_encode(&path, group_of(s), false);
        enum status status = client_list(s->client, buf_text(&path), 0, &s->present, reply, err);
        buf_release(&path);
        return status;
    }
    enum status status = random_hex(name, GROUP_DIGITS, err);
    if (status == STATUS_OK)
        json_add_string(cJSON_GetObjectItemCaseSensitive(s->base, "labels"), GROUP, name);
    return status;
}

/* The body of POST /v1/jobs for one combination on the room; the caller's. */
static cJSON *describe(const struct submission *s, size_t index) {
    cJSON *job = cJSON_Duplicate(s->base, true);
    const char *given = options_text(s->options, "name", NULL),
               *found = s->is_one ? "" : member_text(s->room.found, "name"),
               *room = s->room.name ? s->room.name : found;
    struct buf name;
    buf_init(&name, NAME_MAX_BYTES);
    buf_printf(&name, "%s%s%s", given ? given : room, given && s->room_count > 1 ? " " : "",
               given && s->room_count > 1 ? room : "");
    matrix_describe(&s->matrix, index, &name);
    cJSON_DeleteItemFromObjectCaseSensitive(job, "name");
    if (given || *room)
        json_add_string(job, "name", name.overflowed ? given ? given : room : buf_text(&name));
    matrix_apply(&s->matrix, index, cJSON_GetObjectItemCaseSensitive(job, "settings"));
    const char *id = member_text(s->room.found, "id");
    json_add_string(job, "scene", *id ? id : s->room.scene);
    buf_release(&name);
    return job;
}

/* The number of a job of the group that does the same; 0: none. Those that have failed may be tried again. */
static int64_t find_present(const struct submission *s, const cJSON *job) {
    const cJSON *other;
    cJSON_ArrayForEach(other, s->present) {
        const char *state = member_text(other, "state");
        if (strcmp(state, JOB_STATE_FAILED) != 0 && strcmp(state, JOB_STATE_CANCELLED) != 0 &&
            strcmp(member_text(other, "scene"), member_text(job, "scene")) == 0 &&
            cJSON_Compare(cJSON_GetObjectItemCaseSensitive(other, "settings"),
                          cJSON_GetObjectItemCaseSensitive(job, "settings"), true))
            return member_whole(other, "id", 0);
    }
    return 0;
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

/* Has the server check the job. What is wrong with a scene that is about to be sent, or read otherwise, is no fault
 * yet. */
static enum status check_job(struct submission *s, const cJSON *job, bool is_to_change, struct reply *reply,
                             struct error *err) {
    struct request_call call = {.method = "POST", .path = "/v1/jobs?dry_run=1", .body = job, .same_twice = true};
    enum status status = request_run(s->client->request, &call, reply, err);
    if (status == STATUS_OK || !is_to_change)
        return status;
    bool does_not_fit = reply->code == 409;
    return does_not_fit || (reply->code == 422 && only_scene_is_missing(reply)) ? STATUS_OK : status;
}

static void print_dry_run(struct submission *s, const cJSON *job, const struct reply *reply) {
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
        client_say(c, "the settings are accepted%s%.300s", s->is_one ? "" : ": ",
                   s->is_one ? "" : member_text(job, "name"));
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

/* Has the server check all jobs on the room. */
static enum status check(struct submission *s, bool is_to_change, bool print, struct reply *reply, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < s->matrix.count && status == STATUS_OK; i++) {
        cJSON *job = describe(s, i);
        status = check_job(s, job, is_to_change, reply, err);
        if (status == STATUS_OK && print)
            print_dry_run(s, job, reply);
        cJSON_Delete(job);
    }
    return status;
}

/* Queues all jobs on the room that are not in the group already. */
static enum status queue(struct submission *s, struct reply *reply, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < s->matrix.count && status == STATUS_OK; i++) {
        cJSON *job = describe(s, i);
        bool is_present = find_present(s, job) != 0;
        if (!is_present)
            status = new_job_queue(s->client, job, reply, err);
        cJSON_Delete(job);
        s->present_count += is_present;
        if (is_present || status != STATUS_OK)
            continue;
        s->queued = mem_realloc_array(s->queued, s->queued_count + 1, sizeof *s->queued);
        s->queued[s->queued_count++] = member_whole(reply->json, "id", 0);
        print_job(s, reply->json);
    }
    return status;
}

static enum status send_room(struct submission *s, struct reply *reply, struct error *err) {
    enum status status = client_room_send(&s->room, reply, err);
    if (status == STATUS_OK)
        status = client_room_wait(&s->room, reply, err);
    if (status == STATUS_OK)
        findings_note(s->client, s->room.found);
    return status;
}

/* All jobs on one room. */
static enum status submit(struct submission *s, const char *path, const char *scene, struct reply *reply,
                          struct error *err) {
    struct client_room *room = &s->room;
    bool dry_run = options_flag(s->options, "dry-run");
    enum status status = client_room_open(room, s->client, s->options, path, scene, reply, err);
    if (status != STATUS_OK)
        return status;
    bool is_to_change = client_room_is_to_change(room),
         is_there = strcmp(client_room_state(room), SCENE_STATE_READY) == 0 && !is_to_change;
    if (!s->is_checked || (dry_run && is_there))
        status = check(s, is_to_change && (room->pack || room->found), dry_run && is_there, reply, err);
    if (status != STATUS_OK)
        return status;
    s->is_checked = true;
    if (dry_run && is_there)
        findings_note(s->client, room->found);
    else
        status = send_room(s, reply, err);
    if (status == STATUS_OK && dry_run && !is_there)
        status = check(s, false, true, reply, err);
    return status == STATUS_OK && !dry_run ? queue(s, reply, err) : status;
}

/* Where the room's problems have been printed and are all that is wrong, they are the reason, and not the request that
 * would list them. */
static void say_rejected(const struct submission *s, struct reply *reply, struct error *err) {
    const cJSON *params = cJSON_GetObjectItemCaseSensitive(reply->json, "invalid_params");
    bool is_rejected = s->room.found && strcmp(client_room_state(&s->room), SCENE_STATE_REJECTED) == 0;
    if (!is_rejected || s->client->json || s->client->quiet || cJSON_GetArraySize(params) != 1 ||
        strcmp(member_text(params->child, "name"), "scene") != 0)
        return;
    cJSON_DeleteItemFromObjectCaseSensitive(reply->json, "invalid_params");
    error_set(err, err->status, "the room was rejected, for the reasons above: no job is queued");
}

/* A refusal's JSON tells what the check has found, too. */
static int fail(struct submission *s, const char *word, struct reply *reply, struct error *err) {
    say_rejected(s, reply, err);
    if (err->status == STATUS_CANCELLED && s->is_one)
        error_hint(err, "no job was queued; the same command continues where this one stopped");
    else if (err->status == STATUS_CANCELLED && *group_of(s))
        error_hint(err, "%zu job%s queued; the same command with --label " GROUP "=%s queues the others",
                   s->queued_count, s->queued_count == 1 ? " is" : "s are", group_of(s));
    if (reply->code >= 400 && cJSON_IsObject(reply->json) && s->room.found)
        findings_add(reply->json, s->room.found);
    if (reply->code >= 400 && cJSON_IsObject(reply->json) && word && !s->is_one)
        json_add_string(reply->json, "room", word);
    if (word && !s->is_one)
        client_note(s->client, "%.500s: no job is queued for it%s", word,
                    s->matrix.count > 1 ? ", or not for all combinations" : "");
    return client_fail(s->client, reply, err);
}

/* Whether nothing else that was asked for can go well either: the user or the network has ended it, this user may not
 * or has no room left, or the settings are wrong. */
static bool is_hopeless(const struct submission *s, const struct reply *reply, const struct error *err) {
    return err->status == STATUS_CANCELLED || err->status == STATUS_UNAVAILABLE || reply->code == 401 ||
           reply->code == 403 || reply->code == 429 || reply->code == 507 || (!s->is_checked && reply->code == 422);
}

/* --- the command --------------------------------------------------------------------------- */

/* Reads what the command line says of all jobs. */
static enum status begin(struct submission *s, struct reply *reply, struct error *err) {
    const struct options *o = s->options;
    size_t scenes = 0;
    for (size_t i = 0; i < o->given_count; i++)
        scenes += strcmp(o->given[i].option->name, "scene") == 0;
    if ((scenes > 0) == (o->word_count > 0)) {
        error_set(err, STATUS_INPUT, scenes ? "ROOM and --scene exclude each other" : "missing argument ROOM");
        return error_hint(err, "an example: unbake submit living-room/ --watch");
    }
    s->base = cJSON_CreateObject();
    enum status status = new_job_describe(s->base, o, settings_parse_assignment, err);
    if (status == STATUS_OK)
        status = matrix_read(&s->matrix, o, cJSON_GetObjectItemCaseSensitive(s->base, "settings"), err);
    s->room_count = scenes + o->word_count;
    s->is_one = s->room_count == 1 && s->matrix.count == 1;
    return status == STATUS_OK && !s->is_one && !options_flag(o, "dry-run") ? join_group(s, reply, err) : status;
}

/* All jobs on all rooms; the exit status of the first failure. */
static int submit_all(struct submission *s, struct reply *reply, struct error *err) {
    const struct options *o = s->options;
    size_t word_count = o->word_count ? o->word_count : o->given_count;
    int code = CLIENT_OK;
    for (size_t i = 0; i < word_count; i++) {
        const char *path = o->word_count ? o->word[i] : NULL, *scene = path ? NULL : o->given[i].text;
        if (!path && strcmp(o->given[i].option->name, "scene") != 0)
            continue;
        reply_release(reply);
        reply_init(reply);
        enum status status = submit(s, path, scene, reply, err);
        int failed = status == STATUS_OK ? CLIENT_OK : fail(s, path ? path : scene, reply, err);
        code = code == CLIENT_OK ? failed : code;
        client_room_release(&s->room);
        if (failed != CLIENT_OK && is_hopeless(s, reply, err))
            break;
    }
    return code;
}

static void print_group(struct submission *s) {
    if (s->is_one || options_flag(s->options, "dry-run"))
        return;
    char there[64] = "";
    if (s->present_count)
        snprintf(there, sizeof there, "; %zu in the group already", s->present_count);
    client_note(s->client, "%zu job%s queued%s. `unbake compare " GROUP "=%s` compares them", s->queued_count,
                s->queued_count == 1 ? " is" : "s are", there, group_of(s));
}

int submit_run(struct client *c, const struct options *o) {
    struct submission s = {.client = c, .options = o};
    struct reply reply;
    struct error err;
    reply_init(&reply);
    enum status status = begin(&s, &reply, &err);
    int code = status == STATUS_OK ? submit_all(&s, &reply, &err) : fail(&s, NULL, &reply, &err);
    if (status == STATUS_OK)
        print_group(&s);
    for (size_t i = 0; i < s.queued_count && options_flag(o, "watch") && code != CLIENT_INTERRUPTED; i++) {
        int end = watch_job(c, s.queued[i], true);
        code = end == CLIENT_INTERRUPTED || code == CLIENT_OK ? end : code;
    }
    matrix_release(&s.matrix);
    cJSON_Delete(s.base);
    cJSON_Delete(s.present);
    mem_free(s.queued);
    reply_release(&reply);
    return code;
}
