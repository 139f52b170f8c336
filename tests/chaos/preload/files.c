/* files.c -- preloaded into the daemon, and so into its workers: makes what they do to files below
 * the data folder fail, or logs it; see faults.h.
 *
 * One library below all of them, and no VFS for SQLite besides: SQLite, too, goes through libc, so
 * here is every operation, in one order over all processes. What it relies on:
 *
 * 1. Every call that changes a file or a name and that our programs or their libraries make is here,
 *    with its large-file twin. stdio writes past us, so streams for writing are made of our own
 *    write. power_cut.c replays its whole log and compares with the folder: a call that is missing
 *    here turns it red.
 * 2. Nothing changes a file through memory: SQLite maps none, and needs no shared memory while it
 *    holds its lock for itself.
 * 3. Between fork and exec nothing here allocates, locks or is interrupted: system calls only.
 *
 * A write that fails has written its first half before, and a sync of an upload that fails by EIO loses
 * its last byte: devices do so. An unlink of DATA/reserve while
 * the disk is full makes room: from then on what is armed for good strikes no more, but nobody makes
 * that file again. */
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>

#include "tests/chaos/faults.h"

#define BOOT_ID "/proc/sys/kernel/random/boot_id"
#define PROGRESS_FD 3 /* as in server/worker/progress.h */
#define LOG_FD_MIN 900

static struct faults *faults;
static int log_fd = -1, role;
static uint64_t folder_inode; /* a worker's */
static size_t root_length;
static const char *boot_id; /* a file that stands for the kernel's: of a machine that was cut off */

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("UNBAKE_FAULTS");
    char folder[512] = "";
    struct stat info;
    role = faults_role(folder, sizeof folder);
    folder_inode = stat(folder, &info) == 0 ? info.st_ino : 0;
    faults = path ? faults_map(path) : NULL;
    boot_id = getenv("UNBAKE_BOOT_ID");
    if (!faults)
        return;
    root_length = strlen(faults->root);
    if (*faults->log_path) {
        int fd = open(faults->log_path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
        log_fd = fcntl(fd, F_DUPFD_CLOEXEC, LOG_FD_MIN);
        if (fd >= 0)
            close(fd);
    }
}

/* --- what is ours ----------------------------------------------------------------------------- */

static bool is_below(const char *path) {
    return faults && strncmp(path, faults->root, root_length) == 0 &&
           (path[root_length] == '/' || path[root_length] == '\0');
}

static bool link_target(int fd, char *path, size_t size) {
    char name[64];
    snprintf(name, sizeof name, fd == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", fd);
    ssize_t length = readlink(name, path, size - 1);
    path[length > 0 ? length : 0] = '\0';
    return length > 0;
}

/* The whole path, where it is below the data folder. */
static bool find_path(int folder, const char *path, char *full, size_t size) {
    char start[4096];
    if (!faults || !path)
        return false;
    if (*path == '/')
        snprintf(full, size, "%s", path);
    else if (link_target(folder, start, sizeof start))
        snprintf(full, size, "%.3000s/%s", start, path);
    else
        return false;
    return is_below(full);
}

/* Whether it is a file or folder of ours; its inode. */
static bool find_fd(int fd, uint64_t *inode) {
    char path[4096];
    struct stat info;
    if (!faults || !link_target(fd, path, sizeof path) || !is_below(path) || fstat(fd, &info) != 0 ||
        (!S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode)))
        return false;
    *inode = info.st_ino;
    return true;
}

/* --- failing, logging ---------------------------------------------------------------------------- */

/* Until it is armed once more. A worker that is told to stop looks for the signal between its iterations. */
static void hold(int armed) {
    for (; atomic_load(&faults->armed) == armed; nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL)) {
        sigset_t pending;
        if (sigpending(&pending) == 0 && sigismember(&pending, SIGTERM) == 1)
            atomic_store(&faults->is_told, true);
    }
}

static bool fails(void) {
    int armed = faults ? atomic_load(&faults->armed) : 0;
    if (!faults_strikes(faults, faults_count(faults, role)))
        return false;
    int error = atomic_load(&faults->error);
    if (error == FAULTS_KILL)
        kill(getpid(), SIGKILL);
    if (error == FAULTS_HOLD) {
        hold(armed);
        return false;
    }
    if (error == FAULTS_SLOW) {
        int ms = atomic_load(&faults->delay_ms);
        nanosleep(&(struct timespec){.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L}, NULL);
        return false;
    }
    errno = error;
    return true;
}

static void lock(void) {
    if (log_fd >= 0)
        faults_lock(faults);
}

/* Ends what lock has begun; logs where `done`. Keeps errno. */
static void unlock(bool done, enum faults_op op, uint64_t inode, uint64_t a, const void *text, size_t length) {
    int kept = errno;
    if (log_fd >= 0) {
        if (done)
            faults_log(log_fd, op, inode, a, text, length);
        faults_unlock(faults);
    }
    errno = kept;
}

