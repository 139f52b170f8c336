/* doctor.c -- `unbaked doctor`: what works on this machine, as the configuration would use it.
 *
 * Each check is a line: ok, warn (it works, but look at it) or FAIL (the daemon, or its jobs,
 * will not work). Nothing is changed; a file is written into the data folder and removed. */
#include <errno.h>
#include <fcntl.h>
#include <linux/magic.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/admin/admin.h"
#include "server/admin/commands.h"
#include "server/data/layout.h"
#include "server/executor/site_check.h"
#include "server/executor/sites.h"
#include "server/libraries.h"
#include "server/net/tls.h"
#include "server/worker/sandbox.h"

const struct command_option doctor_flags[] = {INVOCATION_FLAGS, {"help", 0, OPTION_FLAG, NULL, "print this help"}, {0}};

enum doctor_verdict { GOOD, WARN, BAD };

struct doctor {
    const struct config *config;
    bool is_loopback; /* the daemon listens on loopback */
    int bad_count;
};

__attribute__((format(printf, 4, 5))) static void tell(struct doctor *d, enum doctor_verdict verdict, const char *what,
                                                       const char *format, ...) {
    static const char *const words[] = {"ok", "warn", "FAIL"};
    char text[1200];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    printf("%-5s %-12s %s\n", words[verdict], what, text);
    d->bad_count += verdict == BAD;
}

/* --- the program ----------------------------------------------------------------------------- */

static void check_libraries(struct doctor *d) {
    const char *lack = libraries_lack();
    char *text = libraries_text();
    tell(d, lack ? WARN : GOOD, "libraries", "%s%s%s", lack ? lack : "", lack ? "; " : "", text);
    mem_free(text);
}

/* --- the machine ----------------------------------------------------------------------------- */

static void check_limits(struct doctor *d) {
    const struct config *c = d->config;
    struct rlimit files;
    int64_t wanted = 2 * c->max_connections + 100; /* one for a connection and one for the file it is sent */
    if (getrlimit(RLIMIT_NOFILE, &files) != 0)
        tell(d, WARN, "limits", "the limit of open files cannot be read: %s", strerror(errno));
    else if (files.rlim_max < (rlim_t)wanted)
        tell(d, WARN, "limits", "%llu open files allowed, %lld wanted for max_connections = %lld (LimitNOFILE=)",
             (unsigned long long)files.rlim_max, (long long)wanted, (long long)c->max_connections);
    else
        tell(d, GOOD, "limits", "%llu open files allowed", (unsigned long long)files.rlim_max);
}

static void check_processors(struct doctor *d) {
    const struct config *c = d->config;
    long count = sysconf(_SC_NPROCESSORS_ONLN), pages = sysconf(_SC_PHYS_PAGES);
    uint64_t memory = (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE) >> 20;
    uint64_t wanted = (uint64_t)c->worker_memory_mib * (uint64_t)c->max_running;
    enum doctor_verdict verdict = wanted > memory || c->threads > count ? WARN : GOOD;
    tell(d, verdict, "machine", "%ld processors, %llu MiB of memory; jobs use %lld threads (0: all) and %s", count,
         (unsigned long long)memory, (long long)c->threads,
         wanted == 0       ? "as much memory as they ask for"
         : wanted > memory ? "may use more memory than there is"
                           : "have room");
}

/* Tries the sandbox in a child process. */
static void check_sandbox(struct doctor *d) {
    const struct config *c = d->config;
    struct sandbox_result result = {.text = ""};
    int channel[2];
    if (!c->sandbox) {
        tell(d, WARN, "sandbox", "sandbox = no: jobs parse untrusted uploads with all the daemon's rights");
        return;
    }
    pid_t child = pipe2(channel, O_CLOEXEC) == 0 ? fork() : -1;
    if (child == 0) {
        struct sandbox sandbox = {.write_dir = "/tmp"};
        sandbox_enter(&sandbox, &result);
        /* Compare what it claims with what it does. */
        int etc = open("/etc/passwd", O_RDONLY | O_CLOEXEC);
        int net = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        result.files = result.files && etc < 0;
        result.system_calls = result.system_calls && net < 0;
        bool sent = write(channel[1], &result, sizeof result) == (ssize_t)sizeof result;
        _exit(!sent);
    }
    if (child < 0 || read(channel[0], &result, sizeof result) != (ssize_t)sizeof result) {
        tell(d, BAD, "sandbox", "a process in the sandbox does not even start");
    } else {
        tell(d, result.files ? GOOD : WARN, "sandbox", "Landlock %s",
             result.files ? "keeps jobs from files that are not theirs"
                          : "is missing (Linux 5.13, lsm=landlock): jobs may read files that are not theirs");
        tell(d, result.system_calls ? GOOD : WARN, "sandbox", "seccomp %s",
             result.system_calls ? "keeps jobs from the network, from new programs and from other processes"
                                 : "is missing: jobs may use the network");
    }
    if (child > 0) {
        close(channel[0]);
        close(channel[1]);
        waitpid(child, NULL, 0);
    }
}

