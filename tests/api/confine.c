/* confine.c -- what systemd does around a service, for test_service.sh, where there is no systemd:
 *
 *   confine SYSCALLS LOG WATCHDOG_SEC PROGRAM ARGUMENT...
 *
 * Runs the program under a seccomp filter that lets through only the system calls named in the
 * file SYSCALLS (others: EPERM, as SystemCallErrorNumber= says) and no memory that is writable and
 * executable; appends what it says on its notify socket to LOG; hands SIGTERM and SIGHUP on. */
#include <errno.h>
#include <poll.h>
#include <seccomp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

static void must(int good, const char *what) {
    if (good)
        return;
    perror(what);
    exit(125);
}

static void restrict_calls(const char *names) {
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    FILE *file = fopen(names, "re");
    char name[64];
    must(filter && file, names);
    while (fscanf(file, "%63s", name) == 1) {
        int number = seccomp_syscall_resolve_name(name);
        if (number == __NR_SCMP_ERROR || number < 0)
            continue; /* of another architecture */
        if (strcmp(name, "mmap") == 0) {
            must(seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 1,
                                  SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0 &&
                     seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 1,
                                      SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC | PROT_WRITE, PROT_EXEC)) == 0,
                 "mmap");
        } else if (strcmp(name, "mprotect") == 0) {
            must(seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 1,
                                  SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0, "mprotect");
        } else {
            must(seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 0) == 0, name);
        }
    }
    fclose(file);
    must(prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0, "PR_SET_NO_NEW_PRIVS");
    must(seccomp_load(filter) == 0, "seccomp_load");
    seccomp_release(filter);
}

int main(int argc, char **argv) {
    if (argc < 5)
        return 125;
    FILE *log = fopen(argv[2], "ae");
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int length = snprintf(address.sun_path, sizeof address.sun_path, "%s.socket", argv[2]);
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
        snprintf(usec, sizeof usec, "%.0f", 1e6 * strtod(argv[3], NULL));
        snprintf(pid, sizeof pid, "%d", (int)getpid());
        setenv("NOTIFY_SOCKET", address.sun_path, 1);
        setenv("WATCHDOG_USEC", usec, 1);
        setenv("WATCHDOG_PID", pid, 1);
        sigprocmask(SIG_SETMASK, &old, NULL);
        restrict_calls(argv[1]);
        execv(argv[4], argv + 4);
        must(0, argv[4]);
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
