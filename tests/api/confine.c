/* confine.c -- what systemd does around a service, for test_service.sh, where there is no systemd:
 *
 *   confine UNIT SYSCALLS LOG WRITABLE PROGRAM ARGUMENT...
 *
 * Runs the program as the unit's [Service] section says (confine_unit.h): its environment, its view of the files (for
 * root alone: elsewhere it keeps that of the caller), its rights, and a seccomp filter that lets through the system
 * calls named in the file SYSCALLS. Of files only what is below the folder WRITABLE can be written. Appends what the
 * program says on its notify socket to LOG (in WRITABLE), with a watchdog of WATCHDOG_SEC; hands SIGTERM and SIGHUP
 * on. */
#include <poll.h>
#include <libgen.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/un.h>
#include <sys/wait.h>

#include "tests/api/confine_unit.h"

#define WATCHDOG_SEC 3
#define PROGRAMS "/tmp/programs" /* where the program's folder is, in its view */

/* In the child. */
static void become_service(const char *unit_path, const char *calls, const char *writable, char **argv) {
    struct unit unit;
    char path[1024], folder[1024];
    unit_read(&unit, unit_path);
    unit_check_names(&unit);
    unit_set_environment(&unit);
    snprintf(path, sizeof path, "%s", argv[0]);
    if (geteuid() == 0) {
        snprintf(folder, sizeof folder, "%s", argv[0]);
        snprintf(path, sizeof path, "%s/%s", PROGRAMS, basename(argv[0]));
        unit_hide(&unit, writable, dirname(folder), PROGRAMS);
        unit_drop_rights(&unit);
    }
    unit_restrict_calls(&unit, calls);
    execv(path, argv);
    must(0, path);
}

int main(int argc, char **argv) {
    if (argc < 6)
        return 125;
    FILE *log = fopen(argv[3], "ae");
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int length = snprintf(address.sun_path, sizeof address.sun_path, "%s.socket", argv[3]);
    int notified = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    must(log && length < (int)sizeof address.sun_path && notified >= 0, "cannot start");
    unlink(address.sun_path);
    must(bind(notified, (struct sockaddr *)&address, sizeof address) == 0, "bind");
    sigset_t set, old;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGCHLD);
    sigprocmask(SIG_BLOCK, &set, &old);
    pid_t child = fork();
    if (child == 0) {
        char usec[32], pid[16];
        snprintf(usec, sizeof usec, "%d", WATCHDOG_SEC * 1000000);
        snprintf(pid, sizeof pid, "%d", (int)getpid());
        setenv("NOTIFY_SOCKET", address.sun_path, 1);
        setenv("WATCHDOG_USEC", usec, 1);
        setenv("WATCHDOG_PID", pid, 1);
        sigprocmask(SIG_SETMASK, &old, NULL);
        become_service(argv[1], argv[2], argv[4], argv + 5);
    }
    struct pollfd wait[2] = {{.fd = notified, .events = POLLIN},
                             {.fd = signalfd(-1, &set, SFD_CLOEXEC), .events = POLLIN}};
    for (;;) {
        char text[512];
        struct signalfd_siginfo info;
        poll(wait, 2, -1);
        if (wait[0].revents) {
            ssize_t got = recv(notified, text, sizeof text, 0);
            fprintf(log, "%.*s\n", got > 0 ? (int)got : 0, text);
            fflush(log);
            continue;
        }
        if (read(wait[1].fd, &info, sizeof info) != (ssize_t)sizeof info)
            continue;
        if (info.ssi_signo != SIGCHLD) {
            kill(child, (int)info.ssi_signo);
            continue;
        }
        int status;
        if (waitpid(child, &status, WNOHANG) == child) {
            unlink(address.sun_path);
            return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
        }
    }
}
