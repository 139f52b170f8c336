/* main.c -- the daemon's entry: wiring, signals. The command line is read by invocation.c.
 *
 *   lock the data folder ──> store ──> executors ──> scheduler ──> api ──> listener ──> admin ──> scheduler_run
 *
 * and back in the same order when SIGTERM or SIGINT comes: nothing new is accepted, running jobs
 * write checkpoints and go back to the queue, streams end, the database is closed. SIGHUP reads
 * the TLS certificate again; options change by a restart, never by surprise. */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/source_digest.h"
#include "server/admin/admin.h"
#include "server/commands.h"
#include "server/daemon_options.h"
#include "server/data/attempt_folder.h"
#include "server/data/collector.h"
#include "server/data/folder.h"
#include "server/events/hub.h"
#include "server/http/service.h"
#include "server/job/process.h"
#include "server/job/scheduler.h"
#include "server/libraries.h"
#include "server/net/address.h"
#include "server/notify.h"
#include "server/store/store.h"
#include "server/transport/listener.h"

static void print_version(void) {
    struct library list[LIBRARY_COUNT];
    libraries_list(list);
    printf("unbaked %s\n", source_version);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        printf("%s %s\n", list[i].name, list[i].version);
}

const struct command_option daemon_flags[] = {
    INVOCATION_FLAGS,
    {"listen", 0, OPTION_TEXT, "ADDRESS:PORT", "the same as --set listen=ADDRESS:PORT; port 0 takes a free one"},
    {"port-file", 0, OPTION_TEXT, "FILE", "write the port to FILE once connections are accepted"},
    {"check-config", 0, OPTION_FLAG, NULL, "say what is wrong with the configuration, and do no more"},
    {"version", 0, OPTION_FLAG, NULL, "versions of the daemon and of its libraries"},
    {"help", 0, OPTION_FLAG, NULL, "print this help"},
    {0},
};

/* --- the daemon -------------------------------------------------------------------------- */

struct daemon {
    struct config *config;
    int lock_fd;
    struct store *store;
    struct process_executor executor;
    struct sites sites;
    struct scheduler *scheduler;
    struct api *api;
    struct listener *listener;
    struct admin *admin;
    struct collector *collector;
    char address[CONFIG_ADDRESS_SIZE]; /* the address it listens on */
    unsigned long watched_rounds;      /* the scheduler's rounds when the watchdog was last fed */
    struct library libraries[LIBRARY_COUNT];
    struct api_library library_names[LIBRARY_COUNT]; /* the same, for the API */
    struct proxies proxies;
};

/* An address that others can reach requires tokens. */
static enum status check_access(const struct daemon *d, bool is_loopback, struct error *err) {
    const struct config *c = d->config;
    if (is_loopback)
        return STATUS_OK;
    if (strcmp(c->access, "open") == 0) {
        error_set(err, STATUS_INPUT,
                  "access = open is for loopback addresses, and listen is \"%s\": anybody who "
                  "reaches the daemon could use it",
                  c->listen);
        return error_hint(err, "access = auto, with a token for each user (`unbaked token add NAME`)");
    }
    if (strcmp(c->access, "auto") == 0 && !store_has_users(d->store)) {
        error_set(err, STATUS_INPUT,
                  "listen is \"%s\", which is not a loopback address, and there are no "
                  "tokens: anybody who reaches the daemon could use it",
                  c->listen);
        return error_hint(err, "`unbaked token add NAME --role admin` makes one");
    }
    if (!*c->tls_certificate)
        log_warning("without tls_certificate, tokens and scenes cross the network unencrypted");
    return STATUS_OK;
}

static void on_revoked(void *user) {
    struct daemon *d = user;
    hub_recheck(d->api->hub);
}

static void wake_scheduler(void *user) {
    struct daemon *d = user;
    scheduler_wake(d->scheduler);
}

/* What executes jobs; checks of scenes and webhooks stay on this machine. */
static enum status build_scheduler(struct daemon *d, struct error *err) {
    const struct config *c = d->config;
    struct buf none;
    const struct executor *process = process_executor_init(&d->executor, "/proc/self/exe", c->data_dir);
    buf_init(&none, 4096);
    sites_read(&d->sites, c->executors, c->executors_dir, &none); /* was checked with the rest */
    buf_release(&none);
    enum status status = sites_start(&d->sites, process, d->store, c->data_dir, wake_scheduler, d, err);
    if (status != STATUS_OK)
        return status;
    const struct scheduler_config work = daemon_options_scheduler(c, process, &d->sites);
    return scheduler_new(&d->scheduler, &work, d->store, err);
}

