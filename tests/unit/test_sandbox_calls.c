/* test_sandbox_calls.c -- a process that has been taken over and is still in the sandbox: whatever it asks of the
 * kernel that reaches another process, outlives its own, opens a way out, or changes a file past its descriptors is
 * refused, to a worker as to the process that calls webhooks. Red in each line where the call is let through; and what
 * others have is looked at afterwards. */
#include <errno.h>
#include <fcntl.h>
#include <linux/sched.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>

#include "common/mem.h"
#include "server/worker/sandbox.h"
#include "tests/unit/sandbox_others.h"

/* Numbers since Linux 5.1 are the same on all architectures, and newer than Debian 12's headers may be. */
#define NUMBER_FCHMODAT2 452
#define NUMBER_SETXATTRAT 463
#define NUMBER_FILE_SETATTR 469

#define REFUSED(call) /* no call of this list is one that this kernel lacks without the sandbox */                     \
    do {                                                                                                               \
        errno = 0;                                                                                                     \
        long result_ = (long)(call);                                                                                   \
        CHECK_THAT(result_ == -1 && errno == ENOSYS, "%s: %ld, %s", #call, result_, strerror(errno));                  \
    } while (0)

/* --- what nobody in the sandbox can do --------------------------------------------------------------------- */

static void send_signals(void) {
    siginfo_t info = {.si_code = SI_QUEUE};
    struct f_owner_ex owner = {.type = F_OWNER_PID, .pid = victim};
    int number = victim, on = 1;
    REFUSED(kill(victim, SIGKILL));
    REFUSED(kill(0, 0));
    REFUSED(kill(-1, 0));
    REFUSED(syscall(SYS_kill, (1UL << 32) | (unsigned)getpid(), 0)); /* the kernel looks at 32 bits */
    REFUSED(syscall(SYS_tkill, victim, SIGKILL));
    REFUSED(syscall(SYS_tgkill, victim, victim, SIGKILL));
    REFUSED(syscall(SYS_rt_sigqueueinfo, victim, SIGKILL, &info));
    REFUSED(syscall(SYS_rt_tgsigqueueinfo, victim, victim, SIGKILL, &info));
    REFUSED(syscall(SYS_pidfd_open, victim, 0));
    REFUSED(syscall(SYS_pidfd_send_signal, ends[0], SIGKILL, NULL, 0));
    /* By a descriptor that has become readable. */
    REFUSED(fcntl(ends[0], F_SETSIG, SIGKILL));
    REFUSED(fcntl(ends[0], F_SETOWN, victim));
    REFUSED(fcntl(ends[0], F_SETOWN_EX, &owner));
    REFUSED(fcntl(ends[0], F_SETFL, O_ASYNC));
    REFUSED(ioctl(ends[0], FIOASYNC, &on));
    REFUSED(ioctl(ends[0], FIOSETOWN, &number));
    REFUSED(ioctl(ends[0], SIOCSPGRP, &number));
    CHECK(write(ends[1], "x", 1) == 1);
    REFUSED(fcntl(ends[0], F_NOTIFY, 1));
    REFUSED(fcntl(ends[0], F_SETLEASE, F_RDLCK));
    struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGTERM};
    timer_t timer;
    REFUSED(syscall(SYS_timer_create, CLOCK_MONOTONIC, &event, &timer));
    REFUSED(syscall(SYS_mq_notify, 0, &event));
}

