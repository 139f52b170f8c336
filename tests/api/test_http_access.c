/* Who may do what: every route of the table for every role, on things of one's own, on shared ones
 * and on others'; wrong tokens; revoked ones, also in open streams; the cookie of the web page. */
#include "server/events/hub.h"
#include "server/http/routes.h"
#include "tests/api/rig.h"

#define OTHER_SCENE "11112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define SHARED_SCENE "22212233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define NO_SCENE "33312233445566778899aabbccddeeff00112233445566778899aabbccddeeff"

enum who { NOBODY, STRANGER, REVOKED, VIEWER, USER, ADMIN, WHO_COUNT };
static const char *const who_names[] = {"nobody", "stranger", "revoked", "viewer", "user", "admin"};
enum thing { NONE, OTHERS, SHARED, OWN, THING_COUNT };
static const char *const thing_names[] = {"none", "others", "shared", "own"};

static struct rig rig;
static char tokens[WHO_COUNT][TOKEN_SIZE];
static const char *const scenes[THING_COUNT] = {NO_SCENE, OTHER_SCENE, SHARED_SCENE, RIG_SCENE};

static void add_token(enum who who, const char *name, enum role role) {
    struct error err;
    int64_t id;
    rig_must(store_token_add(rig.store, name, role, 0, tokens[who], &id, &err), &err, "store_token_add");
}

static int64_t user_of(enum who who) {
    struct error err;
    struct caller caller;
    rig_must(store_token_find(rig.store, tokens[who], &caller, &err), &err, "store_token_find");
    return caller.user_id;
}

static int64_t make_job(enum thing thing, int64_t owner) {
    struct error err;
    struct scene_row row;
    bool existed;
    int64_t id;
    rig_must(store_scene_add(rig.store, scenes[thing], "room", 10, owner, &existed, &err), &err, "scene");
    rig_must(store_scene_get(rig.store, scenes[thing], &row, &err), &err, "scene");
    if (row.state == SCENE_CHECKING) /* `existed` tells only of the owner's own */
        rig_must(store_scene_ready(rig.store, scenes[thing], NULL, "{}", &err), &err, "scene");
    scene_row_release(&row);
    struct job_new job = {.scene_id = scenes[thing],
                          .name = "job",
                          .labels = "{}",
                          .settings = "{}",
                          .owner_id = owner,
                          .is_shared = thing == SHARED,
                          .max_attempts = 2};
    bool replayed;
    rig_must(store_job_add(rig.store, &job, 1000, &id, &replayed, &err), &err, "store_job_add");
    return id;
}

/* Each request comes from another address, by the word of a proxy: so many wrong tokens from one would be throttled. */
static int ask(enum who who, const char *method, const char *path, const char *fields, const char *body,
               struct buf *reply) {
    static unsigned count;
    struct buf text;
    buf_init(&text, 65536);
    buf_printf(&text, "%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nX-Forwarded-For: 10.%u.%u.1\r\n%s",
               method, path, count / 256 % 256, count % 256, fields);
    count++;
    if (who != NOBODY)
        buf_printf(&text, "Authorization: Bearer %s\r\n", tokens[who]);
    if (*body)
        buf_printf(&text, "Content-Type: application/json\r\nContent-Length: %zu\r\n", strlen(body));
    buf_printf(&text, "\r\n%s", body);
    int status = rig_ask(&rig, text.data, text.length, reply);
    buf_release(&text);
    return status;
}

static int status_of(enum who who, const char *method, const char *path, const char *body) {
    struct buf reply;
    bool is_part = strncmp(path, "/v1/uploads/", 12) == 0 && strcmp(method, "PATCH") == 0;
    int status = ask(who, method, path,
                     is_part ? "Tus-Resumable: 1.0.0\r\nUpload-Offset: 0\r\nContent-Length: 0\r\n"
                               "Content-Type: application/offset+octet-stream\r\n"
                             : "If-Match: *\r\n",
                     body, &reply);
    buf_release(&reply);
    return status;
}

