/* system_faults.h -- for one file of a test: calls of the system that the daemon makes, before libc's own. The n-th
 * call fails without being made, once or from then on; of all or of those of some names. What SQLite calls does not
 * count, nor does what is done by descriptors to anything but files and folders, or to the standard streams. */
#ifndef UNBAKE_TESTS_SYSTEM_FAULTS_H
#define UNBAKE_TESTS_SYSTEM_FAULTS_H

#include <dirent.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "tests/sql_faults.h"

static atomic_long system_faults_left;         /* calls until one fails; 0: none does */
static atomic_int system_fault;                /* errno, then */
static const char *_Atomic system_faults_only; /* the calls that count, with blanks between; NULL: all do */
static atomic_bool system_faults_stay;         /* all later ones fail, too */
static const char *_Atomic system_failed;      /* the call that failed last */

/* The n-th call from now on fails, and if `stays` all that follow, by EIO or ENOSPC in turn. */
static inline void system_faults_arm_only(const char *only, long n, bool stays) {
    system_fault = n % 2 ? EIO : ENOSPC;
    system_faults_only = only;
    system_faults_stay = stays;
    atomic_store(&system_faults_left, n);
}

static inline void system_faults_arm(long n) { system_faults_arm_only(NULL, n, false); }

/* From now on none does; whether one has. */
static inline bool system_faults_lift(void) { return atomic_exchange(&system_faults_left, 0) <= 0; }

/* Until they are mended all these calls fail. */
static inline void system_break(const char *calls, int fault) {
    system_faults_arm_only(calls, LONG_MAX, true);
    system_fault = fault;
    atomic_store(&system_faults_left, 1);
}

static inline void system_mend(void) { atomic_store(&system_faults_left, 0); }

static inline bool is_among(const char *name, const char *names) {
    size_t length = strlen(name);
    for (const char *at = names; *at; at += strspn(at, " ")) {
        size_t word = strcspn(at, " ");
        if (word == length && memcmp(at, name, length) == 0)
            return true;
        at += word;
    }
    return false;
}

static inline bool system_fails(const char *name) {
    const char *only = system_faults_only;
    if (faults_watch)
        faults_watch(name);
    if (faults_pass_by() || (only && !is_among(name, only)) || !faults_strike(&system_faults_left, system_faults_stay))
        return false;
    system_failed = name;
    errno = system_fault;
    return true;
}

static inline bool is_file(int fd) {
    struct stat info;
    return fd > STDERR_FILENO && syscall(SYS_fstat, fd, &info) == 0 && (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode));
}