static void reach_others(void) {
    char byte;
    struct iovec local = {&byte, 1}, remote = {&byte, 1};
    struct rlimit limit = {0, 0};
    struct sched_param idle = {0};
    cpu_set_t all;
    memset(&all, 0xff, sizeof all);
#ifndef __SANITIZE_ADDRESS__ /* its check for leaks traces its own threads */
    REFUSED(syscall(SYS_ptrace, 16 /* PTRACE_ATTACH */, victim, 0, 0));
    REFUSED(prctl(PR_SET_PDEATHSIG, 0)); /* it would outlive the daemon */
    REFUSED(prctl(PR_SET_DUMPABLE, 1));
    REFUSED(prctl(PR_SET_CHILD_SUBREAPER, 1));
#endif
    REFUSED(syscall(SYS_process_vm_readv, victim, &local, 1, &remote, 1, 0));
    REFUSED(syscall(SYS_process_vm_writev, victim, &local, 1, &remote, 1, 0));
    REFUSED(syscall(SYS_process_madvise, ends[0], &local, 1, 0, 0));
    REFUSED(syscall(SYS_pidfd_getfd, ends[0], 0, 0));
    REFUSED(syscall(SYS_kcmp, victim, getpid(), 0, 0, 0));
    REFUSED(setpriority(PRIO_PROCESS, (id_t)victim, 19));
    REFUSED(syscall(SYS_ioprio_set, 1, victim, 3 << 13));
    REFUSED(sched_setaffinity(victim, sizeof all, &all));
    REFUSED(sched_setscheduler(victim, SCHED_BATCH, &idle));
    REFUSED(syscall(SYS_sched_setparam, victim, &idle));
    REFUSED(syscall(SYS_sched_setattr, victim, &byte, 0));
    REFUSED(syscall(SYS_prlimit64, victim, RLIMIT_NOFILE, &limit, NULL));
    REFUSED(syscall(SYS_prlimit64, victim, RLIMIT_NOFILE, NULL, &limit));
    REFUSED(syscall(SYS_prlimit64, 0, RLIMIT_DATA, &limit, NULL));
    REFUSED(syscall(SYS_setrlimit, RLIMIT_DATA, &limit));
    REFUSED(syscall(SYS_migrate_pages, victim, 0, NULL, NULL));
    REFUSED(syscall(SYS_shmget, 7, 4096, 01600));
    REFUSED(syscall(SYS_msgget, 7, 01600));
    REFUSED(syscall(SYS_semget, 7, 1, 01600));
    REFUSED(syscall(SYS_mq_open, "unbake", O_CREAT | O_RDWR, 0600, NULL));
    REFUSED(syscall(SYS_keyctl, 0, -3, 1));
    REFUSED(syscall(SYS_add_key, "user", "a", "b", 1, -3));
    REFUSED(syscall(SYS_request_key, "user", "a", "b", -3));
}

/* Where it was let through. */
static long end_child(long made) {
    if (made == 0)
        _exit(0);
    return made;
}

static void make_processes(void) {
    struct {
        uint64_t flags, rest[10];
    } arguments = {.flags = 0};
    static const unsigned long ways[] = {
        SIGCHLD, /* fork */
        CLONE_VM | CLONE_VFORK | SIGCHLD,
        CLONE_NEWUSER | SIGCHLD,
        CLONE_VM | SIGCHLD,
        CLONE_VM | CLONE_SIGHAND | CLONE_THREAD | CLONE_NEWUSER,
        CLONE_VM | CLONE_SIGHAND | CLONE_THREAD | CLONE_PARENT,
        CLONE_VM | CLONE_SIGHAND | CLONE_THREAD | CLONE_PTRACE,
        CLONE_PIDFD | SIGCHLD,
    };
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        errno = 0;
        long made = ways[i] & CLONE_VM ? -1 : end_child(syscall(SYS_clone, ways[i], 0, 0, 0, 0));
        if (ways[i] & CLONE_VM) /* without a stack: where it is let through, the kernel would share this one */
            made = syscall(SYS_clone, ways[i] | CLONE_SETTLS, 1, 1, 1, -1L);
        CHECK_THAT(made == -1 && errno == ENOSYS, "clone %lx: %s", ways[i], strerror(errno));
    }
    REFUSED(end_child(syscall(SYS_clone3, &arguments, sizeof arguments)));
#ifdef SYS_fork
    REFUSED(end_child(syscall(SYS_fork)));
#endif
    REFUSED(syscall(SYS_unshare, CLONE_NEWUSER));
    REFUSED(syscall(SYS_setns, ends[0], 0));
    REFUSED(setsid());
    REFUSED(setpgid(0, 0));
    REFUSED(syscall(SYS_execve, "/bin/true", NULL, NULL));
    REFUSED(syscall(SYS_execveat, ends[0], "", NULL, NULL, AT_EMPTY_PATH));
    REFUSED(syscall(SYS_memfd_create, "a", 0));
    REFUSED(syscall(SYS_personality, 0x0400000 /* READ_IMPLIES_EXEC */));
}