/* An upload of the user, or (thing other than OWN) of the admin; its path is the caller's. */
static char *make_upload(enum thing thing) {
    struct buf reply;
    char path[128] = "/v1/uploads/00000000000000000000000000000000";
    if (thing != NONE)
        CHECK(ask(thing == OWN ? USER : ADMIN, "POST", "/v1/uploads",
                  "Tus-Resumable: 1.0.0\r\nUpload-Length: 10\r\nContent-Length: 0\r\n", "", &reply) == 201);
    const char *location = thing != NONE ? strstr(buf_text(&reply), "Location: ") : NULL;
    CHECK(thing == NONE || (location && sscanf(location, "Location: %127[^\r]", path) == 1));
    if (thing != NONE)
        buf_release(&reply);
    return mem_strdup(path);
}

/* The pattern with the thing's job and scene; the caller's. */
static char *concrete(const char *pattern, int64_t job, const char *scene) {
    struct buf path;
    buf_init(&path, 1024);
    for (const char *at = pattern; *at; at += strcspn(at, "{")) {
        if (*at != '{') {
            buf_append(&path, at, strcspn(at, "{"));
            continue;
        }
        if (strncmp(at, "{job}", 5) == 0)
            buf_printf(&path, "%lld", (long long)job);
        else
            buf_puts(&path, strncmp(at, "{scene}", 7) == 0 ? scene : "none.exr");
        at += strcspn(at, "}") + 1;
        buf_append(&path, at, strcspn(at, "{"));
    }
    return buf_detach(&path);
}

/* What the table of users.h wants: 401, 403, 404, or 0 for anything else. */
static int wanted_refusal(const struct route *route, enum who who, enum thing thing, bool names_thing) {
    bool is_upload = strstr(route->pattern, "{upload}") != NULL;
    if (is_upload && (thing == SHARED || who == VIEWER))
        thing = thing == NONE ? NONE : OTHERS; /* they are not shared, and viewers have none */
    bool changes = route->access >= ROUTE_USER;
    if (route->access == ROUTE_PUBLIC)
        return 0;
    if (who < VIEWER)
        return 401;
    if ((who == VIEWER && changes) || (route->access == ROUTE_ADMIN && who != ADMIN))
        return 403;
    if (strstr(route->pattern, "{token}"))
        return 404; /* there is no token of that number */
    if (!names_thing)
        return 0;
    if (thing == NONE || (thing == OTHERS && who != ADMIN))
        return 404;
    return thing == SHARED && who != ADMIN && changes ? 403 : 0;
}

static void test_matrix(void) {
    static const char *const methods[] = {"GET", "POST", "PATCH", "DELETE", "OPTIONS", "PUT"};
    size_t count;
    const struct route *table = routes_table(&count);
    for (size_t i = 0; i < count; i++) {
        if (table[i].access == ROUTE_NODE) /* for the tokens of attempts, not of users */
            continue;
        bool is_upload = strstr(table[i].pattern, "{upload}") != NULL;
        bool names_thing = strstr(table[i].pattern, "{job}") || strstr(table[i].pattern, "{scene}") || is_upload;
        for (int who = NOBODY; who < WHO_COUNT; who++) {
            for (int thing = NONE; thing < (names_thing ? THING_COUNT : 1); thing++) {
                /* Fresh things each time: the allowed requests change them. */
                int64_t me = user_of(who == VIEWER ? VIEWER : USER), she = user_of(ADMIN);
                int64_t job = thing == NONE ? 999999 : make_job((enum thing)thing, thing == OWN ? me : she);
                char *path =
                    is_upload ? make_upload((enum thing)thing) : concrete(table[i].pattern, job, scenes[thing]);
                /* A stream without an end would have to be cut. */
                if (strstr(path, "/events") && !strchr(path, '?')) {
                    char *finite = mem_printf("%s?follow=0", path);
                    mem_free(path);
                    path = finite;
                }
                const char *body = table[i].body == ROUTE_BODY_JSON ? "{}" : "";
                int found = status_of((enum who)who, methods[table[i].method], path, body);
                int wanted = wanted_refusal(&table[i], (enum who)who, (enum thing)thing, names_thing);
                bool is_file = strstr(table[i].pattern, "{name") != NULL; /* there is none: 404 */
                bool good = wanted ? found == wanted : found != 401 && found != 403 && (is_file || found != 404);
                if (strcmp(table[i].pattern, "/v1/session") == 0 && table[i].method == METHOD_POST)
                    good = found == 400; /* {} has no token */
                CHECK_THAT(good, "%s %s of %s by %s: %d, wanted %d", methods[table[i].method], path, thing_names[thing],
                           who_names[who], found, wanted);
                mem_free(path);
            }
        }
    }
}

