/* node_command.c -- see node_command.h: the command line, and the attempt from its claim to its end. */
#include "server/node/node_command.h"

#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/job/process.h"
#include "server/node/fetch.h"
#include "server/node/relay.h"
#include "server/node/work_folder.h"
#include "server/worker/progress.h"

#define TOKEN_VARIABLE "UNBAKE_NODE_TOKEN"
#define TOKEN_MAX 4096      /* bytes of the file */
#define CACHE_GB_DEFAULT 50 /* some hundred rooms */
#define WORDS_MAX_BYTES 400 /* of the last that the worker printed, as at home */

const struct command_option node_flags[] = {
    {"job", 0, OPTION_TEXT, "N", "the job's number"},
    {"attempt", 0, OPTION_TEXT, "N", "the attempt's number"},
    {"token-file", 0, OPTION_TEXT, "FILE", "the attempt's token; else the variable " TOKEN_VARIABLE},
    {"ca", 0, OPTION_TEXT, "FILE", "certificates to trust instead of the system's"},
    {"cache", 0, OPTION_TEXT, "DIR",
     "keeps scenes for later attempts; may be shared by machines (/var/tmp/unbake-scenes-UID)"},
    {"cache-gb", 0, OPTION_TEXT, "N", "how much of them; 0: no bound (50)"},
    {"work", 0, OPTION_TEXT, "DIR", "where the attempt works, on a disk of this machine ($TMPDIR, else /tmp)"},
    {"threads", 0, OPTION_TEXT, "N", "0: as many as the daemon says (0)"},
    COMMAND_HELP_FLAG,
    {0},
};

struct node {
    const char *url, *ca;
    char *token, *cache, *work;
    uint64_t job_id, cache_bytes;
    uint32_t number, threads;
    struct work_folder folder;
    struct cached_scene scene;
    struct relay relay;
};

/* --- the command line --------------------------------------------------------------------------- */

static enum status read_token(struct node *n, const char *file, struct error *err) {
    struct buf text;
    const char *given = getenv(TOKEN_VARIABLE);
    enum status status = STATUS_OK;
    buf_init(&text, TOKEN_MAX);
    if (file)
        status = file_read(file, &text, err);
    else if (given)
        buf_puts(&text, given);
    n->token = mem_strndup(buf_text(&text), strcspn(buf_text(&text), "\r\n"));
    buf_release(&text);
    if (status == STATUS_OK && !n->token[0])
        status = error_set(err, STATUS_INPUT, "the attempt's token is missing: --token-file FILE, or " TOKEN_VARIABLE);
    for (const char *at = n->token; *at && status == STATUS_OK; at++)
        if (*at <= ' ' || *at > '~')
            status = error_set(err, STATUS_INPUT, "the token contains characters that no token has");
    return status;
}

static const char *default_work(void) {
    const char *given = getenv("TMPDIR");
    return given && *given ? given : "/tmp";
}

/* -1 to go on, or the exit status. */
static int read_arguments(struct node *n, int argc, char **argv) {
    uint64_t cache_gb = CACHE_GB_DEFAULT;
    const struct number_flag numbers[] = {
        {"job", 1, 0x1p53, .large = &n->job_id},
        {"attempt", 1, INT_MAX, .count = &n->number},
        {"cache-gb", 0, 1 << 20, .large = &cache_gb},
        {"threads", 0, 1024, .count = &n->threads},
    };
    struct options a;
    struct error err;
    int code = arguments_begin(&a, argc, argv, node_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    if (n->job_id == 0 || n->number == 0) {
        fprintf(stderr, "unbaked: --job and --attempt must be given\n");
        options_release(&a);
        return EXIT_USAGE;
    }
    char *cache = mem_printf("/var/tmp/unbake-scenes-%u", (unsigned)geteuid());
    n->url = a.word[0];
    n->ca = options_text(&a, "ca", NULL);
    n->cache = mem_strdup(options_text(&a, "cache", cache));
    n->work = mem_strdup(options_text(&a, "work", default_work()));
    n->cache_bytes = cache_gb * 1000000000u;
    mem_free(cache);
    enum status status = read_token(n, options_text(&a, "token-file", NULL), &err);
    options_release(&a);
    if (status == STATUS_OK)
        return -1;
    fprintf(stderr, "unbaked: %s\n", err.message);
    return EXIT_USAGE;
}

/* --- the attempt ---------------------------------------------------------------------------------- */

static bool is_kind(const cJSON *order, const char *kind) {
    const char *word = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(order, "kind"));
    return word && strcmp(word, kind) == 0;
}