#define SYSTEM_CALL(type, name, failed, counts, parameters, ...)                                                       \
    type name parameters {                                                                                             \
        __typeof__(name) *call;                                                                                        \
        if ((counts) && system_fails(#name))                                                                           \
            return failed;                                                                                             \
        *(void **)&call = dlsym(RTLD_NEXT, #name);                                                                     \
        return call(__VA_ARGS__);                                                                                      \
    }

SYSTEM_CALL(int, chmod, -1, true, (const char *path, mode_t mode), path, mode)
SYSTEM_CALL(int, eventfd, -1, true, (unsigned count, int flags), count, flags)
SYSTEM_CALL(int, fallocate, -1, true, (int fd, int mode, off_t at, off_t length), fd, mode, at, length)
SYSTEM_CALL(int, fchmod, -1, true, (int fd, mode_t mode), fd, mode)
SYSTEM_CALL(int, fdatasync, -1, true, (int fd), fd)
SYSTEM_CALL(int, flock, -1, true, (int fd, int operation), fd, operation)
SYSTEM_CALL(pid_t, fork, -1, true, (void))
SYSTEM_CALL(int, fstat, -1, is_file(fd), (int fd, struct stat *info), fd, info)
SYSTEM_CALL(int, fstatat, -1, true, (int folder, const char *path, struct stat *info, int flags), folder, path, info,
            flags)
SYSTEM_CALL(int, fsync, -1, true, (int fd), fd)
SYSTEM_CALL(int, ftruncate, -1, true, (int fd, off_t length), fd, length)
SYSTEM_CALL(ssize_t, getrandom, -1, true, (void *data, size_t length, unsigned flags), data, length, flags)
SYSTEM_CALL(int, listen, -1, true, (int fd, int backlog), fd, backlog)
SYSTEM_CALL(int, lstat, -1, true, (const char *path, struct stat *info), path, info)
SYSTEM_CALL(int, mkdir, -1, true, (const char *path, mode_t mode), path, mode)
SYSTEM_CALL(char *, mkdtemp, NULL, true, (char *template), template)
SYSTEM_CALL(int, mkostemp, -1, true, (char *template, int flags), template, flags)
SYSTEM_CALL(DIR *, opendir, NULL, true, (const char *path), path)
SYSTEM_CALL(int, pipe2, -1, true, (int ends[2], int flags), ends, flags)
SYSTEM_CALL(ssize_t, pread, -1, is_file(fd), (int fd, void *data, size_t length, off_t at), fd, data, length, at)
SYSTEM_CALL(int, pthread_create, errno, true,
            (pthread_t * thread, const pthread_attr_t *attributes, void *(*run)(void *), void *user), thread,
            attributes, run, user)
SYSTEM_CALL(ssize_t, pwrite, -1, is_file(fd), (int fd, const void *data, size_t length, off_t at), fd, data, length, at)
SYSTEM_CALL(struct dirent *, readdir, NULL, true, (DIR * dir), dir)
SYSTEM_CALL(int, rename, -1, true, (const char *from, const char *to), from, to)
SYSTEM_CALL(int, setegid, -1, true, (gid_t gid), gid)
SYSTEM_CALL(int, seteuid, -1, true, (uid_t uid), uid)
SYSTEM_CALL(int, socket, -1, true, (int family, int kind, int protocol), family, kind, protocol)
SYSTEM_CALL(int, statvfs, -1, true, (const char *path, struct statvfs *info), path, info)
SYSTEM_CALL(int, unlink, -1, true, (const char *path), path)
SYSTEM_CALL(int, unlinkat, -1, true, (int folder, const char *path, int flags), folder, path, flags)
SYSTEM_CALL(ssize_t, write, -1, is_file(fd), (int fd, const void *data, size_t length), fd, data, length)

#define SYSTEM_OPEN_MODE                                                                                               \
    mode_t mode = 0;                                                                                                   \
    if (flags & O_CREAT) {                                                                                             \
        va_list args;                                                                                                  \
        va_start(args, flags);                                                                                         \
        mode = va_arg(args, mode_t);                                                                                   \
        va_end(args);                                                                                                  \
    }

int open(const char *path, int flags, ...) {
    SYSTEM_OPEN_MODE
    if (strstr(path, ".gcda")) /* make coverage: the program is over, and its counts are written */
        faults_are_off = true;
    return system_fails("open") ? -1 : (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int openat(int folder, const char *path, int flags, ...) {
    SYSTEM_OPEN_MODE
    return system_fails("openat") ? -1 : (int)syscall(SYS_openat, folder, path, flags, mode);
}

int fcntl(int fd, int command, ...) {
    va_list args;
    va_start(args, command);
    void *argument = va_arg(args, void *);
    va_end(args);
    return system_fails("fcntl") ? -1 : (int)syscall(SYS_fcntl, fd, command, argument);
}

/* Where "lie" is what fails, files have not what was written. */
ssize_t read(int fd, void *data, size_t length) {
    if (is_file(fd) && system_fails("read"))
        return -1;
    __typeof__(read) *call;
    *(void **)&call = dlsym(RTLD_NEXT, "read");
    ssize_t got = call(fd, data, length);
    if (got > 0 && system_faults_only && is_file(fd) && system_fails("lie"))
        *(char *)data ^= 1;
    return got;
}

/* It is closed, but what was written to it may be lost. Fails only where it is named. */
int close(int fd) {
    bool is_struck = system_faults_only && system_fails("close");
    __typeof__(close) *call;
    *(void **)&call = dlsym(RTLD_NEXT, "close");
    int result = call(fd);
    if (is_struck)
        errno = system_fault;
    return is_struck ? -1 : result;
}

#endif
