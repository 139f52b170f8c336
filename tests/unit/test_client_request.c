/* The real client against a server that follows a script: broken connections, replies that are
 * lost or cut, other versions of a file, refusals. Each step of a script says what the next
 * request must contain and what it gets; every reply ends its connection. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/sha256.h"
#include "tests/check.h"

#define HANG "hang" /* instead of a reply: keep the connection until the client ends it */

struct step {
    const char *wanted[4]; /* must all be in the request's head, or, with '!' before, must not */
    char *reply;           /* owned; "" closes without a word */
};

struct script {
    struct step step[24];
    size_t count, done; /* done is read by the other thread after it waited for the client */
    int listener, port;
    pthread_t thread;
    int hanging[2]; /* a pipe: a byte when the script hangs */
    char body_sha256[SHA256_HEX_SIZE]; /* of the last request's body */
};

static char root[] = "/tmp/unbake-request-XXXXXX";
static char out_text[65536], err_text[65536]; /* what the last client printed */

/* --- the server ---------------------------------------------------------------------------- */

static void add_step(struct script *s, const char *reply, const char *a, const char *b, const char *c) {
    s->step[s->count++] = (struct step){.wanted = {a, b, c}, .reply = mem_strdup(reply)};
}

/* A reply with a body; more headers go before ("ETag: x\r\n" or ""). */
static void add_reply(struct script *s, const char *code, const char *headers, const char *body,
                      const char *a, const char *b, const char *c) {
    const char *type = body[0] == '{' ? code[0] >= '4' ? "application/problem+json" : "application/json"
                                      : "application/octet-stream";
    char *reply = mem_printf("HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n%s"
                             "Connection: close\r\n\r\n%s", code, type, strlen(body), headers, body);
    add_step(s, reply, a, b, c);
    mem_free(reply);
}

static void send_all(int fd, const char *bytes, size_t length) {
    while (length > 0) {
        ssize_t sent = send(fd, bytes, length, MSG_NOSIGNAL);
        if (sent <= 0)
            return;
        bytes += sent;
        length -= (size_t)sent;
    }
}

static void receive(int fd, struct script *s, struct buf *head) {
    char bytes[4096];
    const char *end = NULL;
    while (!end) {
        ssize_t got = recv(fd, bytes, sizeof bytes, 0);
        if (got <= 0)
            return;
        buf_append(head, bytes, (size_t)got);
        end = strstr(buf_text(head), "\r\n\r\n");
    }
    const char *length_at = strcasestr(buf_text(head), "\r\nContent-Length:");
    size_t length = length_at ? strtoul(length_at + 17, NULL, 10) : 0;
    size_t have = head->length - (size_t)(end + 4 - head->data);
    struct sha256 hash;
    sha256_init(&hash);
    sha256_update(&hash, end + 4, have);
    if (strcasestr(buf_text(head), "Expect: 100-continue"))
        send_all(fd, "HTTP/1.1 100 Continue\r\n\r\n", 25);
    while (have < length) {
        ssize_t got = recv(fd, bytes, sizeof bytes, 0);
        if (got <= 0)
            break;
        sha256_update(&hash, bytes, (size_t)got);
        have += (size_t)got;
    }
    sha256_hex(&hash, s->body_sha256);
}

static void check_request(const struct script *s, const char *head) {
    const struct step *step = &s->step[s->done];
    for (size_t i = 0; i < 4 && step->wanted[i]; i++) {
        bool absent = step->wanted[i][0] == '!';
        bool found = strcasestr(head, step->wanted[i] + absent) != NULL;
        CHECK_THAT(found != absent, "step %zu: \"%s\" in:\n%s", s->done, step->wanted[i], head);
    }
    const char *digest = strstr(head, "X-Content-SHA256: ");
    CHECK(!digest || strncmp(digest + 18, s->body_sha256, 64) == 0);
}

static void *serve(void *user) {
    struct script *s = user;
    int fd;
    while ((fd = accept(s->listener, NULL, NULL)) >= 0) {
        struct buf head;
        char byte = 0;
        buf_init(&head, 1 << 20);
        receive(fd, s, &head);
        if (head.length == 0) {
            close(fd);
            buf_release(&head);
            break; /* the test itself connects to say that it is over */
        }
        if (s->done < s->count) {
            const char *reply = s->step[s->done].reply;
            check_request(s, buf_text(&head));
            if (strcmp(reply, HANG) == 0) {
                CHECK(write(s->hanging[1], &byte, 1) == 1);
                CHECK(recv(fd, &byte, 1, 0) == 0);
            } else
                send_all(fd, reply, strlen(reply));
        }
        s->done++;
        buf_release(&head);
        close(fd);
    }
    return NULL;
}