static void replace_text(cJSON *order, const char *key, const char *text) {
    cJSON_DeleteItemFromObjectCaseSensitive(order, key);
    json_add_string(order, key, text);
}

/* Makes the daemon's order one of this machine. */
static void adapt_order(const struct node *n, cJSON *order) {
    static const char *const folders[] = {"outputs", "files"};
    bool is_render = is_kind(order, "render");
    if (!is_render)
        replace_text(order, "scene", n->scene.files);
    for (size_t i = 0; i < 2 && is_render; i++) { /* as the list of a render's files names them */
        char *path = file_join(n->scene.files, folders[i]);
        if (access(path, F_OK) == 0)
            replace_text(order, folders[i], path);
        mem_free(path);
    }
    cJSON_DeleteItemFromObjectCaseSensitive(order, "parts");
    json_add_bool(order, "parts", true);
    if (n->threads > 0) {
        cJSON_DeleteItemFromObjectCaseSensitive(order, "thread_count");
        json_add_int(order, "thread_count", n->threads);
    }
}

/* What other kinds of jobs read, nodes are not sent. */
static enum status check_kind(const cJSON *order, struct error *err) {
    const char *kind;
    enum status status = json_string(order, "kind", "the order", "", &kind, err);
    return status != STATUS_OK || is_kind(order, "reconstruct") || is_kind(order, "render")
               ? status
               : error_set(err, STATUS_INPUT, "a job of kind \"%.40s\" cannot run on another machine", kind);
}

/* Fetches what the attempt needs and starts its worker. */
static enum status begin(struct node *n, cJSON *order, struct error *err) {
    struct process_executor process;
    const struct executor *executor = process_executor_init(&process, "/proc/self/exe", n->folder.path);
    char *folder = layout_attempt(NULL, (int64_t)n->job_id, (int)n->number);
    char *dir = file_join(n->folder.path, folder), *checkpoint = layout_checkpoint_folder(dir);
    char *log = layout_log(folder);
    enum status status = check_kind(order, err);
    if (status == STATUS_OK)
        status = file_make_dirs(checkpoint, err);
    if (status == STATUS_OK)
        status = fetch_scene(&n->relay, n->cache, n->cache_bytes, &n->scene, err);
    if (status == STATUS_OK)
        status = fetch_checkpoint(&n->relay, checkpoint, err);
    if (status == STATUS_OK)
        status = relay_may_begin(&n->relay, err);
    if (status == STATUS_OK) {
        adapt_order(n, order);
        const struct run_work work = {.folder = folder, .log = log, .order = order};
        status = executor->start(executor, &work, &n->relay.run, err);
    }
    mem_free(log);
    mem_free(checkpoint);
    mem_free(dir);
    mem_free(folder);
    return status;
}

/* What this node itself says of the end, as a worker would. */
static void say_no_space(struct relay *r, const struct error *why) {
    cJSON *line = cJSON_CreateObject();
    json_add_string(line, "type", "end");
    json_add_string(line, "status", status_name(STATUS_NO_SPACE));
    json_add_string(line, "message", why->message);
    json_add_string(line, "hint", why->hint);
    char *text = json_text(line);
    link_add_line(&r->link, text, strlen(text));
    mem_free(text);
    cJSON_Delete(line);
}

/* Whether the machine's scheduler has ended it. Signals to all processes of a job reach the worker, too, which may have
 * stopped before this process has seen its own. */
static bool was_taken_back(const struct relay *r, bool has_run) {
    bool has_exited = has_run && r->end.way == RUN_EXIT;
    if (has_exited && r->end.code == PROGRESS_EXIT_STOPPED && !r->has_stopped)
        return true;
    return r->is_taken_back && !(has_exited && r->end.code == PROGRESS_EXIT_OK);
}

