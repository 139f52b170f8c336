/* main.c -- the daemon's entry: flags, configuration, wiring, signals.
 *
 *   lock the data folder ──> store ──> scheduler ──> api ──> listener ──> scheduler_run
 *
 * and back in the same order when SIGTERM or SIGINT comes: nothing new is accepted, running jobs
 * write checkpoints and go back to the queue, streams end, the database is closed. SIGHUP does
 * nothing: the configuration changes by a restart, never by surprise. */
#include <archive.h>
#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/config.h"
#include "server/demo/generate.h"
#include "server/evaluate/evaluate.h"
#include "server/http/api.h"
#include "server/http/listener.h"
#include "server/job/scheduler.h"
#include "server/render/accel.h"
#include "server/store/store.h"
#include "server/worker/worker.h"

#define EXIT_USAGE 2

/* What `unbaked NAME ...` runs instead of the daemon. argv[0] is the name. */
static const struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *help;
} commands[] = {
    {"demo-room", demo_command, "DIR: make a room whose materials and lights are known"},
    {"evaluate", evaluate_command, "ROOM OUTPUTS: compare a job's outputs with a known room"},
    {"worker", worker_main, "DIR: one attempt of a job; the daemon runs it"},
};
#define COMMAND_COUNT (sizeof commands / sizeof *commands)

#define LIBRARY_COUNT 5

static void libraries(struct api_library list[LIBRARY_COUNT]) {
    const char *embree = accel_library_version();
    const char *archive = archive_version_string();
    list[0] = (struct api_library){"libmicrohttpd", listener_library_version()};
    list[1] = (struct api_library){"sqlite", store_library_version()};
    list[2] = (struct api_library){"embree", strncmp(embree, "Embree ", 7) == 0 ? embree + 7 : embree};
    list[3] = (struct api_library){"libarchive", strncmp(archive, "libarchive ", 11) == 0 ? archive + 11 : archive};
    list[4] = (struct api_library){"cjson", cJSON_Version()};
}

static void print_version(void) {
    struct api_library list[LIBRARY_COUNT];
    libraries(list);
    printf("unbaked %s\n", UNBAKE_VERSION);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        printf("%s %s\n", list[i].name, list[i].version);
}

static void print_help(void) {
    printf("unbaked takes scenes over HTTP and reconstructs their materials and lighting.\n\n"
           "usage: unbaked [--config FILE] [--data DIR] [--listen ADDRESS:PORT] [--set NAME=VALUE]...\n\n"
           "  --config FILE      read options from FILE (config/unbaked.conf documents them)\n"
           "  --data DIR         the same as --set data_dir=DIR\n"
           "  --listen ADDR:PORT the same as --set listen=ADDR:PORT; port 0 takes a free one\n"
           "  --set NAME=VALUE   an option; wins over the file\n"
           "  --port-file FILE   write the port to FILE once connections are accepted\n"
           "  --check-config     say what is wrong with the configuration, and do no more\n"
           "  --version          versions of the daemon and of its libraries\n"
           "  --help             this\n\ncommands:\n");
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        printf("  unbaked %s %s\n", commands[i].name, commands[i].help);
    printf("\noptions for --set:\n");
    size_t count;
    const struct option *table = config_table(&count);
    for (size_t i = 0; i < count; i++)
        printf("  %-24s %s [%s%s%s]\n", table[i].name, table[i].help, table[i].default_text,
               *table[i].unit ? " " : "", table[i].unit);
    printf("\nexample: unbaked --data ~/unbaked --set max_running=2\n"
           "exit status: 0 stopped when asked to, 1 failed, %d bad usage or configuration\n", EXIT_USAGE);
}

/* --- the command line -------------------------------------------------------------------- */

struct invocation {
    struct config config;
    const char *port_file; /* NULL: none */
    bool only_check;
};

static const struct flag {
    const char *name;
    bool has_value;
} flags[] = {{"--config", true},     {"--data", true},          {"--listen", true},   {"--set", true},
             {"--port-file", true},  {"--check-config", false}, {"--version", false}, {"--help", false}};

/* Finds argv[*i] among the flags and its value, after '=' or as the next argument; NULL, with the
 * problem told, when it is none. */
static const struct flag *next_flag(int argc, char **argv, int *i, const char **value) {
    const char *text = argv[(*i)++];
    size_t length = strcspn(text, "=");
    for (size_t k = 0; k < sizeof flags / sizeof *flags; k++) {
        if (strlen(flags[k].name) != length || strncmp(text, flags[k].name, length) != 0)
            continue;
        bool is_inside = text[length] == '=';
        *value = is_inside ? text + length + 1 : NULL;
        if (flags[k].has_value && !is_inside)
            *value = *i < argc ? argv[(*i)++] : NULL;
        if (flags[k].has_value == (*value != NULL))
            return &flags[k];
        fprintf(stderr, "unbaked: %s %s\n", flags[k].name,
                flags[k].has_value ? "needs a value" : "takes no value");
        return NULL;
    }
    fprintf(stderr, "unbaked: what is \"%s\"? unbaked --help lists what there is\n", text);
    return NULL;
}

