/* client_script.h -- for tests of the real client: a server that follows a script. Each step says what the next
 * request must contain and what it gets; every reply ends its connection. */
#ifndef UNBAKE_TESTS_CLIENT_SCRIPT_H
#define UNBAKE_TESTS_CLIENT_SCRIPT_H

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
    int hanging[2];                    /* a pipe: a byte when the script hangs */
    char body_sha256[SHA256_HEX_SIZE]; /* of the last request's body */
};

static char root[] = "/tmp/unbake-request-XXXXXX";
static char out_text[65536], err_text[65536]; /* what the last client printed */

/* --- the server ---------------------------------------------------------------------------- */

static inline void add_step(struct script *s, const char *reply, const char *a, const char *b, const char *c) {
    s->step[s->count++] = (struct step){.wanted = {a, b, c}, .reply = mem_strdup(reply)};
}

/* A reply with a body; more headers go before ("ETag: x\r\n" or ""). */
static inline void add_reply(struct script *s, const char *code, const char *headers, const char *body, const char *a,
                             const char *b, const char *c) {
    const char *type =
        body[0] == '{' ? code[0] >= '4' ? "application/problem+json" : "application/json" : "application/octet-stream";
    char *reply = mem_printf("HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n%s"
                             "Connection: close\r\n\r\n%s",
                             code, type, strlen(body), headers, body);
    add_step(s, reply, a, b, c);
    mem_free(reply);
}

static inline void send_all(int fd, const char *bytes, size_t length) {
    while (length > 0) {
        ssize_t sent = send(fd, bytes, length, MSG_NOSIGNAL);
        if (sent <= 0)
            return;
        bytes += sent;
        length -= (size_t)sent;
    }
}

static inline void receive(int fd, struct script *s, struct buf *head) {
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

static inline void check_request(const struct script *s, const char *head) {
    const struct step *step = &s->step[s->done];
    for (size_t i = 0; i < 4 && step->wanted[i]; i++) {
        bool absent = step->wanted[i][0] == '!';
        bool found = strcasestr(head, step->wanted[i] + absent) != NULL;
        CHECK_THAT(found != absent, "step %zu: \"%s\" in:\n%s", s->done, step->wanted[i], head);
    }
    const char *digest = strstr(head, "X-Content-SHA256: ");
    CHECK(!digest || strncmp(digest + 18, s->body_sha256, 64) == 0);
}

static inline void *serve(void *user) {
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

static inline void script_start(struct script *s) {
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
static inline void script_end(struct script *s, const char *name) {
    struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)s->port), .sin_addr = {htonl(INADDR_LOOPBACK)}};
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

static inline void read_text(const char *path, char *text, size_t size) {
    struct buf b;
    buf_init(&b, size - 1);
    file_read(path, &b, NULL);
    snprintf(text, size, "%s", buf_text(&b));
    buf_release(&b);
}

/* Runs `unbake WORDS --server ...` through the shell; its exit status. */
static inline int client(const struct script *s, const char *format, ...) {
    char words[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(words, sizeof words, format, args);
    va_end(args);
    const char *build = getenv("UNBAKE_BUILD");
    char *command = mem_printf("%s/unbake %s --server http://127.0.0.1:%d/ >%s/out 2>%s/err", build ? build : "build",
                               words, s->port, root, root);
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

#define CHECK_EXIT(found, wanted)                                                                                      \
    do {                                                                                                               \
        int check_code = (found);                                                                                      \
        CHECK_THAT(check_code == (wanted), "exit %d\nout: %s\nerr: %s", check_code, out_text, err_text);               \
    } while (0)
#define CHECK_PART(text, part) CHECK_THAT(strstr(text, part) != NULL, "\"%s\" is not in: %s", part, text)

/* A file below root/got. */
static inline void put_part(const char *name, const char *text) {
    char *path = mem_printf("%s/got/%s", root, name), *parent = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    CHECK(file_make_dirs(parent, NULL) == STATUS_OK);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(parent);
    mem_free(path);
}

#endif
