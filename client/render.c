/* render.c -- `render` and `evaluate`: jobs on a reconstruction that is there already.
 *
 * 1. All that is wrong with a command line is said before anything is sent: the server checks the settings as a whole
 *    and stores nothing of a job that it refuses; files that settings name are opened here first.
 * 2. A setting that names a file has a path here and its last part there. The files are sent once the job is there,
 *    which waits for them; where one cannot be sent, the job is still there and can be removed. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/commands.h"
#include "client/meter.h"
#include "client/new_job.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/render_settings.h"
#include "common/sha256.h"
#include "common/url.h"

#define SENDING_PATIENCE_SEC 120.0 /* a connection on which nothing moves for so long is dead */

static const char *const shortcuts[] = {"view", "size", "lights", "remove", "environment", "spp", NULL};

const struct command_option render_options[] = {
    {"set", 's', OPTION_LIST, "KEY=VALUE", "a setting; `unbake settings --kind render` lists them"},
    {"view", 0, OPTION_TEXT, "VIEWS", NULL},
    {"size", 0, OPTION_TEXT, "WxH", NULL},
    {"lights", 0, OPTION_TEXT, "on|off", NULL},
    {"remove", 0, OPTION_TEXT, "SEGMENTS", NULL},
    {"environment", 0, OPTION_TEXT, "LIGHT", NULL},
    {"spp", 0, OPTION_TEXT, "N", NULL},
    {"sun", 0, OPTION_TEXT, "DATE[THH:MM]", "sun and sky outside at that time: environment=sky, date and time"},
    {"place", 0, OPTION_TEXT, "LAT,LON", "where the room is, in degrees north and east: latitude and longitude"},
    {"file", 'f', OPTION_LIST, "FILE", "where a file lies that a setting names by its last part"},
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job; else that of the reconstruction"},
    NEW_JOB_OPTIONS,
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job"},
    WATCH_OPTION,
    {"output", 'o', OPTION_TEXT, "DIR", "wait for its end and fetch the pictures into DIR"},
    {"dry-run", 0, OPTION_FLAG, NULL, "check the settings; queue nothing"},
    {0},
};

const struct command_option evaluate_options[] = {
    {"scene", 0, OPTION_TEXT, "SCENE", "the scene with the truth; else that of the reconstruction"},
    {"name", 'n', OPTION_TEXT, "NAME", "what people will call the job; else that of the reconstruction"},
    NEW_JOB_OPTIONS,
    {"share", 0, OPTION_FLAG, NULL, "let every user of the server look at the job"},
    WATCH_OPTION,
    {"output", 'o', OPTION_TEXT, "DIR", "wait for its end and fetch figures and pictures into DIR"},
    {0},
};

struct follow_up {
    struct client *client;
    cJSON *job;   /* the body of POST /v1/jobs; owned */
    cJSON *paths; /* where the files lie, by their names for the server; owned */
    struct meter meter;
    uint64_t length; /* of the file being sent */
    int fd;          /* it; -1: none */
    int64_t id;      /* of the job; 0: not there yet */
};

/* --- settings ------------------------------------------------------------------------------ */

static enum status assign(cJSON *settings, const char *name, const char *value, size_t length, struct error *err) {
    char *text = mem_printf("%s=%.*s", name, (int)length, value);
    enum status status = render_settings_parse_assignment(text, settings, err);
    mem_free(text);
    return status;
}

/* --sun and --place. */
static enum status take_sun(cJSON *settings, const struct options *o, struct error *err) {
    const char *sun = options_text(o, "sun", NULL), *place = options_text(o, "place", NULL);
    enum status status = STATUS_OK;
    if (sun) {
        size_t date = strcspn(sun, "T");
        status = assign(settings, "environment", "sky", 3, err);
        if (status == STATUS_OK)
            status = assign(settings, "date", sun, date, err);
        if (status == STATUS_OK && sun[date])
            status = assign(settings, "time", sun + date + 1, strlen(sun + date + 1), err);
    }
    if (status != STATUS_OK || !place)
        return status;
    size_t latitude = strcspn(place, ",");
    if (!place[latitude])
        return error_set(err, STATUS_INPUT, "--place %.60s is not of the form LAT,LON, as 52.5,13.4", place);
    status = assign(settings, "latitude", place, latitude, err);
    return status == STATUS_OK ? assign(settings, "longitude", place + latitude + 1, strlen(place + latitude + 1), err)
                               : status;
}

/* --- files --------------------------------------------------------------------------------- */

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* The path of --file for that name; NULL: none. */
static const char *given_path(const struct options *o, const char *name) {
    for (size_t i = 0; i < o->given_count; i++)
        if (strcmp(o->given[i].option->name, "file") == 0 && strcmp(last_part(o->given[i].text), name) == 0)
            return o->given[i].text;
    return NULL;
}