static uint64_t inode_of(const char *path) {
    struct stat info;
    return lstat(path, &info) == 0 ? info.st_ino : 0;
}

/* --- names ------------------------------------------------------------------------------------------ */

static int open_any(int folder, const char *path, int flags, mode_t mode) {
    char full[4096];
    if (boot_id && path && strcmp(path, BOOT_ID) == 0)
        path = boot_id;
    if (!(flags & (O_CREAT | O_TRUNC)) || !find_path(folder, path, full, sizeof full))
        return (int)syscall(SYS_openat, folder, path, flags, mode);
    uint64_t known = inode_of(full);
    if (!known && fails())
        return -1;
    if (strcmp(full + root_length, "/reserve") == 0 && atomic_load(&faults->roles) & role &&
        atomic_load(&faults->error) == ENOSPC) {
        errno = ENOSPC;
        return -1;
    }
    lock();
    known = inode_of(full);
    int fd = (int)syscall(SYS_openat, folder, path, flags, mode);
    if (known)
        unlock(fd >= 0 && flags & O_TRUNC, OP_SIZE, known, 0, "", 0);
    else
        unlock(fd >= 0, OP_CREATE, inode_of(full), 0, full, strlen(full));
    return fd;
}

#define OPEN_MODE(last)                                                                                                \
    mode_t mode = 0;                                                                                                   \
    if (flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE) {                                                         \
        va_list args;                                                                                                  \
        va_start(args, last);                                                                                          \
        mode = va_arg(args, mode_t);                                                                                   \
        va_end(args);                                                                                                  \
    }

