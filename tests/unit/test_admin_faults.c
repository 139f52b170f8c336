/* test_admin_faults.c -- the admin socket and the commands that work without a daemon, while each call of SQLite and of
 * the system fails once: what was asked is done, or it is said why not, and works when it is asked again. And peers on
 * the socket that break off or talk nonsense. */
#include "server/admin/admin.h"

#include <sys/un.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/admin/commands.h"
#include "server/data/folder.h"
#include "tests/check.h"
#include "tests/system_faults.h"

static struct error err;
static char dir[64];
static struct store *store; /* the daemon's; NULL: there is none */
static struct admin *admin;
static long calls;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

static void revoked(void *user) { (void)user; }

static enum status ask(const char *text) {
    cJSON *request = cJSON_Parse(text), *reply = NULL;
    int fd = -1;
    err = (struct error){0};
    enum status status = admin_call(dir, request, &reply, &fd, &err);
    bool was_off = faults_are_off;
    faults_are_off = true;
    if (geteuid() != getuid()) /* that was what failed, and a command would end by it */
        CHECK(status != STATUS_OK && seteuid(getuid()) == 0 && setegid(getgid()) == 0);
    faults_are_off = was_off;
    CHECK((status == STATUS_OK) == (reply != NULL));
    if (fd >= 0)
        close(fd);
    cJSON_Delete(request);
    cJSON_Delete(reply);
    return status;
}

/* Each call in turn, of SQLite or of the system, until there are no more. */
static void strike_all(const char *text, bool is_sql) {
    bool struck = true;
    for (long n = 1; struck && check_failed_count == 0; n++) {
        faults_are_off = false;
        if (is_sql)
            sql_faults_arm(n);
        else
            system_faults_arm(n);
        enum status status = ask(text);
        struck = is_sql ? sql_faults_lift() : system_faults_lift();
        faults_are_off = true;
        calls += struck;
        CHECK_THAT(struck || status == STATUS_OK, "%s: %s", text, err.message);
        CHECK_THAT(status == STATUS_OK || (*err.message && err.status == status), "%s, call %ld: no sentence", text, n);
    }
}

static void strike_commands(void) {
    static const char *const requests[] = {"{\"command\":\"token-add\",\"name\":\"ann\"}",
                                           "{\"command\":\"token-list\"}", "{\"command\":\"backup\"}"};
    for (size_t i = 0; i < sizeof requests / sizeof *requests; i++) {
        strike_all(requests[i], true);
        strike_all(requests[i], false);
    }
    CHECK(ask("{\"command\":\"token-revoke\",\"which\":\"ann\"}") == STATUS_OK);
    strike_all("{\"command\":\"token-list\"}", false);
}

static void check_nonsense(void) {
    static const char *const bad[] = {"{}",
                                      "{\"command\":7}",
                                      "{\"command\":\"dance\"}",
                                      "{\"command\":\"token-add\",\"name\":7}",
                                      "{\"command\":\"token-add\",\"name\":\"ann\",\"role\":7}",
                                      "{\"command\":\"token-add\",\"name\":\"ann\",\"role\":\"king\"}",
                                      "{\"command\":\"token-add\",\"name\":\"7up\"}",
                                      "{\"command\":\"token-revoke\",\"which\":7}"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(ask(bad[i]) == STATUS_INPUT && *err.message, "%s: %s", bad[i], status_name(err.status));
    CHECK(ask("{\"command\":\"token-revoke\",\"which\":\"nobody\"}") == STATUS_NOT_FOUND && *err.message);
}

static void strike_start(void) {
    for (long n = 1; check_failed_count == 0; n++) {
        faults_are_off = false;
        system_faults_arm(n);
        enum status status = admin_start(&admin, dir, store, revoked, NULL, &err);
        bool struck = system_faults_lift();
        faults_are_off = true;
        CHECK_THAT(status == STATUS_OK || *err.message, "start, call %ld: no sentence", n);
        if (status == STATUS_OK && !struck)
            return;
        if (status == STATUS_OK)
            admin_stop(admin);
    }
}

static int connect_to_socket(bool listens) {
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    snprintf(at.sun_path, sizeof at.sun_path, "%s/admin.sock", dir);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK((listens ? bind : connect)(fd, (struct sockaddr *)&at, sizeof at) == 0);
    CHECK(!listens || listen(fd, 4) == 0);
    return fd;
}

/* Who sends no line, none that is a request, or more than a line may have, gets an answer or none; others do. */
static void check_peers(void) {
    static const char *const lines[] = {"", "x", "x\n", "[]\n"};
    char reply[512];
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        int fd = connect_to_socket(false);
        CHECK(send(fd, lines[i], strlen(lines[i]), MSG_NOSIGNAL) == (ssize_t)strlen(lines[i]));
        shutdown(fd, SHUT_WR);
        ssize_t got = recv(fd, reply, sizeof reply - 1, 0);
        CHECK(strchr(lines[i], '\n') ? got > 0 : got == 0);
        close(fd);
    }
    OK(ask("{\"command\":\"token-list\"}"));
}

