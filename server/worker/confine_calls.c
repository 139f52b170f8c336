/* confine_calls.c -- see confine.h.
 *
 * What is not listed fails with ENOSYS, as on a kernel that lacks it: libraries then take the older way
 * (glibc's clone3 becomes clone, whose flags a filter can see), and a later kernel's calls are refused before
 * anybody here has heard of them. Nothing listed reaches another process or outlives this one, and nothing
 * changes a file but through a descriptor or a name that Landlock has let through. Landlock does not guard
 * chmod, chown, utimes and setxattr, and before Linux 6.2 not truncate: none of these is listed. */
#include <asm/termbits.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/sched.h>
#include <netinet/in.h>
#include <seccomp.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/worker/confine.h"

#ifdef __SANITIZE_ADDRESS__
#define IS_ASAN 1
#else
#define IS_ASAN 0
#endif

/* With any arguments. */
static const int plain[] = {
    /* memory */
    SCMP_SYS(brk),
    SCMP_SYS(madvise),
    SCMP_SYS(mmap),
    SCMP_SYS(mprotect),
    SCMP_SYS(mremap),
    SCMP_SYS(msync),
    SCMP_SYS(munmap),
    /* threads */
    SCMP_SYS(exit),
    SCMP_SYS(exit_group),
    SCMP_SYS(futex),
    SCMP_SYS(getcpu),
    SCMP_SYS(gettid),
    SCMP_SYS(membarrier),
    SCMP_SYS(rseq),
    SCMP_SYS(sched_getaffinity),
    SCMP_SYS(sched_yield),
    SCMP_SYS(set_robust_list),
    SCMP_SYS(set_tid_address),
    /* time */
    SCMP_SYS(clock_getres),
    SCMP_SYS(clock_gettime),
    SCMP_SYS(clock_nanosleep),
    SCMP_SYS(getrusage),
    SCMP_SYS(gettimeofday),
    SCMP_SYS(nanosleep),
    SCMP_SYS(time),
    SCMP_SYS(times),
    /* handling signals */
    SCMP_SYS(pause),
    SCMP_SYS(restart_syscall),
    SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigpending),
    SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigreturn),
    SCMP_SYS(rt_sigsuspend),
    SCMP_SYS(rt_sigtimedwait),
    SCMP_SYS(sigaltstack),
    /* identity and location */
    SCMP_SYS(getcwd),
    SCMP_SYS(getegid),
    SCMP_SYS(geteuid),
    SCMP_SYS(getgid),
    SCMP_SYS(getpid),
    SCMP_SYS(getppid),
    SCMP_SYS(getrandom),
    SCMP_SYS(getrlimit),
    SCMP_SYS(getuid),
    SCMP_SYS(sysinfo),
    SCMP_SYS(uname),
    /* descriptors */
    SCMP_SYS(close),
    SCMP_SYS(dup),
    SCMP_SYS(dup2),
    SCMP_SYS(dup3),
    SCMP_SYS(fadvise64),
    SCMP_SYS(fallocate),
    SCMP_SYS(fdatasync),
    SCMP_SYS(flock),
    SCMP_SYS(fstat),
    SCMP_SYS(fstatfs),
    SCMP_SYS(fsync),
    SCMP_SYS(ftruncate),
    SCMP_SYS(getdents64),
    SCMP_SYS(lseek),
    SCMP_SYS(poll),
    SCMP_SYS(ppoll),
    SCMP_SYS(pread64),
    SCMP_SYS(preadv),
    SCMP_SYS(pselect6),
    SCMP_SYS(pwrite64),
    SCMP_SYS(pwritev),
    SCMP_SYS(read),
    SCMP_SYS(readv),
    SCMP_SYS(select),
    SCMP_SYS(sync_file_range),
    SCMP_SYS(syncfs),
    SCMP_SYS(write),
    SCMP_SYS(writev),
    /* names: Landlock decides what may be opened, created, renamed and removed */
    SCMP_SYS(access),
    SCMP_SYS(faccessat),
    SCMP_SYS(faccessat2),
    SCMP_SYS(lstat),
    SCMP_SYS(mkdir),
    SCMP_SYS(mkdirat),
    SCMP_SYS(newfstatat),
    SCMP_SYS(readlink),
    SCMP_SYS(readlinkat),
    SCMP_SYS(rename),
    SCMP_SYS(renameat),
    SCMP_SYS(renameat2),
    SCMP_SYS(rmdir),
    SCMP_SYS(stat),
    SCMP_SYS(statfs),
    SCMP_SYS(statx),
    SCMP_SYS(unlink),
    SCMP_SYS(unlinkat),
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) /* the sanitizers' own calls */
    SCMP_SYS(getdents),
    SCMP_SYS(mincore),
    SCMP_SYS(open),
    SCMP_SYS(pipe),
    SCMP_SYS(pipe2),