/* What exists and is not for you is told in the words for what does not exist. */
static void test_same_words(void) {
    struct buf a, b;
    int64_t job = make_job(OTHERS, user_of(ADMIN));
    char *path = mem_printf("/v1/jobs/%lld", (long long)job);
    CHECK(ask(USER, "GET", path, "X-Request-Id: same\r\n", "", &a) == 404);
    CHECK(ask(USER, "GET", "/v1/jobs/999999", "X-Request-Id: same\r\n", "", &b) == 404);
    char hidden[32];
    snprintf(hidden, sizeof hidden, "there is no job %lld\"", (long long)job);
    CHECK(strstr(rig_body(&a), hidden) && strstr(rig_body(&b), "there is no job 999999\""));
    buf_release(&a);
    buf_release(&b);
    CHECK(ask(USER, "GET", "/v1/scenes/" OTHER_SCENE, "X-Request-Id: same\r\n", "", &a) == 404);
    CHECK(ask(USER, "GET", "/v1/scenes/" NO_SCENE, "X-Request-Id: same\r\n", "", &b) == 404);
    CHECK(strlen(rig_body(&a)) == strlen(rig_body(&b)));
    buf_release(&a);
    buf_release(&b);
    char *body = mem_printf("{\"scene\":\"%s\"}", OTHER_SCENE);
    CHECK(ask(USER, "POST", "/v1/jobs", "", body, &a) == 422 && strstr(rig_body(&a), "there is no scene"));
    mem_free(body);
    buf_release(&a);
    body = mem_printf("{\"scene\":\"%.8s\"}", OTHER_SCENE);
    CHECK(status_of(USER, "POST", "/v1/jobs", body) == 422);
    CHECK(status_of(ADMIN, "POST", "/v1/jobs", body) == 201);
    mem_free(body);
    mem_free(path);
}

static void test_bad_tokens(void) {
    static const char *const fields[] = {
        "Authorization: Bearer\r\n",
        "Authorization: Bearer \r\n",
        "Authorization: Basic YTpi\r\n",
        "Authorization: Bearer unbake_1_\r\n",
        "Cookie: unbake_token=\r\n",
        "Cookie: unbake_token\r\n",
        "Cookie: a=b; xunbake_token=1; unbake_tokens=2\r\n",
    };
    struct buf reply;
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        CHECK_THAT(ask(NOBODY, "GET", "/v1/jobs", fields[i], "", &reply) == 401, "%s", fields[i]);
        CHECK(strstr(buf_text(&reply), "WWW-Authenticate: Bearer"));
        buf_release(&reply);
    }
    char *twice = mem_printf("Authorization: Bearer %s\r\n", tokens[ADMIN]);
    CHECK(ask(USER, "GET", "/v1/jobs", twice, "", &reply) == 400);
    mem_free(twice);
    buf_release(&reply);
    /* A body is not even read before the token was looked at. */
    CHECK(ask(NOBODY, "POST", "/v1/scenes", "Content-Length: 1000000\r\n", "", &reply) == 401);
    buf_release(&reply);
}

