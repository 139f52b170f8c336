/* login.c -- `login` and `logout`: stores and removes a server's token. */
#include <poll.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "client/commands.h"
#include "client/credentials.h"
#include "common/mem.h"

#define TOKEN_MAX 256 /* bytes */

/* Waits until stdin has a line or ends; false when interrupted. */
static bool wait_for_line(struct client *c) {
    struct pollfd wait = {.fd = STDIN_FILENO, .events = POLLIN};
    while (!request_interrupted(c->request))
        if (poll(&wait, 1, 200) != 0)
            return true;
    return false;
}

/* Reads a line of stdin, from a terminal without echo. "" at its end. False when interrupted. */
static bool read_token(struct client *c, char token[TOKEN_MAX]) {
    struct termios old, silent;
    bool is_terminal = tcgetattr(STDIN_FILENO, &old) == 0;
    if (is_terminal) {
        fputs("token: ", stderr);
        silent = old;
        silent.c_lflag &= ~(tcflag_t)ECHO;
        tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
    }
    /* Signals only end the wait (main.c blocks them), so the terminal is always restored. */
    bool waited = wait_for_line(c), got = waited && fgets(token, TOKEN_MAX, stdin) != NULL;
    if (is_terminal) {
        tcsetattr(STDIN_FILENO, TCSAFLUSH, &old);
        fputs("\n", stderr);
    }
    token[got ? strcspn(token, " \t\r\n") : 0] = '\0';
    return waited;
}

/* Asks the server whose token it is. */
static enum status check(struct client *c, const char *token, struct reply *reply, struct error *err) {
    request_set_token(c->request, token);
    enum status status = request_get(c->request, "/v1/session", reply, err);
    if (status == STATUS_OK && !*member_text(reply->json, "user")) {
        error_set(err, STATUS_INPUT, "%s rejects this token", request_server(c->request));
        return error_hint(err, "it needs no token: it is open to anybody");
    }
    return status;
}

int login_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    char token[TOKEN_MAX];
    const char *server = request_server(c->request);
    (void)o;
    if (!read_token(c, token)) {
        error_set(&err, STATUS_CANCELLED, "interrupted: no token is kept");
        return client_fail(c, NULL, &err);
    }
    if (!*token) {
        error_set(&err, STATUS_INPUT, "no token was given");
        error_hint(&err, "`unbaked token add NAME`, on the server, makes one: type or pipe it in");
        return client_fail(c, NULL, &err);
    }
    reply_init(&reply);
    int code = CLIENT_OK;
    enum status status = check(c, token, &reply, &err);
    if (status != STATUS_OK) {
        code = client_fail(c, &reply, &err);
    } else if (credentials_keep(server, token, &err) != STATUS_OK) {
        code = client_fail(c, NULL, &err);
    } else {
        if (c->json)
            client_print_json(c, reply.json);
        else if (!c->quiet)
            client_say(c, "%s at %s, role %s", member_text(reply.json, "user"), server,
                       member_text(reply.json, "role"));
        if (strncmp(server, "http://", 7) == 0 && !request_is_loopback(c->request))
            client_note(c, "%s is plain HTTP: anybody on the network path can read the token", server);
    }
    reply_release(&reply);
    return code;
}

int logout_run(struct client *c, const struct options *o) {
    struct error err;
    char *kept;
    (void)o;
    if (credentials_find(request_server(c->request), &kept, &err) != STATUS_OK)
        return client_fail(c, NULL, &err);
    if (!kept) {
        client_note(c, "no token is kept for %s", request_server(c->request));
        return CLIENT_OK;
    }
    mem_free(kept);
    if (credentials_keep(request_server(c->request), NULL, &err) != STATUS_OK)
        return client_fail(c, NULL, &err);
    client_note(c, "the token for %s was removed from this machine; it stays valid until it is revoked on the server",
                request_server(c->request));
    return CLIENT_OK;
}
