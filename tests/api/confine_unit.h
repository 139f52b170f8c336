/* confine_unit.h -- the [Service] section of a systemd unit, as far as it hides or refuses something, put into effect
 * on the calling process. A line that is neither known here nor known to hide nothing ends the program: whoever adds
 * one to the unit teaches it to this file. */
#ifndef UNBAKE_TESTS_CONFINE_UNIT_H
#define UNBAKE_TESTS_CONFINE_UNIT_H

#include <errno.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <linux/mount.h>
#include <linux/sched.h>
#include <sched.h>
#include <seccomp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

struct unit {
    size_t count;
    struct {
        char name[64], value[512];
    } line[128];
};

static void must(int good, const char *what) {
    if (good)
        return;
    perror(what);
    exit(125);
}

static void unit_read(struct unit *u, const char *path) {
    char text[1024], section[64] = "";
    FILE *file = fopen(path, "re");
    must(file != NULL, path);
    *u = (struct unit){0};
    while (fgets(text, sizeof text, file)) {
        sscanf(text, "[%63[^]]]", section);
        if (strcmp(section, "Service") == 0 && u->count < 128 && text[0] != '#' &&
            sscanf(text, "%63[^=]=%511[^\n]", u->line[u->count].name, u->line[u->count].value) >= 1)
            u->count += strchr(text, '=') != NULL;
    }
    fclose(file);
}

/* NULL: there is no such line. */
static const char *unit_value(const struct unit *u, const char *name) {
    for (size_t i = 0; i < u->count; i++)
        if (strcmp(u->line[i].name, name) == 0)
            return u->line[i].value;
    return NULL;
}

static bool unit_is(const struct unit *u, const char *name, const char *value) {
    const char *found = unit_value(u, name);
    return found && strcmp(found, value) == 0;
}

static void unit_check_names(const struct unit *u) {
    static const char *const known[] = {
        /* put into effect below, or by confine.c */
        "UMask", "Environment", "ProtectSystem", "ProtectHome", "PrivateTmp", "PrivateDevices", "PrivateUsers",
        "ProtectProc", "ProcSubset", "ProtectKernelTunables", "ProtectControlGroups", "NoNewPrivileges",
        "CapabilityBoundingSet", "RestrictAddressFamilies", "RestrictNamespaces", "RestrictSUIDSGID",
        "RestrictRealtime", "LockPersonality", "MemoryDenyWriteExecute", "SystemCallErrorNumber", "SystemCallFilter",
        "WatchdogSec",
        /* of how it is started and stopped, or of what the lists above refuse anyway */
        "Type", "NotifyAccess", "User", "ExecStart", "ExecReload", "Restart", "RestartSec", "KillMode",
        "TimeoutStopSec", "LimitNOFILE", "OOMPolicy", "StateDirectory", "StateDirectoryMode", "PrivateMounts",
        "RemoveIPC", "KeyringMode", "AmbientCapabilities", "ProtectKernelModules", "ProtectKernelLogs", "ProtectClock",
        "ProtectHostname", "SystemCallArchitectures"};
    for (size_t i = 0; i < u->count; i++) {
        bool found = false;
        for (size_t k = 0; k < sizeof known / sizeof *known; k++)
            found = found || strcmp(u->line[i].name, known[k]) == 0;
        errno = EINVAL;
        must(found, u->line[i].name);
    }
}

/* --- the view of files: for root --------------------------------------------------------------------------- */

static void put_text(const char *path, const char *text) {
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    must(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text), path);
    close(fd);
}

static void make_dirs(const char *path) {
    char part[1024];
    for (size_t i = 1; i <= strlen(path); i++)
        if (path[i] == '/' || path[i] == '\0') {
            snprintf(part, sizeof part, "%.*s", (int)i, path);
            must(mkdir(part, 0755) == 0 || errno == EEXIST, part);
        }
}

static void mount_over(const char *what, const char *type, const char *where, const char *options) {
    must(syscall(SYS_mount, what, where, type, 0UL, options) == 0, where);
}

static int take_tree(const char *path) {
    int fd = (int)syscall(SYS_open_tree, AT_FDCWD, path, OPEN_TREE_CLONE | OPEN_TREE_CLOEXEC | AT_RECURSIVE);
    must(fd >= 0, path);
    return fd;
}

static void put_tree(int fd, const char *path) {
    must(syscall(SYS_move_mount, fd, "", AT_FDCWD, path, MOVE_MOUNT_F_EMPTY_PATH) == 0, path);
    close(fd);
}

static void set_read_only(const char *path, bool on) {
    struct mount_attr attributes = {.attr_set = on ? MOUNT_ATTR_RDONLY : 0, .attr_clr = on ? 0 : MOUNT_ATTR_RDONLY};
    must(syscall(SYS_mount_setattr, AT_FDCWD, path, AT_RECURSIVE, &attributes, sizeof attributes) == 0, path);
}