static enum status build(struct daemon *d, struct error *err) {
    const struct config *c = d->config;
    bool is_loopback;
    libraries_list(d->libraries);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        d->library_names[i] = (struct api_library){d->libraries[i].name, d->libraries[i].version};
    proxies_parse(&d->proxies, c->trusted_proxies, c->proxy_field, NULL); /* was checked with the rest */
    const struct api_config limits = daemon_options_api(c, &d->proxies, &d->sites, d->library_names);
    const struct listener_config network = daemon_options_listener(c, d->address, &is_loopback);
    enum status status = store_open(&d->store, c->data_dir, err);
    if (status == STATUS_OK)
        status = attempt_folder_adopt(c->data_dir, d->store, err);
    if (status == STATUS_OK)
        store_keep_events(d->store, (size_t)c->events_per_job);
    if (status == STATUS_OK)
        status = check_access(d, is_loopback, err);
    if (status == STATUS_OK)
        status = build_scheduler(d, err);
    if (status == STATUS_OK)
        status = service_new(&d->api, &limits, d->store, d->scheduler, err);
    if (status == STATUS_OK)
        status = service_listen(&d->listener, &network, d->api, err);
    if (status == STATUS_OK)
        status = admin_start(&d->admin, c->data_dir, d->store, on_revoked, d, err);
    if (status == STATUS_OK)
        status = collector_start(&d->collector, &d->api->collector_config, c->collect_interval_sec, err);
    return status;
}

/* Feeds systemd's watchdog if the scheduler has made progress and the store responds. */
static void feed_watchdog(struct daemon *d) {
    unsigned long rounds = scheduler_rounds(d->scheduler);
    store_token_is_valid(d->store, 0); /* blocks if the store hangs */
    if (rounds != d->watched_rounds)
        notify("WATCHDOG=1");
    d->watched_rounds = rounds;
    scheduler_wake(d->scheduler);
}

/* Waits for a signal in `asked`, feeding the watchdog meanwhile. */
static int next_signal(struct daemon *d, const sigset_t *asked) {
    double pause_sec = notify_watchdog_sec() / 3;
    struct timespec pause = {.tv_sec = (time_t)pause_sec, .tv_nsec = (long)(1e9 * (pause_sec - floor(pause_sec)))};
    for (;;) {
        int number = pause_sec > 0 ? sigtimedwait(asked, NULL, &pause) : sigwaitinfo(asked, NULL);
        if (number > 0)
            return number;
        if (errno == EAGAIN)
            feed_watchdog(d);
    }
}

static void reload(struct daemon *d) {
    struct error err;
    if (listener_reload(d->listener, &err) == STATUS_OK)
        log_info("SIGHUP: the TLS certificate was read again; options change by a restart only");
    else
        log_error("SIGHUP: %s; the old certificate stays in use", err.message);
}

static sigset_t handled_signals(void) {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP);
    return set;
}

static void *wait_for_signal(void *user) {
    struct daemon *d = user;
    sigset_t asked = handled_signals();
    int number;
    while ((number = next_signal(d, &asked)) == SIGHUP)
        reload(d);
    log_info("%s: stopping", number == SIGINT ? "SIGINT" : "SIGTERM");
    notify("STOPPING=1");
    listener_quiesce(d->listener);
    scheduler_stop(d->scheduler);
    return NULL;
}

/* Every connection needs a descriptor, and so does every file that is sent. */
static void raise_descriptor_limit(void) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        return;
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
}

/* SIGTERM, SIGINT and SIGHUP go to one thread that waits for them; all others inherit the mask. */
static void prepare_signals(void) {
    sigset_t asked = handled_signals();
    pthread_sigmask(SIG_BLOCK, &asked, NULL);
    signal(SIGPIPE, SIG_IGN);
}

static void log_start(const struct daemon *d) {
    char *text = libraries_text();
    log_info("unbaked %s, %s", source_version, text);
    log_info("data folder %s", d->config->data_dir);
    mem_free(text);
}

