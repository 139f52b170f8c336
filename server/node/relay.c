/* relay.c -- see relay.h. */
#include "server/node/relay.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/data/layout.h"
#include "server/data/work_file.h"
#include "server/node/hash.h"
#include "server/node/scene_cache.h"

/* A batch system that cancels kills 30 s after SIGTERM (Slurm's KillWait): some of that is left to say what happened.
 * One that takes a machine back says so minutes before. */
#define STOP_SEC_TERM 20.0
#define STOP_SEC_USR1 30.0
#define LOOK_SEC 0.5     /* between looks at signals and clocks */
#define LINES_MAX 100000 /* lines that wait for a file to be sent: more are left in the worker's pipe */

static void signals_of_ours(sigset_t *set) {
    sigemptyset(set);
    sigaddset(set, SIGTERM);
    sigaddset(set, SIGINT);
    sigaddset(set, SIGUSR1);
}

static void beat(void *relay);
static bool may_begin(void *relay, struct error *err) { return relay_may_begin(relay, err) == STATUS_OK; }

void relay_init(struct relay *r, const struct link_config *config) {
    struct link_config own = *config;
    own.beat = beat;
    own.may_begin = may_begin;
    own.user = r;
    *r = (struct relay){.job_id = config->job_id, .number = config->number};
    link_init(&r->link, &own);
}

static void wait_for_end(struct relay *r);

void relay_release(struct relay *r) {
    wait_for_end(r);
    run_free(r->run);
    for (size_t i = 0; i < r->line_count; i++)
        mem_free(r->line[i]);
    mem_free(r->line);
    link_release(&r->link);
}

/* --- what comes -------------------------------------------------------------------------------- */

static void add_line(void *user, const char *line, size_t length) {
    struct relay *r = user;
    if (r->line_count == r->line_room) {
        r->line_room = r->line_room ? 2 * r->line_room : 64;
        r->line = mem_realloc_array(r->line, r->line_room, sizeof *r->line);
    }
    r->line[r->line_count++] = mem_strndup(line, length);
}

static void read_run(struct relay *r) {
    if (!r->run || r->has_ended)
        return;
    if (r->line_count < LINES_MAX)
        run_read(r->run, add_line, r);
    r->has_ended = run_ended(r->run, &r->end, add_line, r);
}

static void stop(struct relay *r) {
    if (!r->has_stopped)
        run_ask(r->run, RUN_STOP);
    r->has_stopped = true;
}

static void kill_run(struct relay *r) {
    if (!r->has_killed)
        run_ask(r->run, RUN_KILL);
    r->has_killed = true;
}

static void obey_signals(struct relay *r) {
    static const struct timespec at_once = {0, 0};
    sigset_t set;
    int number;
    signals_of_ours(&set);
    while ((number = sigtimedwait(&set, NULL, &at_once)) > 0) {
        double patience = number == SIGUSR1 ? STOP_SEC_USR1 : STOP_SEC_TERM, at = clock_sec() + patience;
        log_info("%s: the worker has %.0f s for a checkpoint", strsignal(number), patience);
        r->is_taken_back = true;
        r->kill_at = r->kill_at > 0.0 ? fmin(r->kill_at, at) : at;
        stop(r);
    }
    if (r->kill_at > 0.0 && clock_sec() >= r->kill_at)
        kill_run(r);
}

static void obey_daemon(struct relay *r) {
    enum link_request wanted = r->link.wanted;
    if (link_state(&r->link) != LINK_OPEN || wanted == LINK_CANCEL)
        kill_run(r);
    else if (wanted == LINK_STOP)
        stop(r);
    else if (wanted == LINK_PREVIEW)
        run_ask(r->run, RUN_PREVIEW);
    if (wanted == LINK_PREVIEW) /* each reply that says so asks for one */
        r->link.wanted = LINK_CONTINUE;
}

/* Reads, reports, obeys; returns soon. */
static void beat(void *relay) {
    struct relay *r = relay;
    read_run(r);
    obey_signals(r);
    link_report(&r->link, run_cpu_sec(r->run), false);
    obey_daemon(r);
}

enum status relay_may_begin(struct relay *r, struct error *err) {
    beat(r);
    if (link_state(&r->link) != LINK_OPEN)
        return error_set(err, STATUS_CANCELLED, "%s", r->link.why);
    return r->has_stopped || r->has_killed ? error_set(err, STATUS_CANCELLED, "stopped before it began") : STATUS_OK;
}

/* --- files ------------------------------------------------------------------------------------- */

static bool keep_on(void *user, struct error *err) {
    struct relay *r = user;
    beat(r);
    if (link_state(&r->link) != LINK_OPEN)
        error_set(err, STATUS_CANCELLED, "%s", r->link.why);
    return link_state(&r->link) == LINK_OPEN;
}