static enum status note_file(struct follow_up *f, const struct options *o, const char *value, struct error *err) {
    const char *name = last_part(value), *given = strchr(value, '/') ? NULL : given_path(o, name);
    const char *path = given ? given : value;
    const char *other = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f->paths, name));
    struct stat info;
    if (other && strcmp(other, path) != 0)
        return error_set(err, STATUS_INPUT, "%s and %s have the same name for the server", other, path);
    if (stat(path, &info) != 0 || access(path, R_OK) != 0)
        return error_set_errno(err, errno, "cannot read %s", path);
    if (!S_ISREG(info.st_mode) || info.st_size == 0)
        return error_set(err, STATUS_INPUT, "%s is %s", path, S_ISREG(info.st_mode) ? "empty" : "no file");
    if (!other)
        json_add_string(f->paths, name, path);
    return STATUS_OK;
}

/* Notes where the files lie that the settings name, and leaves in the settings what they are for the server. */
static enum status take_files(struct follow_up *f, cJSON *settings, const struct options *o, struct error *err) {
    cJSON *files = render_settings_files(settings), *value;
    const cJSON *file;
    enum status status = STATUS_OK;
    cJSON_ArrayForEach(file, files) {
        if (status == STATUS_OK)
            status = note_file(f, o, file->valuestring, err);
        cJSON_ArrayForEach(value, settings) {
            const struct render_setting *t = render_settings_find(value->string, NULL);
            if (t && t->type == RENDER_FILE && cJSON_IsString(value) &&
                strcmp(value->valuestring, file->valuestring) == 0)
                cJSON_SetValuestring(value, last_part(file->valuestring)); /* which is not longer */
        }
    }
    cJSON_Delete(files);
    for (size_t i = 0; i < o->given_count && status == STATUS_OK; i++) {
        const char *text = o->given[i].text;
        if (strcmp(o->given[i].option->name, "file") == 0 && !cJSON_HasObjectItem(f->paths, last_part(text)))
            status = error_set(err, STATUS_INPUT, "--file %s: no setting names %s", text, last_part(text));
    }
    return status;
}

/* --- sending ------------------------------------------------------------------------------- */

static enum status read_file(void *user, void *bytes, size_t room, size_t *got, struct error *err) {
    struct follow_up *f = user;
    ssize_t count;
    do
        count = read(f->fd, bytes, room);
    while (count < 0 && errno == EINTR);
    *got = count > 0 ? (size_t)count : 0;
    return count >= 0 ? STATUS_OK : error_set_errno(err, errno, "cannot read the file");
}

static enum status rewind_file(void *user, struct error *err) {
    struct follow_up *f = user;
    return lseek(f->fd, 0, SEEK_SET) == 0 ? STATUS_OK : error_set_errno(err, errno, "cannot read the file");
}

static void on_sent(void *user, double sent) { meter_update(&((struct follow_up *)user)->meter, sent); }

static enum status send_file(struct follow_up *f, const char *name, const char *file, struct reply *reply,
                             struct error *err) {
    struct client *c = f->client;
    char hex[SHA256_HEX_SIZE], digest[SHA256_HEX_SIZE + 32];
    struct stat info;
    struct buf path;
    enum status status = sha256_of_file(file, hex, err);
    if (status != STATUS_OK)
        return status;
    f->fd = open(file, O_RDONLY | O_CLOEXEC);
    if (f->fd < 0 || fstat(f->fd, &info) != 0)
        return error_set_errno(err, errno, "cannot open %s", file);
    f->length = (uint64_t)info.st_size;
    snprintf(digest, sizeof digest, "X-Content-SHA256: %s", hex);
    buf_init(&path, 8192);
    buf_printf(&path, "/v1/jobs/%lld/files/", (long long)f->id);
    url_encode(&path, name, false);
    struct request_call call = {.method = "PUT",
                                .path = buf_text(&path),
                                .header = {digest},
                                .read = read_file,
                                .rewind = rewind_file,
                                .read_length = f->length,
                                .tick = on_sent,
                                .user = f,
                                .silence_sec = SENDING_PATIENCE_SEC,
                                .same_twice = true};
    meter_begin(&f->meter, c->quiet || c->json ? NULL : &c->err, name, 0.0, (double)f->length);
    status = request_run(c->request, &call, reply, err);
    meter_end(&f->meter);
    buf_release(&path);
    close(f->fd);
    f->fd = -1;
    return status;
}