static void script_start(struct script *s) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t size = sizeof address;
    s->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(bind(s->listener, (struct sockaddr *)&address, size) == 0);
    CHECK(listen(s->listener, 8) == 0);
    CHECK(getsockname(s->listener, (struct sockaddr *)&address, &size) == 0);
    s->port = ntohs(address.sin_port);
    CHECK(pipe(s->hanging) == 0);
    CHECK(pthread_create(&s->thread, NULL, serve, s) == 0);
}

/* Ends the server; every step must have been asked for, and nothing else. */
static void script_end(struct script *s, const char *name) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)s->port),
                                  .sin_addr = {htonl(INADDR_LOOPBACK)}};
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    CHECK(connect(fd, (struct sockaddr *)&address, sizeof address) == 0);
    close(fd);
    pthread_join(s->thread, NULL);
    CHECK_THAT(s->done == s->count, "%s: %zu requests came, %zu were expected", name, s->done, s->count);
    close(s->listener);
    close(s->hanging[0]);
    close(s->hanging[1]);
    for (size_t i = 0; i < s->count; i++)
        mem_free(s->step[i].reply);
    *s = (struct script){0};
}

/* --- the client ---------------------------------------------------------------------------- */

static void read_text(const char *path, char *text, size_t size) {
    struct buf b;
    buf_init(&b, size - 1);
    file_read(path, &b, NULL);
    snprintf(text, size, "%s", buf_text(&b));
    buf_release(&b);
}

/* Runs `unbake WORDS --server ...` through the shell; its exit status. */
static int client(const struct script *s, const char *format, ...) {
    char words[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(words, sizeof words, format, args);
    va_end(args);
    const char *build = getenv("UNBAKE_BUILD");
    char *command = mem_printf("%s/unbake %s --server http://127.0.0.1:%d/ >%s/out 2>%s/err",
                               build ? build : "build", words, s->port, root, root);
    int status = system(command);
    mem_free(command);
    char *path = mem_printf("%s/out", root);
    read_text(path, out_text, sizeof out_text);
    mem_free(path);
    path = mem_printf("%s/err", root);
    read_text(path, err_text, sizeof err_text);
    mem_free(path);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

#define CHECK_EXIT(found, wanted)                                                              \
    do {                                                                                       \
        int check_code = (found);                                                              \
        CHECK_THAT(check_code == (wanted), "exit %d\nout: %s\nerr: %s", check_code, out_text,  \
                   err_text);                                                                  \
    } while (0)
#define CHECK_PART(text, part) CHECK_THAT(strstr(text, part) != NULL, "\"%s\" is not in: %s", part, text)

/* --- tries --------------------------------------------------------------------------------- */

static void test_tries(void) {
    struct script s = {0};
    /* What reads is tried again. */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "{\"detail\":\"starting\"}", "GET /v1/jobs?limit=20 ", NULL, NULL);
    add_step(&s, "", "GET /v1/jobs?limit=20 ", NULL, NULL);
    add_step(&s, "HTTP/1.1 200 OK\r\nContent-Length: 90\r\n\r\n{", NULL, NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[],\"next\":null}", "GET /v1/jobs?limit=20 ", "User-Agent: unbake/", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "list --json"), 0);
    CHECK_STRING(out_text, "[]\n");
    script_end(&s, "tries");

    /* What acts is not, once the server may have got it... */
    add_step(&s, "", "POST /v1/jobs/5/cancel ", "Content-Length: 0", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "cancel 5"), 5);
    script_end(&s, "act once");

    /* ... but for a reply that says it was not taken. */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "{}", "POST /v1/jobs/5/cancel ", NULL, NULL);
    add_reply(&s, "202 Accepted", "", "{\"state\":\"cancelled\",\"wanted\":\"run\"}", "POST", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "cancel 5"), 0);
    CHECK_STRING(out_text, "job 5 is cancelled\n");
    script_end(&s, "act after 503");
}