static void make_devices(void) {
    static const char *const names[] = {"null", "zero", "full", "random", "urandom", "tty"};
    int trees[6];
    char path[64];
    for (size_t i = 0; i < 6; i++) {
        snprintf(path, sizeof path, "/dev/%s", names[i]);
        trees[i] = take_tree(path);
    }
    mount_over("tmpfs", "tmpfs", "/dev", "mode=755");
    for (size_t i = 0; i < 6; i++) {
        snprintf(path, sizeof path, "/dev/%s", names[i]);
        put_text(path, "");
        put_tree(trees[i], path);
    }
    must(mkdir("/dev/shm", 01777) == 0, "/dev/shm");
    set_read_only("/dev", true);
}

/* `writable` stands for StateDirectory=; the folder `programs`, wherever it is, is to be seen at `at` (in /tmp). */
static void unit_hide(const struct unit *u, const char *writable, const char *programs, const char *at) {
    must(unshare(CLONE_NEWNS) == 0 && syscall(SYS_mount, "none", "/", NULL, (1UL << 14) | (1UL << 18), NULL) == 0,
         "a mount namespace"); /* MS_REC | MS_PRIVATE */
    int kept = take_tree(writable), tools = take_tree(programs);
    if (unit_is(u, "PrivateDevices", "yes"))
        make_devices();
    if (unit_is(u, "ProtectHome", "yes")) {
        mount_over("tmpfs", "tmpfs", "/home", "mode=000,ro");
        mount_over("tmpfs", "tmpfs", "/root", "mode=000,ro");
    }
    if (unit_is(u, "PrivateTmp", "yes")) {
        mount_over("tmpfs", "tmpfs", "/tmp", "mode=1777");
        mount_over("tmpfs", "tmpfs", "/var/tmp", "mode=1777");
    }
    make_dirs(writable);
    put_tree(kept, writable);
    make_dirs(at);
    put_tree(tools, at);
    if (unit_is(u, "ProtectSystem", "strict")) {
        static const char *const roots[] = {"/bin", "/boot", "/etc", "/lib", "/opt",
                                            "/run", "/sbin", "/srv", "/usr", "/var"};
        struct mount_attr root = {.attr_set = MOUNT_ATTR_RDONLY};
        for (size_t i = 0; i < sizeof roots / sizeof *roots; i++) {
            struct stat info; /* a mount of its own, or a part of the root's */
            if (stat(roots[i], &info) == 0 &&
                syscall(SYS_mount_setattr, AT_FDCWD, roots[i], AT_RECURSIVE, &root, sizeof root) != 0)
                must(errno == EINVAL, roots[i]);
        }
        must(syscall(SYS_mount_setattr, AT_FDCWD, "/", 0, &root, sizeof root) == 0, "/");
        set_read_only(writable, false);
    }
    if (unit_is(u, "ProtectKernelTunables", "yes") || unit_is(u, "ProtectControlGroups", "yes"))
        set_read_only("/sys", true);
    bool subset = unit_is(u, "ProcSubset", "pid"), invisible = unit_is(u, "ProtectProc", "invisible");
    if (subset || invisible)
        mount_over("proc", "proc", "/proc",
                   subset && invisible ? "hidepid=invisible,subset=pid"
                   : subset            ? "subset=pid"
                                       : "hidepid=invisible");
}

/* PrivateUsers= leaves its own user; CapabilityBoundingSet= nothing that root may do. */
static void unit_drop_rights(const struct unit *u) {
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct none[2] = {{0}};
    char map[64];
    if (unit_is(u, "PrivateUsers", "yes")) {
        snprintf(map, sizeof map, "%d %d 1\n", (int)getuid(), (int)getuid());
        must(unshare(CLONE_NEWUSER) == 0, "a user namespace");
        put_text("/proc/self/setgroups", "deny");
        put_text("/proc/self/uid_map", map);
        put_text("/proc/self/gid_map", map);
    }
    for (unsigned long i = 0; prctl(PR_CAPBSET_READ, i, 0, 0, 0) >= 0 && unit_is(u, "CapabilityBoundingSet", ""); i++)
        must(prctl(PR_CAPBSET_DROP, i, 0, 0, 0) == 0, "PR_CAPBSET_DROP");
    if (unit_is(u, "CapabilityBoundingSet", ""))
        must(syscall(SYS_capset, &header, none) == 0, "capset");
}