#endif
#ifdef __SANITIZE_ADDRESS__ /* LeakSanitizer traces its threads from a process that shares their memory */
    SCMP_SYS(prctl),
    SCMP_SYS(ptrace),
    SCMP_SYS(wait4),
#endif
};

static const int
    plain_network
        [] =
            {
                SCMP_SYS(getpeername), SCMP_SYS(getsockname), SCMP_SYS(getsockopt), SCMP_SYS(connect),
                SCMP_SYS(recvfrom),    SCMP_SYS(recvmmsg),    SCMP_SYS(recvmsg),    SCMP_SYS(shutdown),
                SCMP_SYS(seccomp), /* for confine_to_connection; it can only restrict further */
};

/* Checks a result of libseccomp. Out of memory ends the process; it does not mean that seccomp is missing. */
static bool done(int result) {
    if (result == -ENOMEM)
        mem_exhausted("libseccomp");
    return result == 0;
}

#define ALLOW(filter, call, count, ...)                                                                                \
    done(seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(call), count, __VA_ARGS__))

/* A negative number is a call that this architecture lacks. */
static bool allow_all(scmp_filter_ctx filter, const int *calls, size_t count) {
    bool ok = true;
    for (size_t i = 0; ok && i < count; i++)
        ok = calls[i] < 0 || done(seccomp_rule_add(filter, SCMP_ACT_ALLOW, calls[i], 0));
    return ok;
}

/* Threads as pthread_create makes them; no processes, which could outlive this one, and no namespaces. Other clone
 * flags have no effect on others. */
static bool allow_threads(scmp_filter_ctx filter) {
    static const scmp_datum_t needed = CLONE_VM | CLONE_SIGHAND | CLONE_THREAD,
                              harmless = CLONE_FS | CLONE_FILES | CLONE_SYSVSEM | CLONE_SETTLS | CLONE_PARENT_SETTID |
                                         CLONE_CHILD_CLEARTID | CLONE_CHILD_SETTID | CLONE_DETACHED,
                              leak_check = CLONE_VM | CLONE_FS | CLONE_FILES | CLONE_UNTRACED;
    return ALLOW(filter, clone, 1, SCMP_A0(SCMP_CMP_MASKED_EQ, ~harmless, needed)) &&
           (!IS_ASAN || ALLOW(filter, clone, 1, SCMP_A0(SCMP_CMP_EQ, leak_check, 0)));
}

/* Signals to itself only (abort); limits are read-only, and its own. Naming a thread is allowed, changing
 * PR_SET_PDEATHSIG is not. */
static bool allow_on_itself(scmp_filter_ctx filter) {
    scmp_datum_t self = (scmp_datum_t)getpid();
    return ALLOW(filter, kill, 1, SCMP_A0(SCMP_CMP_EQ, self, 0)) &&
           ALLOW(filter, tgkill, 1, SCMP_A0(SCMP_CMP_EQ, self, 0)) &&
           ALLOW(filter, prlimit64, 2, SCMP_A0(SCMP_CMP_EQ, 0, 0), SCMP_A2(SCMP_CMP_EQ, 0, 0)) &&
           (IS_ASAN || ALLOW(filter, prctl, 1, SCMP_A0(SCMP_CMP_EQ, PR_SET_NAME, 0)));
}

/* No fcntl or ioctl that makes the kernel send signals (F_SETOWN, F_SETSIG, O_ASYNC, leases; FIOASYNC, SIOCSPGRP).
 * No truncation by name: before Linux 6.2 Landlock does not guard it. */
static bool allow_on_descriptors(scmp_filter_ctx filter) {
    static const int commands[] = {F_DUPFD, F_DUPFD_CLOEXEC, F_GETFD, F_SETFD, F_GETFL, F_GETLK, F_SETLK, F_SETLKW};
    bool ok = ALLOW(filter, ioctl, 1, SCMP_A1(SCMP_CMP_EQ, TCGETS, 0)) && /* isatty */
              ALLOW(filter, openat, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, O_TRUNC, 0)) &&
              ALLOW(filter, openat, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, O_ACCMODE, O_WRONLY)) &&
              ALLOW(filter, openat, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, O_ACCMODE, O_RDWR));
    for (size_t i = 0; ok && i < sizeof commands / sizeof *commands; i++)
        ok = ALLOW(filter, fcntl, 1, SCMP_A1(SCMP_CMP_EQ, (scmp_datum_t)commands[i], 0));
    return ok;
}