static void change_files(void) {
    struct timespec times[2] = {{.tv_nsec = UTIME_NOW}, {.tv_nsec = UTIME_NOW}};
    char handle[64] = {0};
    int mount, folder = open(writable, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    CHECK(folder >= 0);
#ifdef SYS_chmod
    REFUSED(syscall(SYS_chmod, data, 0777));
    REFUSED(syscall(SYS_chown, data, 0, 0));
    REFUSED(syscall(SYS_lchown, data, 0, 0));
    REFUSED(syscall(SYS_utime, data, NULL));
    REFUSED(syscall(SYS_utimes, data, NULL));
    REFUSED(syscall(SYS_futimesat, AT_FDCWD, data, NULL));
    REFUSED(syscall(SYS_mknod, photo, S_IFIFO | 0600, 0));
    REFUSED(syscall(SYS_link, photo, "link"));
    REFUSED(syscall(SYS_symlink, photo, "link"));
    REFUSED(syscall(SYS_creat, photo, 0600));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) /* their own way to open files */
    REFUSED(syscall(SYS_open, photo, O_RDONLY | O_TRUNC));
#endif
#endif
    REFUSED(syscall(SYS_fchmodat, AT_FDCWD, data, 0777));
    REFUSED(syscall(NUMBER_FCHMODAT2, AT_FDCWD, data, 0777, 0));
    REFUSED(syscall(SYS_fchmod, folder, 0777));
    REFUSED(syscall(SYS_fchown, folder, 0, 0));
    REFUSED(syscall(SYS_fchownat, AT_FDCWD, data, 0, 0, 0));
    REFUSED(syscall(SYS_utimensat, AT_FDCWD, data, times, 0));
    REFUSED(syscall(SYS_setxattr, data, "user.a", "b", 1, 0));
    REFUSED(syscall(SYS_lsetxattr, data, "user.a", "b", 1, 0));
    REFUSED(syscall(SYS_fsetxattr, folder, "user.a", "b", 1, 0));
    REFUSED(syscall(SYS_removexattr, data, "user.a"));
    REFUSED(syscall(SYS_fremovexattr, folder, "user.a"));
    REFUSED(syscall(NUMBER_SETXATTRAT, AT_FDCWD, data, 0, "user.a", handle, 16));
    REFUSED(syscall(NUMBER_FILE_SETATTR, AT_FDCWD, data, handle, 24, 0));
    REFUSED(syscall(SYS_mknodat, AT_FDCWD, photo, S_IFIFO | 0600, 0));
    REFUSED(syscall(SYS_linkat, AT_FDCWD, photo, AT_FDCWD, "link", 0));
    REFUSED(syscall(SYS_symlinkat, photo, AT_FDCWD, "link"));
    REFUSED(syscall(SYS_truncate, photo, 0));
    REFUSED(open(photo, O_RDONLY | O_TRUNC | O_CLOEXEC));
    REFUSED(syscall(SYS_openat2, AT_FDCWD, photo, handle, 24));
    REFUSED(syscall(SYS_name_to_handle_at, AT_FDCWD, data, handle, &mount, 0));
    REFUSED(syscall(SYS_open_by_handle_at, folder, handle, O_RDONLY));
    REFUSED(syscall(SYS_inotify_init1, 0));
    REFUSED(syscall(SYS_fanotify_init, 0, 0));
    REFUSED(syscall(SYS_chdir, "/"));
    REFUSED(syscall(SYS_fchdir, folder));
    REFUSED(syscall(SYS_chroot, "/"));
    REFUSED(syscall(SYS_pivot_root, "/", "/"));
    REFUSED(syscall(SYS_mount, NULL, NULL, NULL, 0, NULL));
    REFUSED(syscall(SYS_umount2, NULL, 0));
    REFUSED(syscall(SYS_open_tree, AT_FDCWD, "/", 0));
    REFUSED(syscall(SYS_move_mount, 0, "", 0, "", 0));
    REFUSED(syscall(SYS_fsopen, "tmpfs", 0));
    REFUSED(syscall(SYS_quotactl, 0, "/", 0, NULL));
    close(folder);
}