/* Sends the open file, if it is a plain one that has the digest `wanted` (NULL: any); *is_sent: it was. */
static enum status send_open(struct relay *r, int fd, const char *what, const char *name, const char *query,
                             const char *wanted, bool *is_sent, struct error *err) {
    char hex[SHA256_HEX_SIZE];
    struct stat info;
    if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode))
        return STATUS_OK;
    enum status status = hash_file(fd, keep_on, r, hex, err);
    if (status != STATUS_OK || (wanted && strcmp(hex, wanted) != 0))
        return status;
    *is_sent = true;
    return link_send(&r->link, what, name, query, fd, hex, err);
}

/* The file that a line announces; *is_sent is false where it is not there any more as it was announced. The worker has
 * parsed untrusted files: no name leads out of its folder. */
static enum status send_output(struct relay *r, const cJSON *line, bool *is_sent, struct error *err) {
    const char *name, *wanted;
    int fd;
    *is_sent = false;
    if (json_string(line, "name", "a line", "", &name, NULL) != STATUS_OK ||
        json_string(line, "sha256", "a line", "", &wanted, NULL) != STATUS_OK || !file_path_is_plain(name) ||
        work_file_open_output(r->data_dir, r->job_id, r->number, name, &fd, NULL) != STATUS_OK)
        return STATUS_OK;
    enum status status = send_open(r, fd, "outputs", name, "", wanted, is_sent, err);
    close(fd);
    return status;
}

static enum status send_part(struct relay *r, const cJSON *line, struct error *err) {
    double number, first, bytes;
    bool is_sent = false;
    char name[32], query[32];
    int fd;
    if (json_number(line, "number", "a line", 0.0, &number, NULL) != STATUS_OK ||
        json_number(line, "first", "a line", 0.0, &first, NULL) != STATUS_OK ||
        json_number(line, "bytes", "a line", 0.0, &bytes, NULL) != STATUS_OK ||
        !(first >= 1.0 && number >= first && number < 1e9))
        return STATUS_OK;
    snprintf(name, sizeof name, "part-%d", (int)number);
    snprintf(query, sizeof query, "?first=%d", (int)first);
    enum status status = work_file_open_checkpoint(r->data_dir, r->job_id, r->number, name, &fd, err);
    if (status != STATUS_OK)
        return status;
    status = send_open(r, fd, "checkpoint", name, query, NULL, &is_sent, err);
    close(fd);
    if (status != STATUS_OK || !is_sent)
        return status;
    r->part_count++;
    r->part_bytes += bytes;
    char *dir = layout_attempt(r->data_dir, r->job_id, r->number), *folder = layout_checkpoint_folder(dir);
    char *path = layout_part(folder, (int)number);
    if (unlink(path) != 0)
        status = error_set_errno(err, errno, "cannot remove %s", path);
    mem_free(path);
    mem_free(folder);
    mem_free(dir);
    return status;
}

void relay_name_disk(const struct relay *r, struct error *err) {
    error_prefix(err, "on the node %s", r->host);
    error_hint(err, "Free some space on %.64s, or keep attempts from it, then resume the job.", r->host);
}

/* The last line of a worker that has met a full disk, with the machine whose disk that is; the caller's. NULL: it is
 * another line. */
static char *say_where(const struct relay *r, cJSON *line) {
    const char *ending, *message;
    struct error err;
    if (json_string(line, "status", "a line", "", &ending, NULL) != STATUS_OK ||
        strcmp(ending, status_name(STATUS_NO_SPACE)) != 0 ||
        json_string(line, "message", "a line", "", &message, NULL) != STATUS_OK)
        return NULL;
    error_set(&err, STATUS_NO_SPACE, "%s", message);
    relay_name_disk(r, &err);
    cJSON_DeleteItemFromObjectCaseSensitive(line, "message");
    cJSON_DeleteItemFromObjectCaseSensitive(line, "hint");
    json_add_string(line, "message", err.message);
    json_add_string(line, "hint", err.hint);
    return json_text(line);
}

/* Passes on the oldest line, or keeps it where its file cannot be sent. */
static enum status pass_on(struct relay *r, struct error *err) {
    const char *text = r->line[0];
    char *changed = NULL;
    cJSON *line = NULL;
    const char *type = "";
    bool is_passed = true;
    enum status status = STATUS_OK;
    if (json_parse(text, strlen(text), "a line", &line, NULL) == STATUS_OK)
        (void)json_string(line, "type", "a line", "", &type, NULL);
    if (strcmp(type, "output") == 0 || strcmp(type, "preview") == 0) {
        status = send_output(r, line, &is_passed, err);
    } else if (strcmp(type, "record") == 0) { /* it may have grown again: then that is told, too */
        status = send_output(r, line, &is_passed, err);
        is_passed = false;
    } else if (strcmp(type, "part") == 0) {
        status = send_part(r, line, err);
        is_passed = false;
    } else if (strcmp(type, "end") == 0) {
        changed = say_where(r, line);
        text = changed ? changed : text;
    }
    cJSON_Delete(line);
    if (status != STATUS_OK)
        return status;
    if (is_passed)
        link_add_line(&r->link, text, strlen(text));
    mem_free(changed);
    mem_free(r->line[0]);
    memmove(r->line, r->line + 1, --r->line_count * sizeof *r->line);
    return STATUS_OK;
}