static void unit_set_environment(const struct unit *u) {
    const char *mask = unit_value(u, "UMask");
    umask(mask ? (mode_t)strtoul(mask, NULL, 8) : 022);
    for (size_t i = 0; i < u->count; i++) {
        char value[1024] = "", boot[64] = "";
        if (strcmp(u->line[i].name, "Environment") != 0)
            continue;
        snprintf(value, sizeof value, "%s", u->line[i].value);
        char *specifier = strstr(value, "%b");
        if (specifier) { /* the only one in use */
            FILE *file = fopen("/proc/sys/kernel/random/boot_id", "re");
            must(file && fgets(boot, sizeof boot, file), "boot_id");
            fclose(file);
            *specifier = '\0';
            for (const char *at = boot; *at && *at != '\n'; at++)
                if (*at != '-')
                    snprintf(value + strlen(value), sizeof value - strlen(value), "%c", *at);
        }
        must(strchr(value, '=') != NULL && putenv(strdup(value)) == 0, "Environment=");
    }
}

/* --- the filter of system calls ----------------------------------------------------------------------------- */

#define LET(filter, number, count, ...)                                                                                \
    must(seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, count, __VA_ARGS__) == 0, #__VA_ARGS__)

static void let_sockets(scmp_filter_ctx filter, const struct unit *u, int number) {
    static const struct {
        const char *name;
        int family;
    } families[] = {{"AF_UNIX", AF_UNIX}, {"AF_INET", AF_INET}, {"AF_INET6", AF_INET6}, {"AF_NETLINK", AF_NETLINK}};
    char list[512];
    snprintf(list, sizeof list, "%s", unit_value(u, "RestrictAddressFamilies"));
    char *rest = NULL;
    for (char *word = strtok_r(list, " ", &rest); word; word = strtok_r(NULL, " ", &rest))
        for (size_t i = 0; i < sizeof families / sizeof *families; i++)
            if (strcmp(word, families[i].name) == 0)
                LET(filter, number, 1, SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)families[i].family, 0));
}

/* What lines other than SystemCallFilter= refuse of a call that it lets through; false: nothing. */
static bool let_part(scmp_filter_ctx filter, const struct unit *u, const char *name, int number) {
    static const scmp_datum_t spaces = CLONE_NEWNS | CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET | CLONE_NEWUTS |
                                       CLONE_NEWIPC | CLONE_NEWCGROUP,
                              suid = S_ISUID | S_ISGID;
    bool no_wx = unit_is(u, "MemoryDenyWriteExecute", "yes"), no_spaces = unit_is(u, "RestrictNamespaces", "yes"),
         no_suid = unit_is(u, "RestrictSUIDSGID", "yes");
    if (no_wx && strcmp(name, "mmap") == 0) {
        LET(filter, number, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
        LET(filter, number, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC | PROT_WRITE, PROT_EXEC));
    } else if (no_wx && strcmp(name, "mprotect") == 0) {
        LET(filter, number, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
    } else if (no_spaces && strcmp(name, "clone") == 0) {
        LET(filter, number, 1, SCMP_A0(SCMP_CMP_MASKED_EQ, spaces, 0));
    } else if (no_spaces && strcmp(name, "clone3") == 0) {
        must(seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), number, 0) == 0, name);
    } else if (no_spaces && (strcmp(name, "unshare") == 0 || strcmp(name, "setns") == 0)) {
        return true;
    } else if (no_suid && (strcmp(name, "chmod") == 0 || strcmp(name, "fchmod") == 0)) {
        LET(filter, number, 1, SCMP_A1(SCMP_CMP_MASKED_EQ, suid, 0));
    } else if (no_suid && strcmp(name, "fchmodat") == 0) {
        LET(filter, number, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, suid, 0));
    } else if (unit_is(u, "RestrictRealtime", "yes") && strcmp(name, "sched_setscheduler") == 0) {
        LET(filter, number, 1, SCMP_A1(SCMP_CMP_EQ, SCHED_OTHER, 0));
    } else if (unit_is(u, "LockPersonality", "yes") && strcmp(name, "personality") == 0) {
        LET(filter, number, 1, SCMP_A0(SCMP_CMP_EQ, 0xffffffff, 0));
    } else if (unit_value(u, "RestrictAddressFamilies") && strcmp(name, "socket") == 0) {
        let_sockets(filter, u, number);
    } else {
        return false;
    }
    return true;
}

/* `names`: a file with the calls of SystemCallFilter=. */
static void unit_restrict_calls(const struct unit *u, const char *names) {
    errno = EINVAL;
    must(unit_is(u, "SystemCallErrorNumber", "EPERM"), "SystemCallErrorNumber=");
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    FILE *file = fopen(names, "re");
    char name[64];
    must(filter && file, names);
    while (fscanf(file, "%63s", name) == 1) {
        int number = seccomp_syscall_resolve_name(name);
        if (number < 0 || let_part(filter, u, name, number)) /* below 0: of another architecture */
            continue;
        must(seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 0) == 0, name);
    }
    fclose(file);
    must(prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0, "PR_SET_NO_NEW_PRIVS");
    must(seccomp_load(filter) == 0, "seccomp_load");
    seccomp_release(filter);
}

#endif