static void go_by_side_doors(void) {
    char parameters[256] = {0};
    REFUSED(syscall(SYS_io_uring_setup, 1, parameters));
    REFUSED(syscall(SYS_io_setup, 1, parameters));
    REFUSED(syscall(SYS_bpf, 0, parameters, 64));
    REFUSED(syscall(SYS_perf_event_open, parameters, 0, -1, -1, 0));
    REFUSED(syscall(SYS_userfaultfd, 0));
    REFUSED(syscall(SYS_setuid, getuid()));
    REFUSED(syscall(SYS_setgid, getgid()));
    REFUSED(syscall(SYS_setgroups, 0, NULL));
    REFUSED(syscall(SYS_capset, parameters, parameters));
    REFUSED(syscall(SYS_sethostname, NULL, 1));
    REFUSED(syscall(SYS_settimeofday, NULL, NULL));
    REFUSED(syscall(SYS_clock_settime, 0, parameters));
    REFUSED(syscall(SYS_adjtimex, parameters));
    REFUSED(syscall(SYS_syslog, 10, NULL, 0));
    REFUSED(syscall(SYS_init_module, parameters, 1, ""));
    REFUSED(syscall(SYS_finit_module, ends[0], "", 0));
    REFUSED(syscall(SYS_delete_module, "a", 0));
    REFUSED(syscall(SYS_kexec_load, 0, 0, NULL, 0));
    REFUSED(syscall(SYS_reboot, 0, 0, 0, NULL));
    REFUSED(syscall(SYS_swapon, NULL, 0));
    REFUSED(syscall(SYS_acct, ""));
    REFUSED(syscall(SYS_mlockall, 1));
    REFUSED(syscall(SYS_tee, ends[0], ends[1], 1, 0));
    REFUSED(syscall(SYS_vmsplice, ends[1], NULL, 0, 0));
    REFUSED(ioctl(ends[0], TIOCSTI, "x"));
    REFUSED(fcntl(ends[0], F_SETPIPE_SZ, 1 << 20));
}

/* --- sockets ---------------------------------------------------------------------------------------------- */

/* Of a process that may call others, nothing but TCP and UDP over IP. */
static void open_other_sockets(void) {
    int pair[2];
    REFUSED(socket(AF_UNIX, SOCK_STREAM, 0)); /* behind these is admin.sock, which asks nobody for a token */
    REFUSED(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    REFUSED(socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    REFUSED(socket(AF_NETLINK, SOCK_RAW, 0));
    REFUSED(socket(AF_PACKET, SOCK_RAW, 0));
    REFUSED(socket(AF_VSOCK, SOCK_STREAM, 0));
    REFUSED(socket(AF_ALG, SOCK_SEQPACKET, 0));
    REFUSED(socket(AF_INET, SOCK_RAW, IPPROTO_ICMP));
    REFUSED(socket(AF_INET, SOCK_DGRAM, IPPROTO_ICMP));
    REFUSED(socket(AF_INET6, SOCK_RAW, IPPROTO_RAW));
    REFUSED(socket(AF_INET, SOCK_SEQPACKET, 0));
    REFUSED(socket(AF_INET, SOCK_STREAM, 262 /* IPPROTO_MPTCP: Landlock sees TCP alone */));
    REFUSED(socket(AF_INET, SOCK_STREAM, IPPROTO_SCTP));
    REFUSED(syscall(SYS_socket, (1UL << 32) | AF_UNIX, SOCK_STREAM, 0));
}

static void call_others(void) {
    struct sockaddr_in daemon = loopback(port), other = loopback(1);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), on = 1;
    CHECK(fd >= 0);
    REFUSED(sendto(fd, "x", 1, MSG_FASTOPEN, (struct sockaddr *)&daemon, sizeof daemon));
    REFUSED(setsockopt(fd, IPPROTO_TCP, TCP_FASTOPEN_CONNECT, &on, sizeof on));
    REFUSED(setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &on, sizeof on));
    REFUSED(bind(fd, (struct sockaddr *)&other, sizeof other));
    REFUSED(listen(fd, 1));
    REFUSED(accept4(fd, NULL, NULL, 0));
    struct timeval patience = {.tv_sec = 10};
    CHECK(setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience) == 0);
    CHECK(connect(fd, (struct sockaddr *)&daemon, sizeof daemon) == 0);
    CHECK(confine_to_connection());
    CHECK(send(fd, "x", 1, MSG_NOSIGNAL) == 1);
    struct sockaddr nowhere = {.sa_family = AF_UNSPEC}; /* would free the socket for another call */
    REFUSED(connect(fd, &nowhere, sizeof nowhere));
    REFUSED(connect(fd, (struct sockaddr *)&other, sizeof other));
    REFUSED(sendto(fd, "x", 1, 0, (struct sockaddr *)&other, sizeof other));
    REFUSED(socket(AF_INET, SOCK_STREAM, 0));
    REFUSED(socket(AF_INET6, SOCK_DGRAM, 0));
    close(fd);
}

