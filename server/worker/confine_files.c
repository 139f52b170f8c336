/* confine_files.c -- see confine.h. Landlock has no library: its three system calls are made by hand, with
 * the constants and the attributes that the build machine's headers may be too old to have. */
#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "server/worker/confine.h"

/* ABI versions; linux/landlock.h of Debian 12 ends with version 2. */
#define VERSION_REFER 2    /* Linux 5.19 */
#define VERSION_TRUNCATE 3 /* 6.2 */
#define VERSION_NETWORK 4  /* 6.7 */
#define VERSION_IOCTL 5    /* 6.10 */
#define VERSION_SCOPE 6    /* 6.12 */

/* All rights of version 1: bits 0 (execute) to 12 (create a symbolic link). */
#define ACCESS_1 ((1ULL << 13) - 1)
#define ACCESS_REFER (1ULL << 13)
#define ACCESS_TRUNCATE (1ULL << 14)
#define ACCESS_IOCTL (1ULL << 15) /* ioctl on devices */
#define CONNECT_TCP (1ULL << 1)
#define BIND_TCP (1ULL << 0)
#define SCOPE_ABSTRACT_SOCKET (1ULL << 0)
#define SCOPE_SIGNAL (1ULL << 1)
#define RULE_NET_PORT 2 /* LANDLOCK_RULE_NET_PORT */

#define READ_ACCESS (LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR)
#define WRITE_ACCESS                                                                                                   \
    (READ_ACCESS | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR | LANDLOCK_ACCESS_FS_REMOVE_FILE |    \
     LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG)

#define DNS_PORT 53 /* long replies come by TCP */

/* struct landlock_ruleset_attr as of version 6. An older kernel accepts it if the members that it does not know are
 * 0. */
struct ruleset_attributes {
    uint64_t files, network, scoped;
};

struct port_attributes {
    uint64_t access, port;
};

static bool allow(int ruleset, const char *path, uint64_t access) {
    struct landlock_path_beneath_attr rule = {.allowed_access = access};
    rule.parent_fd = open(path, O_PATH | O_CLOEXEC); /* follows links: the rule applies to their present target */
    if (rule.parent_fd < 0)
        return errno == ENOENT; /* a missing path needs no rule */
    long result = syscall(SYS_landlock_add_rule, ruleset, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
    close(rule.parent_fd);
    return result == 0;
}

static bool allow_port(int ruleset, uint16_t port) {
    struct port_attributes rule = {.access = CONNECT_TCP, .port = port};
    return syscall(SYS_landlock_add_rule, ruleset, RULE_NET_PORT, &rule, 0) == 0;
}

static bool allow_all(int ruleset, const char *const *paths, size_t count, uint64_t access) {
    bool ok = true;
    for (size_t i = 0; ok && i < count; i++)
        ok = allow(ruleset, paths[i], access);
    return ok;
}

#define COUNT(list) (sizeof list / sizeof *list)

static bool allow_system(int ruleset) {
    /* Used by the loader and by the threading and C libraries at run time. */
    static const char *const folders[] = {"/usr",         "/lib",           "/lib64",        "/proc/self",
                                          "/sys/devices", "/sys/fs/cgroup", "/sys/kernel/mm"};
    static const char *const files[] = {"/etc/ld.so.cache", "/etc/localtime", "/proc/cpuinfo", "/proc/meminfo",
                                        "/proc/stat",       "/dev/urandom",   "/dev/null"};
    return allow_all(ruleset, folders, COUNT(folders), READ_ACCESS) &&
           allow_all(ruleset, files, COUNT(files), LANDLOCK_ACCESS_FS_READ_FILE);
}

/* For resolving a server's name and verifying its certificate. */
static bool allow_network(int ruleset, long version, uint16_t port) {
    static const char *const files[] = {"/etc/resolv.conf", "/etc/hosts",     "/etc/nsswitch.conf",
                                        "/etc/gai.conf",    "/etc/host.conf", "/etc/services"};
    bool ok = allow_all(ruleset, files, COUNT(files), LANDLOCK_ACCESS_FS_READ_FILE) &&
              allow(ruleset, "/etc/ssl/certs", READ_ACCESS);
    if (version >= VERSION_NETWORK)
        ok = ok && allow_port(ruleset, DNS_PORT) && allow_port(ruleset, port);
    return ok;
}

bool confine_files(const struct sandbox *sandbox) {
    long version = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
    if (version < 1)
        return false;
    uint64_t later =
        (version >= VERSION_REFER ? ACCESS_REFER : 0) | (version >= VERSION_TRUNCATE ? ACCESS_TRUNCATE : 0);
    struct ruleset_attributes attributes = {
        .files = ACCESS_1 | later | (version >= VERSION_IOCTL ? ACCESS_IOCTL : 0),
        .network = version >= VERSION_NETWORK ? BIND_TCP | CONNECT_TCP : 0,
        .scoped = version >= VERSION_SCOPE ? SCOPE_ABSTRACT_SOCKET | SCOPE_SIGNAL : 0,
    };
    int ruleset = (int)syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0);
    if (ruleset < 0)
        return false;
    bool ok = allow_system(ruleset);
    if (sandbox->write_dir)
        ok = ok && allow(ruleset, sandbox->write_dir, WRITE_ACCESS | later);
    for (size_t i = 0; i < SANDBOX_READ_DIRS; i++)
        if (sandbox->read_dir[i])
            ok = ok && allow(ruleset, sandbox->read_dir[i], READ_ACCESS);
    if (sandbox->connect_port)
        ok = ok && allow_network(ruleset, version, sandbox->connect_port);
#ifdef COVERAGE_DIR /* make coverage: each process writes its counts there */
    ok = ok && allow(ruleset, COVERAGE_DIR, WRITE_ACCESS | later);
#endif
    ok = ok && syscall(SYS_landlock_restrict_self, ruleset, 0) == 0;
    close(ruleset);
    return ok;
}