static void test_session(void) {
    struct buf reply;
    char *body = mem_printf("{\"token\":\"%s\"}", tokens[USER]);
    CHECK(ask(NOBODY, "POST", "/v1/session", "", body, &reply) == 200);
    CHECK(strstr(rig_body(&reply), "\"user\":\"mia\"") && !strstr(rig_body(&reply), tokens[USER]));
    char cookie[TOKEN_SIZE + 32] = "";
    const char *set = strstr(buf_text(&reply), "Set-Cookie: ");
    CHECK(set && sscanf(set, "Set-Cookie: %100[^;]", cookie) == 1);
    CHECK(set && strstr(set, "HttpOnly; SameSite=Strict\r\n"));
    buf_release(&reply);
    mem_free(body);
    char *fields = mem_printf("Cookie: a=b; %s; c=d\r\n", cookie);
    CHECK(ask(NOBODY, "GET", "/v1/session", fields, "", &reply) == 200 && strstr(rig_body(&reply), "\"mia\""));
    buf_release(&reply);
    mem_free(fields);
    /* A page of elsewhere has the cookie sent for it, but must not change anything. */
    fields = mem_printf("Cookie: %s\r\nOrigin: http://evil.example\r\n", cookie);
    CHECK(ask(NOBODY, "POST", "/v1/jobs", fields, "{}", &reply) == 403);
    buf_release(&reply);
    mem_free(fields);
    CHECK(ask(NOBODY, "POST", "/v1/session", "", "{\"token\":\"unbake_1_x\"}", &reply) == 401);
    buf_release(&reply);
    CHECK(ask(NOBODY, "DELETE", "/v1/session", "", "", &reply) == 204 &&
          strstr(buf_text(&reply), "unbake_token=; Path=/; Max-Age=0"));
    buf_release(&reply);
}

/* Opens a stream on the job; what has come so far goes to *out. */
static int open_stream(enum who who, int64_t job, struct buf *out) {
    int fd = rig_connect(&rig);
    char *text = mem_printf("GET /v1/jobs/%lld/events HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                            "Authorization: Bearer %s\r\n\r\n",
                            (long long)job, tokens[who]);
    buf_init(out, 1 << 20);
    rig_send(fd, text, strlen(text));
    rig_receive(fd, out, "snapshot");
    mem_free(text);
    return fd;
}

static void test_streams_end(void) {
    struct error err;
    struct buf out, other;
    size_t count;
    add_token(STRANGER, "eve", ROLE_USER);
    int64_t job = make_job(SHARED, user_of(USER));
    int fd = open_stream(STRANGER, job, &out), mine = open_stream(USER, job, &other);
    rig_must(store_token_revoke(rig.store, "eve", &count, &err), &err, "revoke");
    hub_recheck(rig.api->hub);
    rig_receive(fd, &out, NULL); /* to its end: the test would hang otherwise */
    CHECK(rig_status(&out) == 200);
    CHECK(status_of(STRANGER, "GET", "/v1/jobs", "") == 401);
    close(fd);
    buf_release(&out);
    /* The other one goes on. */
    rig_must(store_job_pause(rig.store, job, &err), &err, "pause");
    rig_receive(mine, &other, "\"paused\"");
    CHECK(strstr(buf_text(&other), "\"paused\""));
    close(mine);
    buf_release(&other);
    /* One on a job that is no longer shared ends with the next event. */
    add_token(STRANGER, "eve", ROLE_USER);
    fd = open_stream(STRANGER, job, &out);
    rig_must(store_job_patch(rig.store, job, -1, &(struct job_patch){.shared = 0}, &err), &err, "unshare");
    rig_must(store_job_resume(rig.store, job, NULL, &err), &err, "resume");
    rig_receive(fd, &out, NULL);
    CHECK(!strstr(buf_text(&out), "\"state\":\"queued\",\"at\""));
    close(fd);
    buf_release(&out);
}

int main(void) {
    struct error err;
    size_t count;
    rig_start(&rig, &rig_patient, 60);
    rig.api->config.queue_limit = 1000000;
    CHECK(status_of(NOBODY, "GET", "/v1/jobs", "") == 200); /* open, until there is a user */
    snprintf(tokens[STRANGER], TOKEN_SIZE, "unbake_1_%048d", 0);
    CHECK(status_of(STRANGER, "GET", "/v1/jobs", "") == 200);
    add_token(REVOKED, "gone", ROLE_ADMIN);
    rig_must(store_token_revoke(rig.store, "gone", &count, &err), &err, "revoke");
    CHECK(status_of(NOBODY, "GET", "/v1/jobs", "") == 401); /* and not again when none is left */
    add_token(VIEWER, "vic", ROLE_VIEWER);
    add_token(USER, "mia", ROLE_USER);
    add_token(ADMIN, "ada", ROLE_ADMIN);
    test_matrix();
    test_same_words();
    test_bad_tokens();
    test_session();
    test_streams_end();
    rig_stop(&rig);
    return check_result();
}