/* A daemon that answers so; NULL: it takes no notice. */
static void check_answer(const char *answer, enum status wanted) {
    char *path = file_join(dir, "admin.sock"), request[512];
    int listener = connect_to_socket(true);
    pid_t child = fork();
    if (child == 0) {
        int fd = accept(listener, NULL, NULL);
        if (recv(fd, request, sizeof request, 0) > 0 && *answer)
            send(fd, answer, strlen(answer), MSG_NOSIGNAL);
        _exit(0);
    }
    CHECK(ask("{\"command\":\"backup\"}") == wanted && *err.message);
    waitpid(child, NULL, 0);
    close(listener);
    unlink(path);
    mem_free(path);
}

/* As somebody else than the daemon's user. */
static void check_stranger(void) {
    int listener = connect_to_socket(true);
    char *path = file_join(dir, "admin.sock");
    CHECK(chmod(path, 0600) == 0);
    if (getuid() == 0) {
        cJSON *request = cJSON_Parse("{\"command\":\"backup\"}"), *reply;
        int fd;
        CHECK(setegid(65534) == 0 && seteuid(65534) == 0);
        CHECK(admin_call(dir, request, &reply, &fd, &err) == STATUS_IO && strstr(err.hint, "daemon's user") && !reply);
        CHECK(seteuid(0) == 0 && setegid(0) == 0);
        cJSON_Delete(request);
    }
    close(listener);
    unlink(path);
    mem_free(path);
}

/* A daemon that says that all is well, and sends nothing. */
static void check_no_copy(void) {
    char *path = file_join(dir, "admin.sock"), *copy = file_join(dir, "copy.db"), request[512];
    char *argv[] = {"backup", copy, "--data", dir, NULL};
    int listener = connect_to_socket(true);
    pid_t child = fork();
    if (child == 0) {
        int fd = accept(listener, NULL, NULL);
        _exit(recv(fd, request, sizeof request, 0) > 0 && send(fd, "{}\n", 3, MSG_NOSIGNAL) == 3 ? 0 : 1);
    }
    CHECK(backup_command(4, argv) == EXIT_FAILURE && access(copy, F_OK) != 0);
    waitpid(child, NULL, 0);
    close(listener);
    unlink(path);
    mem_free(path);
    mem_free(copy);
}

int main(void) {
    int lock;
    snprintf(dir, sizeof dir, "%s/unbake-test-admin-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    chmod(dir, 0755);
    if (getuid() == 0) /* who acts as its owner */
        CHECK(chown(dir, 65534, 65534) == 0);
    log_set_level(LOG_ERROR);
    faults_are_off = true;
    strike_commands(); /* no daemon */
    check_nonsense();
    if (getuid() == 0) { /* what was at fault first is told */
        faults_are_off = false;
        system_faults_arm_only("seteuid", 2, false);
        enum status status = ask("{\"command\":\"dance\"}");
        faults_are_off = true;
        CHECK(system_faults_lift() && status == STATUS_INPUT && strstr(err.message, "dance"));
    }

    OK(folder_lock(dir, &lock, &err));
    CHECK(ask("{\"command\":\"backup\"}") == STATUS_CONFLICT && strstr(err.hint, "try again"));
    OK(store_open(&store, dir, &err));
    strike_start();
    strike_commands();
    check_nonsense();
    check_peers();
    admin_stop(admin);

    check_answer("", STATUS_UNAVAILABLE);
    check_answer("nonsense\n", STATUS_INPUT);
    check_answer("{\"error\":7}\n", STATUS_INPUT);
    check_answer("{\"error\":\"it cannot\",\"status\":3}\n", STATUS_NO_SPACE);
    check_answer("{\"error\":\"it cannot\",\"status\":99}\n", STATUS_INTERNAL);
    check_stranger();
    check_no_copy();
    printf("%ld calls failed\n", calls);
    store_close(store);
    close(lock);
    OK(file_remove_tree(dir, &err));
    return check_result();
}