/* The end of the log, from a whole line on if possible, as a file without a name. */
static enum status copy_log(int fd, int *copy, struct error *err) {
    off_t length = lseek(fd, 0, SEEK_END), start = length > NODE_LOG_MAX ? length - NODE_LOG_MAX : 0;
    char *text = mem_alloc(NODE_LOG_MAX);
    ssize_t got = pread(fd, text, NODE_LOG_MAX, start);
    char *newline = got > 0 && start > 0 ? memchr(text, '\n', (size_t)got) : NULL;
    ptrdiff_t skip = newline ? newline + 1 - text : 0;
    enum status status = got < 0 ? error_set_errno(err, errno, "cannot read the worker's log") : STATUS_OK;
    *copy = memfd_create("log", MFD_CLOEXEC);
    if (*copy < 0)
        status = error_set_errno(err, errno, "cannot copy the worker's log");
    if (status == STATUS_OK)
        status = file_write_all(*copy, text + skip, (size_t)(got - skip), "the worker's log", err);
    mem_free(text);
    return status;
}

void relay_send_log(struct relay *r) {
    char hex[SHA256_HEX_SIZE];
    int copy = -1, fd;
    struct error err;
    if (!r->run || link_state(&r->link) != LINK_OPEN)
        return;
    char *dir = layout_attempt(r->data_dir, r->job_id, r->number), *path = layout_log(dir);
    fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    enum status status = fd < 0 ? error_set_errno(&err, errno, "cannot open %s", path) : STATUS_OK;
    bool has_any = fd >= 0 && lseek(fd, 0, SEEK_END) > 0;
    if (has_any)
        status = copy_log(fd, &copy, &err);
    if (has_any && status == STATUS_OK)
        status = hash_file(copy, keep_on, r, hex, &err);
    if (has_any && status == STATUS_OK)
        status = link_send(&r->link, "log", NULL, "", copy, hex, &err);
    if (status != STATUS_OK)
        log_warning("the worker's log is not sent: %s", err.message);
    if (copy >= 0)
        close(copy);
    if (fd >= 0)
        close(fd);
    mem_free(path);
    mem_free(dir);
}

/* --- the whole ---------------------------------------------------------------------------------- */

static void wait_a_little(struct relay *r) {
    struct pollfd fds[RUN_FDS];
    double look_sec, due = link_next_report(&r->link) - clock_sec();
    size_t count = r->has_ended ? 0 : run_poll(r->run, fds, &look_sec);
    double wait = fmin(fmax(due, 0.05), LOOK_SEC); /* lines come in bursts: 20 looks a second are enough */
    if (count > 0)
        poll(NULL, 0, 50);
    poll(fds, (nfds_t)count, (int)(1e3 * wait));
}

static void wait_for_end(struct relay *r) {
    if (!r->run)
        return;
    kill_run(r);
    while (!r->has_ended) {
        r->has_ended = run_ended(r->run, &r->end, add_line, r);
        if (!r->has_ended)
            poll(NULL, 0, 10);
    }
}

enum status relay_follow(struct relay *r, struct error *err) {
    enum status status = STATUS_OK;
    while (status == STATUS_OK && !(r->has_ended && r->line_count == 0)) {
        beat(r);
        while (status == STATUS_OK && r->line_count > 0 && link_state(&r->link) == LINK_OPEN)
            status = pass_on(r, err);
        if (link_state(&r->link) != LINK_OPEN)
            status = error_set(err, STATUS_CANCELLED, "%s", r->link.why);
        else if (status == STATUS_OK && !r->has_ended)
            wait_a_little(r);
    }
    wait_for_end(r);
    if (status == STATUS_OK && !relay_flush(r))
        status = error_set(err, STATUS_CANCELLED, "%s", r->link.why);
    return status;
}

/* Whether nobody waits for what has not been said: the attempt ends early, and the next one says it again. */
static bool is_given_up(const struct relay *r) {
    return r->gives_up || r->has_stopped || r->is_taken_back || r->link.wanted == LINK_STOP ||
           r->link.wanted == LINK_CANCEL;
}

bool relay_flush(struct relay *r) {
    while (!link_all_lines_sent(&r->link) && link_state(&r->link) == LINK_OPEN) {
        double wait = link_next_report(&r->link) - clock_sec();
        if (r->link.is_put_off && is_given_up(r)) {
            link_drop_lines(&r->link);
            break;
        }
        if ((r->link.failures > 0 || r->link.is_put_off) && wait > 0.0)
            poll(NULL, 0, (int)(1e3 * wait) + 1);
        obey_signals(r);
        link_report(&r->link, run_cpu_sec(r->run), true);
    }
    return link_state(&r->link) == LINK_OPEN;
}
