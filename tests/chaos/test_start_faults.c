/* test_start_faults.c -- the daemon starts, and the commands of whoever runs it work, while each call of the
 * system, or of SQLite, fails once: it does what it should, or ends with 1 and a sentence that says why, and leaves
 * nothing half done; the next time all is well. A daemon that is up answers and stops as always. Every third call; in
 * the long form each. */
#include <poll.h>

#include "tests/chaos/daemon.h"
#include "tests/chaos/faults.h"

static struct daemon d;
static struct faults *faults;
static char library[PATH_MAX], page[128], out[128], copy[128], part[140], certificate[160], key[160];
static long strikes, step;

/* The program with these arguments, struck at the n-th call (0: at none); what it writes goes to d.log and `out`. */
static pid_t run(const char *const *argv, bool is_sql, long n) {
    unlink(d.log);
    faults_arm(faults, FAULTS_DAEMON, n, 0, false);
    pid_t child = fork();
    if (child != 0)
        return child;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (!freopen(d.log, "a", stderr) || !freopen(out, "w", stdout))
        _exit(126);
    setenv("UNBAKE_FAULTS", page, 1);
    setenv("UNBAKE_FAULTS_OF", is_sql ? "sql" : "system", 1);
    preload_set(library);
    execv(d.binary, (char *const *)(uintptr_t)argv);
    _exit(127);
}

static bool has(const char *path, const char *word) {
    struct buf text;
    struct error err;
    buf_init(&text, (size_t)16 << 20);
    CHECK_THAT(file_read(path, &text, &err) == STATUS_OK, "%s", err.message);
    bool found = strstr(buf_text(&text), word) != NULL;
    buf_release(&text);
    return found;
}

/* After a failure: what was struck, and what the program had to say. */
static void tell(bool is_sql, long n) {
    struct buf text;
    buf_init(&text, (size_t)16 << 20);
    file_read(d.log, &text, NULL);
    fprintf(stderr, "call %ld of %s was %s; the log:\n%s", n, is_sql ? "SQLite" : "the system",
            atomic_load(&faults->failed) > 0 ? faults->what : "not reached", buf_text(&text));
    buf_release(&text);
}

/* Whether it was struck; it ended by itself, never by a signal. */
static bool settle(const char *what, long n, int wait_status, int *code) {
    *code = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : -1;
    bool struck = atomic_load(&faults->failed) > 0;
    strikes += struck;
    CHECK_THAT(*code == 0 || (struck && *code == 1), "%s, call %ld: it ends with %x", what, n, (unsigned)wait_status);
    return struck;
}

/* --- the daemon -------------------------------------------------------------------------------------- */

/* Waits until it is up; false where it has ended instead. */
static bool is_up(pid_t child, int *wait_status) {
    for (;; poll(NULL, 0, 2)) {
        struct buf text;
        if (waitpid(child, wait_status, WNOHANG) == child)
            return false;
        buf_init(&text, 64);
        bool told = file_read(d.port_file, &text, NULL) == STATUS_OK && strchr(buf_text(&text), '\n');
        d.port = atoi(buf_text(&text));
        buf_release(&text);
        if (told)
            return true;
    }
}

static bool start_once(bool is_sql, long n) {
    static const char *argv[] = {"unbaked",   "--data", d.data,           "--listen", "127.0.0.1:0",    "--port-file",
                                 d.port_file, "--set",  "min_free_mib=0", "--set",    "low_disk_mib=0", NULL};
    struct buf body;
    int wait_status = 0, code;
    char *socket_path = file_join(d.data, "admin.sock");
    unlink(d.port_file);
    unlink(socket_path); /* the last one's, where its removal was what failed */
    pid_t child = run(argv, is_sql, n);
    if (is_up(child, &wait_status)) {
        /* Once it has said where it listens it may still end by itself: its scheduler does not begin. */
        int status = http_get(d.port, "/readyz", &body);
        CHECK_THAT(status == 200 || (status == 0 || status == 500 || status == 503), "call %ld: /readyz gets %d", n,
                   status);
        buf_release(&body);
        kill(child, SIGTERM);
        waitpid(child, &wait_status, 0);
    }
    bool struck = settle("a start", n, wait_status, &code);
    CHECK_THAT(code == 0 || has(d.log, " error: "), "call %ld: it does not say why it ends", n);
    CHECK_THAT(code != 0 || has(d.log, " info: stopped"), "call %ld: it does not say that it stopped", n);
    CHECK_THAT((struck && code == 0) || access(socket_path, F_OK) != 0, "call %ld: %s is left", n, socket_path);
    mem_free(socket_path);
    return struck;
}

