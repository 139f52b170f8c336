/* sandbox.c -- see sandbox.h. Landlock has no library: its three system calls are made by hand,
 * with the constants that the build machine's headers may be too old to have. */
#include "server/worker/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <seccomp.h>
#include <stdio.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "common/mem.h"

#ifndef LANDLOCK_ACCESS_FS_REFER
#define LANDLOCK_ACCESS_FS_REFER (1ULL << 13) /* version 2 */
#endif
#ifndef LANDLOCK_ACCESS_FS_TRUNCATE
#define LANDLOCK_ACCESS_FS_TRUNCATE (1ULL << 14) /* version 3 */
#endif

#define READ_ACCESS (LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR)
#define WRITE_ACCESS                                                                           \
    (READ_ACCESS | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |             \
     LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG)
/* Everything of version 1: bits 0 (execute) to 12 (make a symbolic link). */
#define ACCESS_1 ((1ULL << 13) - 1)

static bool allow(int ruleset, const char *path, uint64_t access) {
    struct landlock_path_beneath_attr rule = {.allowed_access = access};
    rule.parent_fd = open(path, O_PATH | O_CLOEXEC);
    if (rule.parent_fd < 0)
        return errno == ENOENT; /* what is not there needs no rule */
    long result = syscall(SYS_landlock_add_rule, ruleset, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
    close(rule.parent_fd);
    return result == 0;
}

static bool restrict_files(const struct sandbox *sandbox) {
    /* What the loader, the threading library and the C library look at while they run. */
    static const char *const folders[] = {"/usr", "/lib", "/lib64", "/proc/self", "/sys"};
    static const char *const files[] = {"/etc/ld.so.cache", "/etc/localtime", "/proc/cpuinfo",
                                        "/proc/meminfo",    "/proc/stat",     "/dev/urandom",
                                        "/dev/null"};
    long version = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
    if (version < 1)
        return false;
    uint64_t later = (version >= 2 ? LANDLOCK_ACCESS_FS_REFER : 0) |
                     (version >= 3 ? LANDLOCK_ACCESS_FS_TRUNCATE : 0);
    struct landlock_ruleset_attr attributes = {.handled_access_fs = ACCESS_1 | later};
    int ruleset = (int)syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0);
    if (ruleset < 0)
        return false;
    bool ok = allow(ruleset, sandbox->write_dir, WRITE_ACCESS | later);
    if (sandbox->read_dir)
        ok = ok && allow(ruleset, sandbox->read_dir, READ_ACCESS);
#ifdef COVERAGE_DIR /* make coverage: each process leaves its counts there when it ends */
    ok = ok && allow(ruleset, COVERAGE_DIR, WRITE_ACCESS | later);
#endif
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++)
        ok = ok && allow(ruleset, folders[i], READ_ACCESS);
    /* Resolvers and certificates. */
    static const char *const places[] = {"/etc/resolv.conf", "/etc/hosts", "/etc/nsswitch.conf", "/etc/gai.conf",
                                         "/etc/host.conf", "/etc/services"};
    static const char *const trees[] = {"/etc/ssl", "/run/systemd/resolve"};
    for (size_t i = 0; sandbox->network && i < sizeof places / sizeof places[0]; i++)
        ok = ok && allow(ruleset, places[i], LANDLOCK_ACCESS_FS_READ_FILE);
    for (size_t i = 0; sandbox->network && i < sizeof trees / sizeof trees[0]; i++)
        ok = ok && allow(ruleset, trees[i], READ_ACCESS);
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        ok = ok && allow(ruleset, files[i], LANDLOCK_ACCESS_FS_READ_FILE);
    ok = ok && syscall(SYS_landlock_restrict_self, ruleset, 0) == 0;
    close(ruleset);
    return ok;
}

/* Whether a call of libseccomp did it. A system without memory is not one that cannot. */
static bool done(int result) {
    if (result == -ENOMEM)
        mem_exhausted("libseccomp");
    return result == 0;
}

/* A list of what is refused: what the engine's libraries need is not ours to know, what an
 * intruder needs first is. */
static bool restrict_system_calls(bool network) {
    static const int refused[] = {
        SCMP_SYS(socket), SCMP_SYS(io_uring_setup), /* the network, also by the side door */
        SCMP_SYS(execve), SCMP_SYS(execveat),
#ifndef __SANITIZE_ADDRESS__ /* its leak check traces its own process */
        SCMP_SYS(ptrace),
#endif
        SCMP_SYS(process_vm_readv), SCMP_SYS(process_vm_writev), SCMP_SYS(pidfd_getfd),
        SCMP_SYS(pidfd_send_signal), SCMP_SYS(rt_sigqueueinfo), SCMP_SYS(rt_tgsigqueueinfo),
        SCMP_SYS(tkill), SCMP_SYS(bpf), SCMP_SYS(perf_event_open), SCMP_SYS(userfaultfd),
        SCMP_SYS(keyctl), SCMP_SYS(add_key), SCMP_SYS(request_key), SCMP_SYS(mount),
        SCMP_SYS(umount2), SCMP_SYS(pivot_root), SCMP_SYS(chroot), SCMP_SYS(unshare),
        SCMP_SYS(setns), SCMP_SYS(open_by_handle_at), SCMP_SYS(init_module),
        SCMP_SYS(finit_module), SCMP_SYS(delete_module), SCMP_SYS(kexec_load), SCMP_SYS(reboot),
        SCMP_SYS(swapon), SCMP_SYS(swapoff), SCMP_SYS(setuid), SCMP_SYS(setgid),
    };
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    if (!filter)
        mem_exhausted("libseccomp");
    bool ok = true;
    for (size_t i = network ? 1 : 0; ok && i < sizeof refused / sizeof refused[0]; i++) /* socket is first */
        ok = done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), refused[i], 0));
    /* Signals only to itself (abort), limits only of itself. */
    scmp_datum_t self = (scmp_datum_t)getpid();
    ok = ok &&
         done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(kill), 1,
                               SCMP_A0(SCMP_CMP_NE, self, 0))) &&
         done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(tgkill), 1,
                               SCMP_A0(SCMP_CMP_NE, self, 0))) &&
         done(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prlimit64), 1,
                               SCMP_A0(SCMP_CMP_NE, 0, 0)));
    ok = ok && done(seccomp_load(filter));
    seccomp_release(filter);
    return ok;
}

static bool limit_memory(uint64_t bytes) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    (void)bytes; /* the sanitizers' shadow memory is larger than any limit */
    return false;
#else
    struct rlimit limit = {.rlim_cur = bytes, .rlim_max = bytes};
    return setrlimit(RLIMIT_DATA, &limit) == 0;
#endif
}

void sandbox_enter(const struct sandbox *sandbox, struct sandbox_result *result) {
    *result = (struct sandbox_result){0};
    struct rlimit none = {0, 0};
    setrlimit(RLIMIT_CORE, &none);
    result->memory = sandbox->memory_bytes == 0 || limit_memory(sandbox->memory_bytes);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0) {
        result->files = restrict_files(sandbox);
        result->system_calls = restrict_system_calls(sandbox->network);
    }
    if (result->files && result->system_calls && result->memory)
        snprintf(result->text, sizeof result->text,
                 "sandbox: no network, no new programs, only the job's folder is writable");
    else
        snprintf(result->text, sizeof result->text, "sandbox: this system cannot%s%s%s",
                 result->files ? "" : " confine files (Landlock);",
                 result->system_calls ? "" : " refuse network and programs (seccomp);",
                 result->memory ? "" : " limit memory;");
}