static void test_pages(void) {
    struct script s = {0};
    add_reply(&s, "200 OK", "", "{\"items\":[{\"id\":3},{\"id\":2}],\"next\":\"a b&\"}",
              "GET /v1/jobs?state=failed&limit=3 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[{\"id\":1}],\"next\":\"more\"}",
              "GET /v1/jobs?state=failed&limit=1&cursor=a%20b%26 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "list -q --state failed --limit 3"), 0);
    CHECK_STRING(out_text, "3\n2\n1\n");
    script_end(&s, "pages");
}

static void test_refusals(void) {
    static const struct {
        const char *code, *body;
        int exit_status;
        const char *said;
    } t[] = {
        {"404 Not Found", "{\"detail\":\"there is no job 5\"}", 3, "unbake: there is no job 5\n"},
        {"409 Conflict", "{\"detail\":\"job 5 has ended\",\"hint\":\"retry it\"}", 6, "  hint: retry it\n"},
        {"412 Stale", "{\"detail\":\"changed\"}", 6, "changed"},
        {"422 Invalid",
         "{\"detail\":\"2 faults\",\"invalid_params\":[{\"name\":\"settings.a\",\"reason\":\"no\",\"hint\":\"b?\"},"
         "{\"name\":\"labels\",\"reason\":\"\\u001b[31m\"}]}",
         4, "  settings.a: no (b?)\n  labels: ?[31m\n"},
        {"429 Full", "{\"detail\":\"the queue is full\"}", 4, "the queue is full"},
        {"500 Oops", "{\"detail\":\"a defect\"}", 4, "a defect"},
        {"507 Full", "{\"detail\":\"no room\"}", 4, "no room"},
        {"418 Teapot", "short", 4, "answered 418"},
        {"200 OK", "{\"cut", 5, "does not answer in JSON"},
    };
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        struct script s = {0};
        add_reply(&s, t[i].code, "", t[i].body, "POST /v1/jobs/5/retry ", NULL, NULL);
        script_start(&s);
        CHECK_EXIT(client(&s, "retry 5"), t[i].exit_status);
        CHECK_PART(err_text, t[i].said);
        CHECK_STRING(out_text, "");
        script_end(&s, t[i].code);
    }
}

/* --- get ----------------------------------------------------------------------------------- */

static const char content[] = "0123456789abcdefghij"; /* 20 bytes */
static char listing[1024], version[128];

static void put_part(const char *name, const char *text) {
    char *path = mem_printf("%s/got/%s", root, name), *parent = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    CHECK(file_make_dirs(parent, NULL) == STATUS_OK);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(parent);
    mem_free(path);
}

static void check_file(const char *name, const char *wanted) {
    char text[256];
    char *path = mem_printf("%s/got/%s", root, name);
    bool there = access(path, F_OK) == 0;
    if (wanted)
        read_text(path, text, sizeof text);
    CHECK_THAT(there == (wanted != NULL), "%s", path);
    if (wanted && there)
        CHECK_STRING(text, wanted);
    mem_free(path);
}

static void list_outputs(struct script *s, const char *name, const char *of) {
    char sha256[SHA256_HEX_SIZE];
    sha256_of(of, strlen(of), sha256);
    snprintf(listing, sizeof listing, "{\"items\":[{\"name\":\"%s\",\"bytes\":%zu,\"sha256\":\"%s\"}]}", name,
             strlen(of), sha256);
    snprintf(version, sizeof version, "If-Range: \"sha256-%s\"", sha256);
    add_reply(s, "200 OK", "", listing, "GET /v1/jobs/7/outputs ", NULL, NULL);
}

static void clean(void) {
    char *path = mem_printf("%s/got", root);
    file_remove_tree(path, NULL);
    mem_free(path);
}