/* Sends what the job still lacks, as the server lists it. */
static enum status send_files(struct follow_up *f, struct reply *reply, struct error *err) {
    cJSON *files = cJSON_DetachItemFromObjectCaseSensitive(reply->json, "files");
    const cJSON *file;
    enum status status = STATUS_OK;
    cJSON_ArrayForEach(file, files) {
        const char *name = member_text(file, "name");
        const char *path = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(f->paths, name));
        if (status == STATUS_OK && path && member_number(file, "bytes", -1.0) < 0.0)
            status = send_file(f, name, path, reply, err);
    }
    cJSON_Delete(files);
    if (status != STATUS_OK)
        error_hint(err, "job %lld waits for its files; `unbake rm %lld` removes it", (long long)f->id,
                   (long long)f->id);
    return status;
}

/* --- the command --------------------------------------------------------------------------- */

static void print_job(struct client *c, const cJSON *job) {
    if (c->json)
        client_print_json(c, job);
    else if (c->quiet)
        printf("%.0f\n", member_number(job, "id", 0.0));
    else
        client_say(c, "job %.0f is %s: %s of job %.0f", member_number(job, "id", 0.0), member_text(job, "state"),
                   member_text(job, "kind"), member_number(job, "source", 0.0));
    fflush(stdout);
}

static void print_dry_run(struct client *c, const cJSON *reply) {
    double paths = member_number(reply, "paths", -1.0);
    if (c->json)
        client_print_json(c, reply);
    else if (!c->quiet && paths > 0.0)
        client_say(c, "the settings are accepted: %.3g paths%s", paths,
                   cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(reply, "small")) ? ", a small render" : "");
    else if (!c->quiet)
        client_say(c, "the settings are accepted");
}

/* Follows the job to its end, or fetches what it has made, as the command line asks. */
static int follow(struct client *c, const struct options *o, int64_t id) {
    const char *dir = options_text(o, "output", NULL);
    int code = CLIENT_OK;
    if (dir || options_flag(o, "watch"))
        code = watch_job(c, id, true);
    return code == CLIENT_OK && dir ? get_job(c, id, dir) : code;
}

static enum status describe_render(struct follow_up *f, const struct options *o, struct error *err) {
    enum status status = new_job_describe(f->job, o, render_settings_parse_assignment, err);
    cJSON *settings = cJSON_GetObjectItemCaseSensitive(f->job, "settings");
    for (size_t i = 0; shortcuts[i] && status == STATUS_OK; i++) {
        const char *value = options_text(o, shortcuts[i], NULL);
        if (value)
            status = assign(settings, shortcuts[i], value, strlen(value), err);
    }
    if (status == STATUS_OK)
        status = take_sun(settings, o, err);
    return status == STATUS_OK ? take_files(f, settings, o, err) : status;
}

static enum status describe_evaluation(struct follow_up *f, const struct options *o, struct error *err) {
    const char *scene = options_text(o, "scene", NULL);
    if (scene)
        json_add_string(f->job, "scene", scene);
    return new_job_describe(f->job, o, render_settings_parse_assignment, err);
}

static enum status queue(struct follow_up *f, bool dry_run, struct reply *reply, struct error *err) {
    struct request_call check = {.method = "POST", .path = "/v1/jobs?dry_run=1", .body = f->job, .same_twice = true};
    if (dry_run)
        return request_run(f->client->request, &check, reply, err);
    enum status status = new_job_queue(f->client, f->job, reply, err);
    f->id = status == STATUS_OK ? member_whole(reply->json, "id", 0) : 0;
    return status == STATUS_OK && f->paths->child ? send_files(f, reply, err) : status;
}

static int run(struct client *c, const struct options *o, const char *kind,
               enum status (*describe)(struct follow_up *, const struct options *, struct error *)) {
    struct follow_up f = {.client = c, .job = cJSON_CreateObject(), .paths = cJSON_CreateObject(), .fd = -1};
    struct reply reply;
    struct error err;
    int64_t source = 0;
    bool dry_run = options_flag(o, "dry-run");
    int code = CLIENT_OK;
    reply_init(&reply);
    json_add_string(f.job, "kind", kind);
    enum status status = describe(&f, o, &err);
    if (status == STATUS_OK)
        status = client_job_id(c, o->word[0], &source, &reply, &err);
    json_add_int(f.job, "source", source);
    if (status == STATUS_OK)
        status = queue(&f, dry_run, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (dry_run)
        print_dry_run(c, reply.json);
    else
        print_job(c, reply.json);
    reply_release(&reply);
    cJSON_Delete(f.paths);
    cJSON_Delete(f.job);
    return code == CLIENT_OK && !dry_run ? follow(c, o, f.id) : code;
}

int render_run(struct client *c, const struct options *o) { return run(c, o, JOB_KIND_RENDER, describe_render); }

int evaluate_run(struct client *c, const struct options *o) {
    return run(c, o, JOB_KIND_EVALUATE, describe_evaluation);
}