/* How it ended; `why` where the node gave it up, with `status`. */
static struct link_end judge(struct relay *r, enum status status, const struct error *why) {
    struct link_end end = {.way = "exit", .code = r->end.code, .reason = "", .log_tail = ""};
    bool has_run = r->run && status == STATUS_OK;
    if (status == STATUS_NO_SPACE) {
        say_no_space(r, why);
        end.code = PROGRESS_EXIT_NO_SPACE;
        end.reason = why->message;
    } else if (was_taken_back(r, has_run)) {
        end.way = "preempted";
        end.reason = "its machine was taken back";
    } else if (status == STATUS_CANCELLED) {
        /* As the daemon wished, before it began or while a file could not be sent. */
        bool is_cancelled = r->link.wanted == LINK_CANCEL;
        end.way = is_cancelled ? "signal" : "exit";
        end.code = is_cancelled ? SIGKILL : PROGRESS_EXIT_STOPPED;
    } else if (status != STATUS_OK) {
        end.way = status == STATUS_INPUT ? "refused" : "lost";
        end.reason = why->message;
    } else {
        static const char *const ways[] = {[RUN_EXIT] = "exit",
                                           [RUN_SIGNAL] = "signal",
                                           [RUN_MEMORY] = "memory",
                                           [RUN_LOST] = "lost",
                                           [RUN_REFUSED] = "refused"};
        end.way = ways[r->end.way];
        end.reason = r->end.reason;
    }
    return end;
}

/* The exit status of this process, for the scheduler's books. */
static int exit_of(const struct link_end *end) {
    if (strcmp(end->way, "preempted") == 0)
        return PROGRESS_EXIT_STOPPED;
    if (strcmp(end->way, "memory") == 0)
        return PROGRESS_EXIT_MEMORY;
    return strcmp(end->way, "exit") == 0 ? end->code : EXIT_FAILURE;
}

/* Tells the daemon; returns the exit status. */
static int finish(struct node *n, enum status status, const struct error *why) {
    struct relay *r = &n->relay;
    struct error err;
    if (status != STATUS_OK)
        log_warning("job %llu: attempt %u: %s", (unsigned long long)n->job_id, n->number, why->message);
    if (link_state(&r->link) != LINK_OPEN) /* nothing more may be written */
        return EXIT_FAILURE;
    struct link_end end = judge(r, status, why);
    r->gives_up = status != STATUS_OK;
    char *words = run_log_tail(r->run, WORDS_MAX_BYTES);
    end.log_tail = words;
    relay_send_log(r);
    bool is_told = relay_flush(r) && link_end(&r->link, &end, run_cpu_sec(r->run), &err) == STATUS_OK;
    if (is_told)
        log_info("job %llu: attempt %u: %s %d; %zu parts of checkpoints, %.1f MB; %.1f MB sent in all",
                 (unsigned long long)n->job_id, n->number, end.way, end.code, r->part_count, r->part_bytes * 1e-6,
                 (double)r->link.sent_bytes * 1e-6);
    else
        log_warning("job %llu: the end of attempt %u could not be told: %s", (unsigned long long)n->job_id, n->number,
                    link_state(&r->link) == LINK_OPEN ? err.message : r->link.why);
    mem_free(words);
    return is_told ? exit_of(&end) : EXIT_FAILURE;
}

static int run(struct node *n) {
    char host[65] = "";
    struct error err;
    cJSON *order = NULL;
    const struct link_config config = {
        .url = n->url, .token = n->token, .ca = n->ca, .job_id = (int64_t)n->job_id, .number = (int)n->number};
    relay_init(&n->relay, &config);
    gethostname(host, sizeof host - 1);
    n->relay.host = host;
    enum status status = link_claim(&n->relay.link, host, (int)n->threads, &order, &err);
    int code = EXIT_FAILURE;
    if (status != STATUS_OK) {
        log_error("job %llu: attempt %u cannot be claimed: %s", (unsigned long long)n->job_id, n->number, err.message);
        if (err.hint[0])
            log_error("hint: %s", err.hint);
    } else {
        status = work_folder_make(&n->folder, n->work, &err);
        n->relay.data_dir = n->folder.path;
        if (status == STATUS_OK)
            status = begin(n, order, &err);
        if (status == STATUS_OK)
            status = relay_follow(&n->relay, &err);
        if (status == STATUS_NO_SPACE && !n->relay.link.is_full_there)
            relay_name_disk(&n->relay, &err);
        code = finish(n, status, &err);
    }
    cJSON_Delete(order);
    relay_release(&n->relay);
    cached_scene_release(&n->scene);
    work_folder_remove(&n->folder);
    return code;
}

int node_command(int argc, char **argv) {
    struct node n = {.folder = {.lock_fd = -1}, .scene = {.use_fd = -1}};
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGUSR1);
    sigprocmask(SIG_BLOCK, &set, NULL); /* at once: from now on they are heard */
    signal(SIGPIPE, SIG_IGN);
    int code = read_arguments(&n, argc, argv);
    if (code < 0)
        code = run(&n);
    mem_free(n.token);
    mem_free(n.cache);
    mem_free(n.work);
    return code;
}