/* Applies one flag that sets an option. */
static void apply_flag(struct config *c, const char *flag, const char *value, struct buf *problems) {
    if (strcmp(flag, "--data") == 0)
        config_set(c, "data_dir", value, flag, problems);
    if (strcmp(flag, "--listen") == 0)
        config_set(c, "listen", value, flag, problems);
    const char *equals = strchr(value, '=');
    if (strcmp(flag, "--set") != 0)
        return;
    if (!equals) {
        buf_printf(problems, "--set: \"%s\" is not of the form NAME=VALUE\n", value);
        return;
    }
    char *name = mem_strndup(value, (size_t)(equals - value));
    config_set(c, name, equals + 1, flag, problems);
    mem_free(name);
}

/* Goes over the flags: once for the files and words among them, then, over what the file said,
 * for the options (`options` true). -1 to go on, or the exit status. */
static int read_flags(int argc, char **argv, struct invocation *in, bool options, struct buf *problems) {
    for (int i = 1; i < argc;) {
        const char *value;
        const struct flag *flag = next_flag(argc, argv, &i, &value);
        if (!flag)
            return EXIT_USAGE;
        if (options) {
            apply_flag(&in->config, flag->name, value ? value : "", problems);
        } else if (strcmp(flag->name, "--config") == 0) {
            struct error err;
            if (config_read(&in->config, value, problems, &err) != STATUS_OK)
                buf_printf(problems, "%s\n", err.message);
        } else if (strcmp(flag->name, "--port-file") == 0) {
            in->port_file = value;
        } else if (strcmp(flag->name, "--check-config") == 0) {
            in->only_check = true;
        } else if (strcmp(flag->name, "--version") == 0) {
            print_version();
            return EXIT_SUCCESS;
        } else if (strcmp(flag->name, "--help") == 0) {
            print_help();
            return EXIT_SUCCESS;
        }
    }
    return -1;
}

/* Fills in->config from the defaults, the file and the flags. -1 to go on, or the exit status. */
static int read_invocation(int argc, char **argv, struct invocation *in) {
    struct buf problems;
    buf_init(&problems, (size_t)1 << 20);
    config_init(&in->config);
    int code = read_flags(argc, argv, in, false, &problems);
    if (code < 0)
        code = read_flags(argc, argv, in, true, &problems);
    if (code < 0)
        config_check(&in->config, &problems);
    if (problems.length > 0)
        fputs(buf_text(&problems), stderr);
    if (code < 0 && problems.length > 0)
        code = EXIT_USAGE;
    else if (code < 0 && in->only_check)
        code = EXIT_SUCCESS;
    buf_release(&problems);
    return code;
}

/* --- the daemon -------------------------------------------------------------------------- */

/* Takes the data folder for this process alone; *fd holds the lock while it is open. */
static enum status lock_folder(const char *dir, int *fd, struct error *err) {
    *fd = -1;
    if (file_make_dirs(dir, err) != STATUS_OK)
        return error_hint(err, "--data DIR takes another data folder");
    char *path = file_join(dir, "lock");
    char holder[32] = "";
    enum status status = STATUS_OK;
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0640);
    if (*fd < 0) {
        status = error_set_errno(err, errno, "cannot open %s", path);
    } else if (flock(*fd, LOCK_EX | LOCK_NB) != 0) {
        ssize_t got = errno == EWOULDBLOCK ? pread(*fd, holder, sizeof holder - 1, 0) : -1;
        holder[got > 0 ? strcspn(holder, "\n") : 0] = '\0';
        if (got >= 0)
            status = error_set(err, STATUS_CONFLICT, "the data folder %s already has a daemon (process %s)",
                               dir, *holder ? holder : "unknown");
        else
            status = error_set_errno(err, errno, "cannot lock %s", path);
    } else {
        int length = snprintf(holder, sizeof holder, "%ld\n", (long)getpid());
        if (ftruncate(*fd, 0) != 0 || pwrite(*fd, holder, (size_t)length, 0) != length)
            status = error_set_errno(err, errno, "cannot write %s", path);
    }
    mem_free(path);
    return status;
}

struct daemon {
    struct config *config;
    int lock_fd;
    struct store *store;
    struct scheduler *scheduler;
    struct api *api;
    struct listener *listener;
    struct api_library libraries[LIBRARY_COUNT];
};