/* --- the processes ----------------------------------------------------------------------------------------- */

static int in_child(int (*work)(bool), bool network) {
    int status;
    fflush(stdout);
    pid_t child = fork();
    if (child == 0)
        exit(work(network));
    CHECK(waitpid(child, &status, 0) == child);
    return status;
}

static int attack(bool network) {
    struct sandbox_result result;
    struct sandbox sandbox = {.write_dir = writable, .read_dir = {readable}, .connect_port = network ? port : 0};
    sandbox_enter(&sandbox, &result);
    if (!result.system_calls || !result.files) {
        printf("%s\n", result.text);
        return 77;
    }
    send_signals();
    reach_others();
    make_processes();
    change_files();
    go_by_side_doors();
    if (network) {
        open_other_sockets();
        call_others();
    } else {
        REFUSED(socket(AF_INET, SOCK_STREAM, 0));
        REFUSED(socket(AF_UNIX, SOCK_STREAM, 0));
        REFUSED(syscall(SYS_connect, ends[0], NULL, 0));
        REFUSED(syscall(SYS_seccomp, 0, 0, NULL));
    }
    return check_result();
}

/* Landlock alone refuses, too, where the kernel is new enough. */
static int attack_files(bool network) {
    struct sandbox sandbox = {.write_dir = network ? NULL : writable, .connect_port = network ? port : 0};
    struct sockaddr_in daemon = loopback(port), other = loopback((uint16_t)(port ^ 1));
    struct sockaddr_un abstract;
    long version = syscall(SYS_landlock_create_ruleset, NULL, 0, 1);
    CHECK(prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && confine_files(&sandbox));
    CHECK(open(writable, O_RDONLY | O_DIRECTORY) < 0 || !network);
    CHECK(open("/etc/resolv.conf", O_RDONLY) >= 0 || !network || access("/etc/resolv.conf", F_OK) != 0);
    CHECK(open("/etc/ssl/private", O_RDONLY | O_DIRECTORY) < 0);
    CHECK(open("/proc/1/environ", O_RDONLY) < 0);
    CHECK(open(photo, O_RDONLY) < 0 && errno == EACCES);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (version >= 4) {
        CHECK(connect(fd, (struct sockaddr *)&other, sizeof other) != 0 && errno == EACCES);
        CHECK((connect(fd, (struct sockaddr *)&daemon, sizeof daemon) == 0) == network);
    }
    if (version >= 6) {
        CHECK(kill(victim, 0) != 0 && errno == EPERM);
        CHECK(fcntl(ends[0], F_SETSIG, SIGKILL) == 0 && fcntl(ends[0], F_SETOWN, victim) == 0 &&
              fcntl(ends[0], F_SETFL, O_ASYNC) == 0 && write(ends[1], "x", 1) == 1); /* and the victim lives */
        int local = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        socklen_t length = socket_path(&abstract, true);
        CHECK(connect(local, (struct sockaddr *)&abstract, length) != 0 && errno == EPERM);
        close(local);
    }
    close(fd);
    return check_result();
}

int main(void) {
    set_up();
    int status = in_child(attack, false);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77) {
        look_at_others();
        return 77;
    }
    CHECK_THAT(status == 0, "worker: wait status %x", (unsigned)status);
    CHECK_THAT((status = in_child(attack, true)) == 0, "webhook: wait status %x", (unsigned)status);
    CHECK_THAT((status = in_child(attack_files, false)) == 0, "files: wait status %x", (unsigned)status);
    CHECK_THAT((status = in_child(attack_files, true)) == 0, "files, network: wait status %x", (unsigned)status);
    look_at_others();
    mem_free(data);
    mem_free(writable);
    mem_free(readable);
    mem_free(photo);
    return check_result();
}