/* --- the data folder ------------------------------------------------------------------------- */

static bool is_remote(const char *dir) {
    struct statfs info;
    if (statfs(dir, &info) != 0)
        return false;
    unsigned long type = (unsigned long)info.f_type;
    return type == NFS_SUPER_MAGIC || type == SMB_SUPER_MAGIC || type == 0xFE534D42UL /* SMB2 */ ||
           type == 0xFF534D42UL /* CIFS */ || type == 0x65735546UL /* FUSE: who knows */;
}

static bool check_writable(struct doctor *d, const char *dir) {
    char *path = layout_probe(dir);
    int fd = mkostemp(path, O_CLOEXEC);
    bool good = fd >= 0 && write(fd, "x", 1) == 1 && fsync(fd) == 0;
    int number = errno;
    if (fd >= 0) {
        close(fd);
        unlink(path);
    }
    mem_free(path);
    if (!good)
        tell(d, BAD, "data", "user %d cannot write to %s: %s", (int)geteuid(), dir, strerror(number));
    return good;
}

static void check_disk(struct doctor *d) {
    const struct config *c = d->config;
    uint64_t room;
    struct error err;
    struct stat info;
    const char *dir = c->data_dir;
    if (stat(dir, &info) != 0) {
        tell(d, WARN, "data", "%s is not there; the daemon makes it where it may", dir);
        return;
    }
    if (geteuid() == 0 && info.st_uid != 0 &&
        seteuid(info.st_uid) != 0) { /* act as the folder's owner, as the daemon does */
        tell(d, BAD, "data", "cannot act as the owner of %s: %s", dir, strerror(errno));
        return;
    }
    if (check_writable(d, dir))
        tell(d, info.st_mode & 077 ? WARN : GOOD, "data", "%s can be written%s", dir,
             info.st_mode & 077 ? ", and others can look into it: chmod go= it, as the daemon does when it starts"
                                : "");
    if (is_remote(dir))
        tell(d, BAD, "data", "%s lies on a network file system, where SQLite's locks cannot be relied on", dir);
    if (file_free_bytes(dir, &room, &err) != STATUS_OK)
        tell(d, BAD, "disk", "%s", err.message);
    else
        tell(d, room >> 20 < (uint64_t)c->min_free_mib ? BAD : GOOD, "disk", "%llu MiB free; min_free_mib = %lld",
             (unsigned long long)(room >> 20), (long long)c->min_free_mib);
}

/* --- the daemon ------------------------------------------------------------------------------ */

static bool daemon_runs(const char *dir) {
    char *path = layout_lock(dir);
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    bool runs = fd >= 0 && flock(fd, LOCK_SH | LOCK_NB) != 0;
    if (fd >= 0)
        close(fd);
    mem_free(path);
    return runs;
}

struct token_counts {
    int all, expired;
    int admins; /* of those that are valid */
};

static struct token_counts count_tokens(const cJSON *tokens) {
    const cJSON *item;
    struct token_counts count = {.all = cJSON_GetArraySize(tokens)};
    cJSON_ArrayForEach(item, tokens) {
        const char *role = cJSON_GetStringValue(cJSON_GetObjectItem(item, "role"));
        double ms = cJSON_GetNumberValue(cJSON_GetObjectItem(item, "expires_ms"));
        bool is_expired = ms > 0.0 && ms <= (double)clock_unix_ms();
        count.expired += is_expired;
        count.admins += !is_expired && role && strcmp(role, role_name(ROLE_ADMIN)) == 0;
    }
    return count;
}