static void test_get_resumes(void) {
    struct script s = {0};
    clean();
    list_outputs(&s, "preview/a b.png", content);
    add_step(&s, "HTTP/1.1 200 OK\r\nContent-Length: 20\r\n\r\n01234567",
             "GET /v1/jobs/7/outputs/preview/a%20b.png ", "!Range:", NULL);
    add_step(&s, "", "Range: bytes=8-\r\n", version, NULL);
    add_reply(&s, "206 Partial", "Content-Range: bytes 8-19/20\r\n", content + 8, "Range: bytes=8-\r\n",
              version, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"fetched\"");
    check_file("preview/a b.png", content);
    check_file("preview/a b.png.part", NULL);
    script_end(&s, "get, cut");

    /* A second time there is nothing to do. */
    list_outputs(&s, "preview/a b.png", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got 'preview/*'", root), 0);
    CHECK_PART(out_text, "all there already");
    script_end(&s, "get, present");

    /* Half a file from an earlier run. */
    put_part("x.exr.part", "01234");
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "206 Partial", "Content-Range: bytes 5-19/20\r\n", content + 5, "Range: bytes=5-\r\n",
              version, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 x.exr -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"resumed\"");
    check_file("x.exr", content);
    script_end(&s, "get, resumed");

    /* A server that sends the whole all the same: taken as such, at once. */
    put_part("w.exr.part", "01234");
    list_outputs(&s, "w.exr", content);
    add_reply(&s, "200 OK", "", content, "Range: bytes=5-\r\n", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 w.exr -o %s/got --json", root), 0);
    CHECK_PART(out_text, "\"action\":\"fetched\"");
    check_file("w.exr", content);
    script_end(&s, "get, range ignored");

    /* A whole .part needs no request at all. */
    put_part("y.exr.part", content);
    list_outputs(&s, "y.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("y.exr", content);
    script_end(&s, "get, whole part");
}

static void test_get_distrusts(void) {
    struct script s = {0};
    clean();
    /* What the .part holds is wrong: fetched anew. */
    put_part("x.exr.part", "WRONG");
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "206 Partial", "Content-Range: bytes 5-19/20\r\n", content + 5, "Range: bytes=5-\r\n", NULL, NULL);
    list_outputs(&s, "x.exr", content);
    add_reply(&s, "200 OK", "", content, "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("x.exr", content);
    script_end(&s, "get, wrong part");

    /* Longer than the file ever was. */
    put_part("z.exr.part", "0123456789abcdefghij and more");
    list_outputs(&s, "z.exr", content);
    add_reply(&s, "200 OK", "", content, "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("z.exr", content);
    script_end(&s, "get, part too long");

    /* The job replaces the file meanwhile: the server begins anew, and the list is read again. */
    put_part("v.exr.part", "01234");
    list_outputs(&s, "v.exr", content);
    add_reply(&s, "200 OK", "", "another version, longer", "Range: bytes=5-", NULL, NULL);
    list_outputs(&s, "v.exr", "another version, longer");
    add_reply(&s, "200 OK", "", "another version, longer", "!Range:", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 0);
    check_file("v.exr", "another version, longer");
    script_end(&s, "get, new version");

    /* Damage that stays is an error, and no file. */
    list_outputs(&s, "bad.exr", content);
    add_reply(&s, "200 OK", "", "0123456789abcdefghiX", "GET", NULL, NULL);
    list_outputs(&s, "bad.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 7);
    CHECK_PART(err_text, "SHA-256");
    check_file("bad.exr", NULL);
    script_end(&s, "get, damaged");

    /* Names lead nowhere else. */
    list_outputs(&s, "../escaped", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got", root), 7);
    CHECK_PART(err_text, "unsafe name");
    check_file("../escaped", NULL);
    script_end(&s, "get, unsafe");

    list_outputs(&s, "base_color.exr", content);
    script_start(&s);
    CHECK_EXIT(client(&s, "get 7 -o %s/got basecolor.exr", root), 3);
    CHECK_PART(err_text, "did you mean base_color.exr?");
    script_end(&s, "get, unknown");
}

/* --- watch --------------------------------------------------------------------------------- */

#define STREAM "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nConnection: close\r\n\r\n"
#define SNAPSHOT STREAM "id: 5\nevent: state\ndata: {\"id\":7,\"state\":\"running\",\"snapshot\":true}\n\n"

static void test_watch(void) {
    struct script s = {0};
    add_step(&s, SNAPSHOT "id: 6\nevent: progress\ndata: {\"stage\":\"refine\",\"done\":1,\"total\":4}\n\n"
                          "id: 7\nevent: progress\ndata: {\"sta",
             "GET /v1/jobs/7/events ", "Accept: text/event-stream", "!Last-Event-ID");
    add_step(&s, "", "Last-Event-ID: 6\r\n", NULL, NULL);
    add_step(&s, STREAM "id: 6\nevent: state\ndata: {\"state\":\"running\",\"snapshot\":true}\n\n"
                        "id: 7\nevent: log\ndata: {\"level\":\"warning\",\"message\":\"dim\"}\n\n"
                        "id: 8\nevent: state\ndata: {\"state\":\"succeeded\"}\n\n",
             "Last-Event-ID: 6\r\n", NULL, NULL);
    add_reply(&s, "200 OK", "",
              "{\"id\":7,\"state\":\"succeeded\",\"started_at\":\"2024-01-01T00:00:00.000Z\","
              "\"finished_at\":\"2024-01-01T00:03:05.000Z\"}",
              "GET /v1/jobs/7 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 0);
    CHECK_STRING(out_text, "job 7  running    0%\njob 7  refine   25%\nwarning: dim\n"
                           "job 7 succeeded after 3m05s\nfetch its outputs with: unbake get 7\n");
    script_end(&s, "watch, cut");

    /* Reconnected after the end: 204. A failed job is exit status 1, with its reason. */
    add_step(&s, SNAPSHOT, NULL, NULL, NULL);
    add_step(&s, "HTTP/1.1 204 No Content\r\n\r\n", "Last-Event-ID: 5\r\n", NULL, NULL);
    add_reply(&s, "200 OK", "",
              "{\"id\":7,\"state\":\"failed\",\"reason\":\"bad input\",\"hint\":\"mend it\",\"scene\":\"ab\"}",
              "GET /v1/jobs/7 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"problems\":[{\"file\":\"a.png\",\"reason\":\"cut off\"}]}", "GET /v1/scenes/ab ",
              NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 1);
    CHECK_PART(out_text, "job 7 failed: bad input\n  hint: mend it\n  a.png: cut off\n");
    script_end(&s, "watch, failed");

    /* JSON: each event a line, and the exit status. */
    add_step(&s, SNAPSHOT "id: 6\nevent: state\ndata: {\"state\":\"cancelled\"}\n\n", "Last-Event-ID: 0", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"id\":7,\"state\":\"cancelled\"}", "GET /v1/jobs/7 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7 --json --all"), 1);
    CHECK_STRING(out_text,
                 "{\"id\":5,\"event\":\"state\",\"data\":{\"id\":7,\"state\":\"running\",\"snapshot\":true}}\n"
                 "{\"id\":6,\"event\":\"state\",\"data\":{\"state\":\"cancelled\"}}\n");
    script_end(&s, "watch, json");

    add_reply(&s, "404 Not Found", "", "{\"detail\":\"there is no job 7\"}", NULL, NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 3);
    script_end(&s, "watch, unknown");
}

/* Nobody listens: what is tried ends, soon, with 5. */
static void test_unreachable(void) {
    struct script s = {0};
    script_start(&s);
    int port = s.port;
    script_end(&s, "unreachable");
    s.port = port;
    CHECK_EXIT(client(&s, "list --retry 0.3"), 5);
    CHECK_PART(err_text, "Connection refused");
    CHECK_EXIT(client(&s, "watch 7 --retry 0.3"), 5);
    CHECK_EXIT(client(&s, "version --json"), 0);
    CHECK_PART(out_text, "\"server\":null");
    CHECK_EXIT(client(&s, "settings --json --retry 0 -q"), 0);
    CHECK_PART(out_text, "texture_size");
}

/* Ctrl-C while watching: at once, with 130, and a word about the job. */
static void test_interrupted(void) {
    struct script s = {0};
    char byte, server[64], path[64];
    const char *build = getenv("UNBAKE_BUILD");
    char *program = mem_printf("%s/unbake", build ? build : "build");
    add_step(&s, HANG, "GET /v1/jobs/7/events ", NULL, NULL);
    script_start(&s);
    snprintf(server, sizeof server, "http://127.0.0.1:%d", s.port);
    snprintf(path, sizeof path, "%s/err", root);
    pid_t child = fork();
    if (child == 0) {
        if (!freopen(path, "w", stderr))
            _exit(99);
        execl(program, "unbake", "watch", "7", "--server", server, (char *)NULL);
        _exit(99);
    }
    CHECK(read(s.hanging[0], &byte, 1) == 1);
    CHECK(kill(child, SIGINT) == 0);
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 130);
    read_text(path, err_text, sizeof err_text);
    CHECK_PART(err_text, "job 7 goes on");
    script_end(&s, "interrupted");
    mem_free(program);
}

/* --- submit -------------------------------------------------------------------------------- */

#define UNKNOWN_SCENE "{\"detail\":\"no\",\"invalid_params\":[{\"name\":\"scene\",\"reason\":\"unknown\"}]}"

static void test_submit(void) {
    struct script s = {0};
    put_part("room/mesh.ply", "ply\n");
    put_part("room/images/a.png", "png\n");
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "", UNKNOWN_SCENE, "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[],\"next\":null}", "GET /v1/uploads?sha256=", NULL, NULL);
    /* "room" and 64 hex digits */
    add_reply(&s, "201 Created", "Location: /v1/uploads/ab\r\n", "", "POST /v1/uploads ",
              "Upload-Length: 3072\r\n", "Upload-Metadata: name cm9vbQ==,sha256 ");
    add_step(&s, "", "PATCH /v1/uploads/ab ", "Upload-Offset: 0\r\n", "Content-Length: 3072\r\n"); /* broken off */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 1000\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "409 Conflict", "", "{\"detail\":\"no\"}", "PATCH", "Upload-Offset: 1000\r\n", NULL); /* it moved on */
    add_reply(&s, "200 OK", "Upload-Offset: 1500\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "204 No Content", "Upload-Offset: 2000\r\n", "", "PATCH", "Upload-Offset: 1500\r\n", NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 2000\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_step(&s, "", "PATCH", "Upload-Offset: 2000\r\n", "Content-Length: 1072\r\n"); /* only the reply is lost */
    add_reply(&s, "200 OK", "Upload-Offset: 3072\r\n", "", "HEAD /v1/uploads/ab ", NULL, NULL);
    add_reply(&s, "201 Created", "", "{\"id\":7,\"name\":\"room\",\"scene\":\"abcdef\"}", "POST /v1/jobs ",
              "Idempotency-Key: ", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room/ --set texture_size=256 --label a=b", root), 0);
    CHECK_STRING(out_text, "job 7 is queued: room (scene abcdef)\n");
    CHECK_PART(err_text, "sent room (2 files");
    script_end(&s, "submit");

    /* Another process had begun: this one finds it and goes on; that it is gone is no end either. */
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "", UNKNOWN_SCENE, "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[{\"length\":3072,\"scene\":\"ab\",\"links\":{\"self\":\"/v1/uploads/1\"}},"
              "{\"length\":3072,\"scene\":null,\"links\":{\"self\":\"/v1/uploads/2\"}}]}", "GET /v1/uploads?sha256=", NULL, NULL);
    add_reply(&s, "200 OK", "Upload-Offset: 512\r\n", "", "HEAD /v1/uploads/2 ", NULL, NULL);
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"expired\"}", "PATCH /v1/uploads/2 ", "Upload-Offset: 512\r\n", NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[]}", "GET /v1/uploads?sha256=", NULL, NULL);
    add_reply(&s, "201 Created", "Location: /v1/uploads/3\r\n", "", "POST /v1/uploads ", NULL, NULL);
    add_reply(&s, "204 No Content", "Upload-Offset: 3072\r\n", "", "PATCH /v1/uploads/3", "Upload-Offset: 0\r\n", NULL);
    add_reply(&s, "201 Created", "", "{\"id\":8,\"name\":\"room\",\"scene\":\"abcdef\"}", "POST /v1/jobs ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room/", root), 0);
    CHECK_PART(err_text, "512 B of 3.0 KiB are on the server already");
    script_end(&s, "submit, going on");

    /* A fault of a setting is told before anything is sent; that of the scene is none. */
    add_reply(&s, "404 Not Found", "", "{\"detail\":\"no\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "422 Invalid", "",
              "{\"detail\":\"no\",\"invalid_params\":[{\"name\":\"scene\",\"reason\":\"unknown\"},"
              "{\"name\":\"settings.x\",\"reason\":\"no such\"}]}",
              "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room --set x=1", root), 4);
    CHECK_PART(err_text, "  settings.x: no such\n");
    CHECK(!strstr(err_text, "scene: unknown"));
    script_end(&s, "submit, fault");

    add_reply(&s, "200 OK", "", "{\"state\":\"ready\"}", "GET /v1/scenes/", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"dry_run\":true,\"scene_state\":\"ready\"}", "POST /v1/jobs?dry_run=1 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/got/room --dry-run", root), 0);
    CHECK_PART(out_text, "is on the server (ready)");
    script_end(&s, "submit, dry run");

    script_start(&s);
    CHECK_EXIT(client(&s, "submit %s/nothing", root), 2);
    CHECK_EXIT(client(&s, "submit"), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --scene ab", root), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --set x", root), 2);
    CHECK_EXIT(client(&s, "submit %s/got/room --label =x", root), 2);
    CHECK_EXIT(client(&s, "show seven"), 2);
    CHECK_EXIT(client(&s, "list --state runing"), 2);
    CHECK_PART(err_text, "did you mean running?");
    CHECK_EXIT(client(&s, "frob"), 2);
    script_end(&s, "usage");
}

int main(void) {
    if (!mkdtemp(root))
        return 1;
    test_tries();
    test_pages();
    test_refusals();
    test_get_resumes();
    test_get_distrusts();
    test_watch();
    test_unreachable();
    test_interrupted();
    test_submit();
    file_remove_tree(root, NULL);
    return check_result();
}