int open(const char *path, int flags, ...) {
    OPEN_MODE(flags)
    return open_any(AT_FDCWD, path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    OPEN_MODE(flags)
    return open_any(AT_FDCWD, path, flags, mode);
}

int openat(int folder, const char *path, int flags, ...) {
    OPEN_MODE(flags)
    return open_any(folder, path, flags, mode);
}

int openat64(int folder, const char *path, int flags, ...) {
    OPEN_MODE(flags)
    return open_any(folder, path, flags, mode);
}

int mkdirat(int folder, const char *path, mode_t mode) {
    char full[4096];
    if (!find_path(folder, path, full, sizeof full))
        return (int)syscall(SYS_mkdirat, folder, path, mode);
    if (!inode_of(full) && fails())
        return -1;
    lock();
    int result = (int)syscall(SYS_mkdirat, folder, path, mode);
    unlock(result == 0, OP_CREATE, inode_of(full), 1, full, strlen(full));
    return result;
}

int mkdir(const char *path, mode_t mode) { return mkdirat(AT_FDCWD, path, mode); }

static void random_end(char *end) {
    uint64_t number = 0;
    if (getrandom(&number, sizeof number, 0) < 0)
        _exit(99);
    for (int i = 0; i < 6; i++, number /= 26)
        end[i] = (char)('a' + number % 26);
}

int mkostemp(char *template, int flags) {
    for (int i = 0; i < 100; i++) {
        random_end(template + strlen(template) - 6);
        int fd = open_any(AT_FDCWD, template, flags | O_RDWR | O_CREAT | O_EXCL, 0600);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

int mkstemp(char *template) { return mkostemp(template, 0); }

char *mkdtemp(char *template) {
    for (int i = 0; i < 100; i++) {
        random_end(template + strlen(template) - 6);
        if (mkdir(template, 0700) == 0)
            return template;
        if (errno != EEXIST)
            break;
    }
    return NULL;
}

int rename(const char *from, const char *to) {
    char both[8192];
    if (!find_path(AT_FDCWD, from, both, 4096))
        return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
    if (fails())
        return -1;
    size_t first = strlen(both) + 1;
    find_path(AT_FDCWD, to, both + first, 4096);
    lock();
    uint64_t inode = inode_of(from);
    int result = (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
    unlock(result == 0, OP_RENAME, inode, 0, both, first + strlen(both + first));
    return result;
}

int unlinkat(int folder, const char *path, int flags) {
    char full[4096];
    if (!find_path(folder, path, full, sizeof full))
        return (int)syscall(SYS_unlinkat, folder, path, flags);
    /* A full disk does not hinder it. */
    if (atomic_load(&faults->error) != ENOSPC && inode_of(full) && fails())
        return -1;
    lock();
    uint64_t inode = inode_of(full);
    int result = (int)syscall(SYS_unlinkat, folder, path, flags);
    unlock(result == 0, OP_REMOVE, inode, 0, full, strlen(full));
    if (result == 0 && strcmp(full + root_length, "/reserve") == 0 && atomic_load(&faults->error) == ENOSPC)
        atomic_store(&faults->fail_at, 0);
    return result;
}

int unlink(const char *path) { return unlinkat(AT_FDCWD, path, 0); }

int rmdir(const char *path) { return unlinkat(AT_FDCWD, path, AT_REMOVEDIR); }

/* --- content ------------------------------------------------------------------------------------------ */

ssize_t pwrite(int fd, const void *data, size_t length, off_t at) {
    uint64_t inode;
    if (!find_fd(fd, &inode))
        return syscall(SYS_pwrite64, fd, data, length, at);
    bool failing = fails();
    int error = errno;
    lock();
    ssize_t wrote = syscall(SYS_pwrite64, fd, data, failing ? length / 2 : length, at);
    unlock(wrote > 0, OP_WRITE, inode, (uint64_t)at, data, wrote > 0 ? (size_t)wrote : 0);
    if (!failing)
        return wrote;
    errno = error;
    return -1;
}

ssize_t pwrite64(int fd, const void *data, size_t length, off64_t at) { return pwrite(fd, data, length, at); }

ssize_t write(int fd, const void *data, size_t length) {
    uint64_t inode;
    if (log_fd >= 0 && role == FAULTS_WORKER && fd == PROGRESS_FD) { /* what a worker says, it holds to */
        lock();
        unlock(true, OP_MARK, folder_inode, 0, data, length);
    }
    if (!find_fd(fd, &inode))
        return syscall(SYS_write, fd, data, length);
    bool failing = fails();
    int error = errno;
    lock();
    ssize_t wrote = syscall(SYS_write, fd, data, failing ? length / 2 : length);
    off_t end = wrote > 0 ? lseek(fd, 0, SEEK_CUR) : 0;
    unlock(wrote > 0, OP_WRITE, inode, (uint64_t)(end - wrote), data, wrote > 0 ? (size_t)wrote : 0);
    if (!failing)
        return wrote;
    errno = error;
    return -1;
}

int ftruncate(int fd, off_t length) {
    uint64_t inode;
    if (!find_fd(fd, &inode))
        return (int)syscall(SYS_ftruncate, fd, length);
    if (fails())
        return -1;
    lock();
    int result = (int)syscall(SYS_ftruncate, fd, length);
    unlock(result == 0, OP_SIZE, inode, (uint64_t)length, "", 0);
    return result;
}

int ftruncate64(int fd, off64_t length) { return ftruncate(fd, length); }

int fallocate(int fd, int mode, off_t at, off_t length) {
    uint64_t inode;
    if (!find_fd(fd, &inode))
        return (int)syscall(SYS_fallocate, fd, mode, at, length);
    if (fails())
        return -1;
    lock();
    int result = (int)syscall(SYS_fallocate, fd, mode, at, length);
    unlock(result == 0 && !(mode & FALLOC_FL_KEEP_SIZE), OP_GROW, inode, (uint64_t)(at + length), "", 0);
    return result;
}

int posix_fallocate(int fd, off_t at, off_t length) { return fallocate(fd, 0, at, length) == 0 ? 0 : errno; }

int fallocate64(int fd, int mode, off64_t at, off64_t length) { return fallocate(fd, mode, at, length); }

int posix_fallocate64(int fd, off64_t at, off64_t length) { return posix_fallocate(fd, at, length); }

/* --- streams ------------------------------------------------------------------------------------------- */

static ssize_t stream_write(void *cookie, const char *data, size_t length) {
    return write((int)(intptr_t)cookie, data, length);
}

static int stream_close(void *cookie) { return close((int)(intptr_t)cookie); }

FILE *fopen(const char *path, const char *mode) {
    char full[4096];
    if (*mode != 'w' || !find_path(AT_FDCWD, path, full, sizeof full)) {
        FILE *(*next)(const char *, const char *);
        *(void **)&next = dlsym(RTLD_NEXT, "fopen");
        return next(path, mode);
    }
    int fd = open_any(AT_FDCWD, path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (fd < 0)
        return NULL;
    FILE *file =
        fopencookie((void *)(intptr_t)fd, "w", (cookie_io_functions_t){.write = stream_write, .close = stream_close});
    if (!file)
        close(fd);
    return file;
}

/* --- syncing --------------------------------------------------------------------------------------------- */

/* What was to reach the disk is gone; the next sync knows nothing of it. */
static void lose_end(int fd) {
    char path[4096];
    struct stat info;
    int kept = errno;
    if (kept == EIO && link_target(fd, path, sizeof path) && strstr(path, "/uploads/") && fstat(fd, &info) == 0 &&
        info.st_size > 0)
        syscall(SYS_pwrite64, fd, "", (size_t)1, info.st_size - 1);
    errno = kept;
}

static int sync_any(long call, int fd) {
    uint64_t inode;
    if (!find_fd(fd, &inode))
        return (int)syscall(call, fd);
    if (fails()) {
        lose_end(fd);
        return -1;
    }
    /* Nothing here outlives the test: the disk itself is not waited for. */
    lock();
    unlock(true, call == SYS_syncfs ? OP_SYNC_ALL : OP_SYNC, inode, 0, "", 0);
    return 0;
}

int fsync(int fd) { return sync_any(SYS_fsync, fd); }

int fdatasync(int fd) { return sync_any(SYS_fdatasync, fd); }

int syncfs(int fd) { return sync_any(SYS_syncfs, fd); }