/* Threads make calls, too, and in no fixed order: what fails is told at length and tried once more, and counts where it
 * fails twice. */
static bool start(bool is_sql, long n) {
    int before = check_failed_count;
    bool struck = start_once(is_sql, n);
    if (check_failed_count == before)
        return struck;
    tell(is_sql, n);
    check_failed_count = before;
    struck = start_once(is_sql, n);
    if (check_failed_count > before)
        tell(is_sql, n);
    return struck;
}

/* --- commands ----------------------------------------------------------------------------------------- */

static bool command_once(const char *const *argv, const char *wanted, bool is_sql, long n) {
    int wait_status, code;
    unlink(copy);
    pid_t child = run(argv, is_sql, n);
    waitpid(child, &wait_status, 0);
    bool struck = settle(argv[1], n, wait_status, &code);
    CHECK_THAT(code != 0 || has(out, wanted), "%s, call %ld: it does not say what it did", argv[1], n);
    CHECK_THAT(code == 0 || has(d.log, "unbaked: ") || has(out, "FAIL "), "%s, call %ld: no sentence", argv[1], n);
    CHECK_THAT(access(part, F_OK) != 0, "call %ld: half a copy is left", n);
    CHECK_THAT(strcmp(argv[1], "backup") != 0 || (code == 0) == (access(copy, F_OK) == 0) || struck,
               "call %ld: the copy", n);
    if (check_failed_count > 0)
        tell(is_sql, n);
    return struck;
}

/* Makes a certificate; without openssl there is none. */
static void make_certificate(void) {
    char *command =
        mem_printf("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 20 -subj /CN=x "
                   "-keyout %s/key.pem -out %s/cert.pem 2>/dev/null",
                   d.dir, d.dir);
    bool made = system(command) == 0;
    snprintf(certificate, sizeof certificate, "tls_certificate=%s%s", made ? d.dir : "", made ? "/cert.pem" : "");
    snprintf(key, sizeof key, "tls_key=%s%s", made ? d.dir : "", made ? "/key.pem" : "");
    mem_free(command);
}

static void strike_commands(void) {
    const char *const backup[] = {"unbaked", "backup", copy, "--data", d.data, NULL};
    const char *const list[] = {"unbaked", "token", "list", "--data", d.data, NULL};
    const char *const doctor[] = {"unbaked", "doctor",    "--data", d.data, "--set", "min_free_mib=0",
                                  "--set",   certificate, "--set",  key,    NULL};
    make_certificate();
    for (int is_sql = 0; is_sql < 2; is_sql++) {
        for (long n = 1; command_once(backup, "bytes", is_sql, n) && check_failed_count == 0; n += step)
            continue;
        for (long n = 1; command_once(list, "user", is_sql, n) && check_failed_count == 0; n += step)
            continue;
        for (long n = 1; command_once(doctor, "ok ", is_sql, n) && check_failed_count == 0; n += step)
            continue;
    }
}

int main(void) {
    step = getenv("UNBAKE_LONG") ? 1 : 3;
    const char *build = getenv("UNBAKE_BUILD") ? getenv("UNBAKE_BUILD") : "build";
    daemon_init(&d, build);
    preload_find(build, "calls", library);
    snprintf(page, sizeof page, "%s/faults", d.dir);
    snprintf(out, sizeof out, "%s/out", d.dir);
    snprintf(copy, sizeof copy, "%s/copy.db", d.dir);
    snprintf(part, sizeof part, "%s.part", copy);
    faults = faults_new(page, d.data, NULL);
    if (!faults)
        return 1;
    for (int is_sql = 0; is_sql < 2; is_sql++)
        for (long n = 1; start(is_sql, n) && check_failed_count == 0; n += step)
            continue;
    strike_commands();
    printf("%ld calls failed\n", strikes);
    daemon_remove(&d);
    return check_result();
}