static enum status build(struct daemon *d, struct error *err) {
    const struct config *c = d->config;
    libraries(d->libraries);
    struct scheduler_config work = {
        .data_dir = c->data_dir,
        .worker_binary = "/proc/self/exe",
        .max_running = (int)c->max_running,
        .user_max_running = (int)c->user_max_running,
        .thread_count = (int)c->threads,
        .worker_memory_bytes = (uint64_t)c->worker_memory_mib << 20,
        .checkpoint_interval_sec = c->checkpoint_interval_sec,
        .stop_grace_sec = c->stop_grace_sec,
        .checkpoint_keep_sec = 3600.0 * c->checkpoint_keep_hours,
        .sandbox = c->sandbox,
    };
    struct api_config limits = {
        .data_dir = c->data_dir,
        .max_attempts = (int)c->max_attempts,
        .queue_limit = (size_t)c->queue_limit,
        .user_queue_limit = (size_t)c->user_queue_limit,
        .user_max_bytes = (uint64_t)c->user_max_mib << 20,
        .max_upload_bytes = (uint64_t)c->max_upload_mib << 20,
        .min_free_bytes = (uint64_t)c->min_free_mib << 20,
        .max_streams = (size_t)c->max_streams,
        .upload_keep_ms = (int64_t)(c->upload_keep_hours * 3.6e6),
        .keepalive_sec = c->keepalive_sec,
        .server_names = c->server_names,
        .libraries = d->libraries,
        .library_count = LIBRARY_COUNT,
    };
    struct listener_config network = {
        .connection_max = (unsigned)c->max_connections,
        .limits = {c->head_timeout_sec, c->idle_timeout_sec, c->idle_timeout_sec,
                   (double)c->body_min_bytes_per_sec},
    };
    char address[CONFIG_ADDRESS_SIZE];
    network.address = address;
    enum status status = config_address(c->listen, address, &network.port, err);
    if (status == STATUS_OK)
        status = store_open(&d->store, c->data_dir, err);
    if (status == STATUS_OK)
        status = scheduler_new(&d->scheduler, &work, d->store, err);
    if (status == STATUS_OK)
        status = api_new(&d->api, &limits, d->store, d->scheduler, err);
    if (status == STATUS_OK)
        status = listener_start(&d->listener, &network, d->api, err);
    return status;
}

static void *wait_for_signal(void *user) {
    struct daemon *d = user;
    sigset_t asked;
    int number = 0;
    sigemptyset(&asked);
    sigaddset(&asked, SIGTERM);
    sigaddset(&asked, SIGINT);
    sigwait(&asked, &number);
    log_info("%s: stopping", number == SIGINT ? "SIGINT" : "SIGTERM");
    listener_quiesce(d->listener);
    scheduler_stop(d->scheduler);
    return NULL;
}

/* Every connection needs a descriptor, and so does every file that is served. */
static void raise_descriptor_limit(void) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        return;
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
}

/* SIGTERM and SIGINT go to one thread that waits for them; all others inherit the block. */
static void prepare_signals(void) {
    sigset_t asked;
    sigemptyset(&asked);
    sigaddset(&asked, SIGTERM);
    sigaddset(&asked, SIGINT);
    pthread_sigmask(SIG_BLOCK, &asked, NULL);
    signal(SIGHUP, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
}

static void log_start(const struct daemon *d) {
    struct api_library list[LIBRARY_COUNT];
    struct buf text;
    libraries(list);
    buf_init(&text, 4096);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        buf_printf(&text, "%s%s %s", i ? ", " : "", list[i].name, list[i].version);
    log_info("unbaked %s (%s)", UNBAKE_VERSION, buf_text(&text));
    log_info("data folder %s", d->config->data_dir);
    buf_release(&text);
}

/* Says where it listens: in the log, on stdout and, where asked for, in a file. */
static enum status announce(const struct daemon *d, const char *port_file, struct error *err) {
    char text[16];
    char address[CONFIG_ADDRESS_SIZE];
    uint16_t port = 0;
    enum status status = config_address(d->config->listen, address, &port, err);
    if (status != STATUS_OK)
        return status;
    port = listener_port(d->listener);
    bool is_v6 = strchr(address, ':') != NULL;
    printf("http://%s%s%s:%u\n", is_v6 ? "[" : "", address, is_v6 ? "]" : "", port);
    fflush(stdout);
    log_info("listening on %s port %u", address, port);
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
    status = scheduler_run(d->scheduler, err);
    /* Where it ended by itself, the thread still waits. */
    pthread_kill(waiter, SIGTERM);
    pthread_join(waiter, NULL);
    return status;
}

static int run_daemon(struct invocation *in) {
    struct daemon d = {.config = &in->config, .lock_fd = -1};
    struct error err;
    enum log_level level = LOG_INFO;
    log_level_parse(in->config.log_level, &level);
    log_set_level(level);
    raise_descriptor_limit();
    prepare_signals();
    log_start(&d);
    enum status status = lock_folder(in->config.data_dir, &d.lock_fd, &err);
    if (status == STATUS_OK)
        status = build(&d, &err);
    if (status == STATUS_OK)
        status = serve(&d, in->port_file, &err);
    listener_stop(d.listener);
    api_free(d.api);
    scheduler_free(d.scheduler);
    store_close(d.store);
    if (d.lock_fd >= 0)
        close(d.lock_fd);
    if (status == STATUS_OK)
        log_info("stopped");
    else
        log_error("%s%s%s", err.message, *err.hint ? "; " : "", err.hint);
    return status == STATUS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argc, char **argv) {
    for (size_t i = 0; argc > 1 && i < COMMAND_COUNT; i++)
        if (strcmp(argv[1], commands[i].name) == 0)
            return commands[i].run(argc - 1, argv + 1);
    struct invocation in = {.port_file = NULL};
    int code = read_invocation(argc, argv, &in);
    if (code < 0)
        code = run_daemon(&in);
    config_release(&in.config);
    return code;
}
