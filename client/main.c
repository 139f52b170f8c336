/* main.c -- `unbake`, the command-line client: finds the command and gives it what it needs. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "client/commands.h"
#include "client/credentials.h"
#include "client/servers.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "common/protocol.h"

/* SIGINT and SIGTERM are read from a descriptor, where request.c waits for them: no handler runs
 * in the middle of anything. One that the caller ignores (nohup, a background job of a script)
 * stays ignored. */
static int block_signals(void) {
    static const int numbers[] = {SIGINT, SIGTERM};
    sigset_t set;
    sigemptyset(&set);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction action;
        if (sigaction(numbers[i], NULL, &action) == 0 && action.sa_handler != SIG_IGN)
            sigaddset(&set, numbers[i]);
    }
    sigprocmask(SIG_BLOCK, &set, NULL);
    return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

static int unknown_command(struct client *c, const char *name) {
    struct error err;
    struct nearest nearest;
    size_t count;
    const struct command *table = command_table(&count);
    nearest_init(&nearest, name);
    for (size_t i = 0; i < count; i++)
        nearest_offer(&nearest, table[i].name);
    error_set(&err, STATUS_INPUT, "unknown command \"%.100s\"", name);
    if (nearest.best)
        error_hint(&err, "did you mean \"%s\"?", nearest.best);
    else
        error_hint(&err, "`unbake --help` lists the commands");
    return client_fail(c, NULL, &err);
}

/* Shared options may precede the command (`unbake --json list`): they are moved behind its name. */
static void put_command_first(int argc, char **argv) {
    int at = 1;
    while (at < argc && options_length(argv[at], command_shared_options) > 0)
        at += options_length(argv[at], command_shared_options);
    if (at == 1 || at >= argc)
        return;
    char *name = argv[at];
    memmove(argv + 2, argv + 1, (size_t)(at - 1) * sizeof *argv);
    argv[1] = name;
}

static int check_words(struct client *c, const struct command *command, const char *const *words, size_t count) {
    struct error err;
    if (count >= command->words_min && count <= command->words_max)
        return CLIENT_OK;
    if (count < command->words_min)
        error_set(&err, STATUS_INPUT, "missing argument %.*s", (int)strcspn(command->arguments, ". "),
                  command->arguments);
    else
        error_set(&err, STATUS_INPUT, "unexpected argument \"%.100s\"", words[command->words_max]);
    error_hint(&err, "`unbake %s --help` has an example", command->name);
    return client_fail(c, NULL, &err);
}

/* Sets the request's token for its server, and the certificates to trust. `entry`: the server's in the configuration,
 * if it has a name there. */
static int present_token(struct client *c, const struct options *o, const struct server_entry *entry) {
    struct error err;
    const char *given = getenv("UNBAKE_TOKEN"), *ca = getenv("UNBAKE_CA");
    char *kept = NULL;
    for (const char *at = given; at && *at; at++)
        if (*at <= ' ' || *at > '~') {
            error_set(&err, STATUS_INPUT,
                      "UNBAKE_TOKEN is not a token: it contains blanks or other characters that no token has");
            return client_fail(c, NULL, &err);
        }
    ca = options_text(o, "ca", ca && *ca ? ca : entry ? entry->ca : NULL);
    if (ca)
        request_set_ca(c->request, ca);
    if (!given || !*given) {
        enum status status = entry && entry->token_file ? credentials_read(entry->token_file, &kept, &err)
                                                        : credentials_find(request_server(c->request), &kept, &err);
        if (status != STATUS_OK)
            return client_fail(c, NULL, &err);
    }
    request_set_token(c->request, kept ? kept : given && *given ? given : NULL);
    mem_free(kept);
    return CLIENT_OK;
}

static const struct request_advice advice = {
    .url = "an example: --server " PROTOCOL_DEFAULT_SERVER,
    .ca = "--ca FILE names the certificates to trust",
    .any = "is unbaked running there? --server URL or UNBAKE_SERVER names another",
};

static int run_at(struct client *c, const struct command *command, const struct options *o, const char *url,
                  const struct server_entry *entry) {
    int signal_fd = block_signals();
    c->request = request_new(url, c->retry_sec >= 0.0 ? c->retry_sec : CLIENT_RETRY_SEC, signal_fd);
    request_set_advice(c->request, &advice);
    int code = present_token(c, o, entry);
    if (code == CLIENT_OK)
        code = command->run(c, o);
    request_free(c->request);
    if (signal_fd >= 0)
        close(signal_fd);
    return code;
}

static int run(struct client *c, const struct command *command, const struct options *o) {
    struct servers servers;
    struct error err;
    const char *url;
    const struct server_entry *entry;
    c->retry_sec = options_seconds(o, "retry", -1.0);
    if (command_is_local(command))
        return command->run(c, o);
    enum status status = servers_read(&servers, &err);
    if (status == STATUS_OK)
        status = servers_find(&servers, servers_word(o), &url, &entry, &err);
    int code = status == STATUS_OK ? run_at(c, command, o, url, entry) : client_fail(c, NULL, &err);
    servers_release(&servers);
    return code;
}

/* Finds the command, checks its words and runs it; returns the exit status. */
static int dispatch(struct client *c, int argc, char **argv) {
    struct options o;
    struct error err;
    put_command_first(argc, argv);
    c->format = format_guess(argc, argv);
    c->json = c->format != FORMAT_TEXT;
    const char *name = argc > 1 ? argv[1] : "";
    bool help = strcmp(name, "help") == 0;
    if (help && argc > 2) {
        name = argv[2];
    } else if (help || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        command_help(NULL, stdout);
        return CLIENT_OK;
    }
    if (argc < 2) {
        command_help(NULL, stderr);
        return CLIENT_USAGE;
    }
    if (strcmp(name, "--version") == 0)
        name = "version";
    const struct command *command = command_find(name);
    if (!command)
        return unknown_command(c, name);
    if (help) {
        command_help(command, stdout);
        return CLIENT_OK;
    }
    int code = CLIENT_OK;
    enum status status = options_parse(&o, argc - 2, argv + 2, command->options, command_shared_options, &err);
    if (status == STATUS_OK)
        status = format_read(&o, &c->format, &err);
    if (status == STATUS_OK)
        c->json = c->format != FORMAT_TEXT;
    c->quiet = options_flag(&o, "quiet");
    if (options_flag(&o, "help"))
        command_help(command, stdout);
    else if (status != STATUS_OK)
        code = client_fail(c, NULL, &err);
    else if ((code = check_words(c, command, o.word, o.word_count)) == CLIENT_OK)
        code = run(c, command, &o);
    options_release(&o);
    return code;
}

int main(int argc, char **argv) {
    struct client c = {0};
    struct error err;
    terminal_init(&c.out, stdout);
    terminal_init(&c.err, stderr);
    int code = dispatch(&c, argc, argv);
    /* A full disk or a closed pipe must not look like success; an earlier flush may have failed too. */
    if ((fflush(stdout) != 0 || ferror(stdout)) && code == CLIENT_OK) {
        error_set(&err, STATUS_IO, "cannot write all to standard output");
        code = client_fail(&c, NULL, &err);
    }
    return code;
}