static void check_tokens(struct doctor *d, bool runs) {
    const struct config *c = d->config;
    bool is_loopback = d->is_loopback;
    struct error err;
    char *path = layout_state(c->data_dir);
    struct token_counts count = {0};
    int fd;
    if (runs || access(path, R_OK) == 0) {
        cJSON *request = cJSON_CreateObject(), *reply;
        json_add_string(request, "command", "token-list");
        if (admin_call(c->data_dir, request, &reply, &fd, &err) == STATUS_OK) {
            count = count_tokens(cJSON_GetObjectItem(reply, "items"));
        } else {
            tell(d, BAD, "database", "%s%s%s", err.message, *err.hint ? "; " : "", err.hint);
        }
        cJSON_Delete(request);
        cJSON_Delete(reply);
    }
    mem_free(path);
    if (strcmp(c->access, "open") == 0)
        tell(d, is_loopback ? GOOD : BAD, "tokens", "access = open%s",
             is_loopback ? ": whoever has an account on this machine may do everything"
                         : " is for loopback addresses only");
    else if (count.all > 0 && count.expired == count.all)
        tell(d, WARN, "tokens", "%d, and all have expired: `unbaked token add NAME --role admin`", count.all);
    else if (count.all > 0 && count.admins == 0)
        tell(d, WARN, "tokens", "%d, none of them an admin's: `unbaked token add NAME --role admin`", count.all);
    else if (count.expired > 0)
        tell(d, GOOD, "tokens", "%d, %d of them expired", count.all, count.expired);
    else if (count.all > 0)
        tell(d, GOOD, "tokens", "%d", count.all);
    else if (is_loopback)
        tell(d, GOOD, "tokens", "none: whoever has an account on this machine may do everything");
    else
        tell(d, BAD, "tokens", "none, and %s is not a loopback address: `unbaked token add NAME --role admin`",
             c->listen);
}

static void check_tls(struct doctor *d) {
    const struct config *c = d->config;
    bool is_loopback = d->is_loopback;
    struct tls *tls;
    struct error err;
    struct stat info;
    double days = 0;
    if (!*c->tls_certificate) {
        tell(d, is_loopback ? GOOD : WARN, "tls",
             is_loopback ? "none, on loopback" : "none: tokens and scenes cross the network unencrypted");
        return;
    }
    enum status status = tls_new(&tls, c->tls_certificate, c->tls_key, &err);
    if (status == STATUS_OK) {
        tls_free(tls);
        status = tls_days_left(c->tls_certificate, &days, &err);
    }
    if (status != STATUS_OK) {
        tell(d, BAD, "tls", "%s%s%s", err.message, *err.hint ? "; " : "", err.hint);
        return;
    }
    tell(d,
         days < 0    ? BAD
         : days < 14 ? WARN
                     : GOOD,
         "tls", "the certificate %s %.0f days", days < 0 ? "has expired, for" : "is good for", days < 0 ? -days : days);
    if (stat(c->tls_key, &info) == 0 && info.st_mode & 07)
        tell(d, WARN, "tls", "everybody here can read the key: chmod o= %s", c->tls_key);
}

static void tell_executor(void *user, bool is_good, const char *text) {
    tell(user, is_good ? GOOD : WARN, "executor", "%s", text);
}

static void check_executors(struct doctor *d) {
    struct sites sites;
    struct buf none;
    buf_init(&none, 1 << 16);
    sites_read(&sites, d->config->executors, d->config->executors_dir, &none); /* was checked with the rest */
    for (size_t i = 0; i < sites.count; i++)
        if (!sites.place[i].is_process)
            site_check(&sites.place[i].site, tell_executor, d);
    sites_release(&sites);
    buf_release(&none);
}

int doctor_command(int argc, char **argv) {
    struct invocation in;
    struct error err;
    char address[CONFIG_ADDRESS_SIZE];
    uint16_t port;
    int code = invocation_read(&in, argc, argv, doctor_flags, CONFIG_FILE_DEFAULT);
    if (code < 0 && (invocation_has(&in, "help") || in.arguments.word_count > 0))
        code = in.arguments.word_count > 0 ? COMMAND_MISUSED : COMMAND_HELP;
    if (code < 0) {
        struct doctor doctor = {.config = &in.config}, *d = &doctor;
        bool runs = daemon_runs(in.config.data_dir);
        log_set_level(LOG_ERROR);
        config_address(in.config.listen, address, &port, &d->is_loopback, &err); /* was checked with the rest */
        tell(d, GOOD, "program", "unbaked " UNBAKE_VERSION "; a daemon %s on %s", runs ? "runs" : "does not run",
             in.config.data_dir);
        check_libraries(d);
        check_processors(d);
        check_limits(d);
        check_sandbox(d);
        check_tls(d);
        check_tokens(d, runs);
        check_disk(d);
        check_executors(d);
        code = d->bad_count > 0;
    }
    invocation_release(&in);
    return code;
}