/* Announces the address in the log, on stdout and, if requested, in a file. */
static enum status announce(const struct daemon *d, const char *port_file, struct error *err) {
    char text[16];
    uint16_t port = listener_port(d->listener);
    bool is_v6 = strchr(d->address, ':') != NULL;
    printf("http%s://%s%s%s:%u\n", *d->config->tls_certificate ? "s" : "", is_v6 ? "[" : "", d->address,
           is_v6 ? "]" : "", port);
    fflush(stdout);
    log_info("listening on %s port %u", d->address, port);
    int length = snprintf(text, sizeof text, "%u\n", port);
    return port_file ? file_replace(port_file, text, (size_t)length, err) : STATUS_OK;
}

static enum status serve(struct daemon *d, const char *port_file, struct error *err) {
    pthread_t waiter;
    enum status status = announce(d, port_file, err);
    if (status != STATUS_OK)
        return status;
    int failed = pthread_create(&waiter, NULL, wait_for_signal, d);
    if (failed)
        return error_set_errno(err, failed, "cannot start the thread that waits for signals");
    notify("READY=1");
    status = scheduler_run(d->scheduler, err);
    /* the loop ended by itself: wake the waiting thread */
    pthread_kill(waiter, SIGTERM);
    pthread_join(waiter, NULL);
    return status;
}

static int run_daemon(struct config *config, const char *port_file) {
    struct daemon d = {.config = config, .lock_fd = -1};
    struct error err;
    enum log_level level = LOG_INFO;
    enum log_format format = LOG_TEXT;
    log_level_parse(config->log_level, &level);
    log_set_level(level);
    log_format_parse(config->log_format, &format);
    log_set_format(format);
    raise_descriptor_limit();
    prepare_signals();
    log_start(&d);
    enum status status = folder_lock(config->data_dir, &d.lock_fd, &err);
    if (status == STATUS_OK)
        folder_close_to_others(config->data_dir);
    if (status == STATUS_OK)
        status = build(&d, &err);
    if (status == STATUS_OK)
        status = serve(&d, port_file, &err);
    admin_stop(d.admin);
    listener_stop(d.listener);
    collector_stop(d.collector);
    service_free(d.api);
    scheduler_free(d.scheduler);
    sites_release(&d.sites);
    store_close(d.store);
    if (d.lock_fd >= 0)
        close(d.lock_fd);
    if (status == STATUS_OK)
        log_info("stopped");
    else
        log_error("%s%s%s", err.message, *err.hint ? "; " : "", err.hint);
    return status == STATUS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}

int daemon_command(int argc, char **argv) {
    struct invocation in;
    int code = invocation_read(&in, argc, argv, daemon_flags, NULL);
    if (code < 0 && in.arguments.word_count > 0) {
        if (commands_find(in.arguments.word[0]))
            fprintf(stderr, "unbaked: the command comes before its options: unbaked %s ...\n", in.arguments.word[0]);
        else
            fprintf(stderr, "unbaked: unknown command \"%s\"; unbaked --help lists the commands\n",
                    in.arguments.word[0]);
        code = EXIT_USAGE;
    } else if (code < 0 && invocation_has(&in, "help")) {
        code = COMMAND_HELP;
    } else if (code < 0 && invocation_has(&in, "version")) {
        print_version();
        code = EXIT_SUCCESS;
    } else if (code < 0 && invocation_has(&in, "check-config")) {
        code = EXIT_SUCCESS;
    }
    if (code < 0)
        code = run_daemon(&in.config, invocation_value(&in, "port-file", NULL));
    invocation_release(&in);
    return code;
}

int main(int argc, char **argv) {
    const struct server_command *command = argc > 1 ? commands_find(argv[1]) : NULL;
    int words = command ? 1 : 0; /* words that name the command */
    if (!command)
        command = commands_table(&(size_t){0});
    int code = command->run(argc - words, argv + words);
    if (code != COMMAND_HELP && code != COMMAND_MISUSED)
        return code;
    commands_help(command, code == COMMAND_HELP ? stdout : stderr);
    return code == COMMAND_HELP ? EXIT_SUCCESS : EXIT_USAGE;
}