/* TCP and UDP over IP only: no Unix sockets (other services, the daemon's admin.sock), netlink, raw packets, or
 * protocols that Landlock does not check. MSG_FASTOPEN would connect without connect(). */
static bool allow_sockets(scmp_filter_ctx filter) {
    static const struct {
        scmp_datum_t type, protocol;
    } kinds[] = {{SOCK_STREAM, 0}, {SOCK_STREAM, IPPROTO_TCP}, {SOCK_DGRAM, 0}, {SOCK_DGRAM, IPPROTO_UDP}};
    static const scmp_datum_t families[] = {AF_INET, AF_INET6}, flags = SOCK_CLOEXEC | SOCK_NONBLOCK;
    bool ok = ALLOW(filter, ioctl, 1, SCMP_A1(SCMP_CMP_EQ, FIONREAD, 0)) &&
              ALLOW(filter, sendto, 1, SCMP_A3(SCMP_CMP_MASKED_EQ, MSG_FASTOPEN, 0)) &&
              ALLOW(filter, sendmsg, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, MSG_FASTOPEN, 0)) &&
              ALLOW(filter, sendmmsg, 1, SCMP_A3(SCMP_CMP_MASKED_EQ, MSG_FASTOPEN, 0)) &&
              (IS_ASAN || ALLOW(filter, prctl, 1, SCMP_A0(SCMP_CMP_EQ, PR_SET_NO_NEW_PRIVS, 0)));
    for (size_t i = 0; i < 2; i++)
        for (size_t k = 0; ok && k < sizeof kinds / sizeof *kinds; k++)
            ok = ALLOW(filter, socket, 3, SCMP_A0(SCMP_CMP_EQ, families[i], 0),
                       SCMP_A1(SCMP_CMP_MASKED_EQ, ~flags, kinds[k].type), SCMP_A2(SCMP_CMP_EQ, kinds[k].protocol, 0));
    return ok;
}

/* Timeouts, and what the C library's resolver needs. */
static bool allow_socket_options(scmp_filter_ctx filter) {
    static const struct {
        scmp_datum_t level, name;
    } options[] = {
        {SOL_SOCKET, SO_SNDTIMEO}, {SOL_SOCKET, SO_RCVTIMEO}, {IPPROTO_IP, IP_RECVERR}, {IPPROTO_IPV6, IPV6_RECVERR}};
    bool ok = true;
    for (size_t i = 0; ok && i < sizeof options / sizeof *options; i++)
        ok = ALLOW(filter, setsockopt, 2, SCMP_A1(SCMP_CMP_EQ, options[i].level, 0),
                   SCMP_A2(SCMP_CMP_EQ, options[i].name, 0));
    return ok;
}

static scmp_filter_ctx filter_new(uint32_t otherwise) {
    scmp_filter_ctx filter = seccomp_init(otherwise);
    if (!filter)
        mem_exhausted("libseccomp");
    return filter;
}

static bool load(scmp_filter_ctx filter, bool ok) {
    ok = ok && done(seccomp_load(filter));
    seccomp_release(filter);
    return ok;
}

bool confine_calls(bool network) {
    scmp_filter_ctx filter = filter_new(SCMP_ACT_ERRNO(ENOSYS));
    bool ok = allow_all(filter, plain, sizeof plain / sizeof *plain) && allow_threads(filter) &&
              allow_on_itself(filter) && allow_on_descriptors(filter);
    if (network)
        ok = ok && allow_all(filter, plain_network, sizeof plain_network / sizeof *plain_network) &&
             allow_sockets(filter) && allow_socket_options(filter);
    return load(filter, ok);
}

bool confine_to_connection(void) {
    static const int refused[] = {SCMP_SYS(socket), SCMP_SYS(connect), SCMP_SYS(sendmmsg)};
    scmp_filter_ctx filter = filter_new(SCMP_ACT_ALLOW);
    bool ok = true;
    for (size_t i = 0; ok && i < sizeof refused / sizeof *refused; i++)
        ok = done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), refused[i], 0));
    /* No datagrams to other addresses either. */
    ok = ok && done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(sendto), 1, SCMP_A4(SCMP_CMP_NE, 0, 0)));
    return load(filter, ok);
}

void confine_library_version(char text[CONFINE_VERSION_SIZE]) {
    const struct scmp_version *version = seccomp_version();
    snprintf(text, CONFINE_VERSION_SIZE, "%u.%u.%u", version->major, version->minor, version->micro);
}
