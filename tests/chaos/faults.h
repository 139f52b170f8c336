/* faults.h -- what a test and the libraries that it slips under the daemon and its workers share: a
 * page of memory (the file that UNBAKE_FAULTS names) that says what is to fail, and the log of what
 * was done to the data folder. */
#ifndef UNBAKE_TESTS_CHAOS_FAULTS_H
#define UNBAKE_TESTS_CHAOS_FAULTS_H

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <unistd.h>

#define FAULTS_CALLS_MAX 65536
/* In place of an errno, with preload/files.c: whoever is about to do it is killed, or held up until
 * something else is armed, or nothing, or for delay_ms. */
#define FAULTS_KILL (-1)
#define FAULTS_HOLD (-2)
#define FAULTS_SLOW (-3)

enum faults_role { FAULTS_DAEMON = 1, FAULTS_WORKER = 2 };

struct faults {
    char root[256]; /* what happens below this folder counts */
    /* The n-th thing that processes of these roles do fails: operations on files with preload/files.c,
     * allocations with preload/memory.c. */
    atomic_int roles;     /* 0: nothing is counted, nothing fails */
    atomic_long count;    /* so many were done */
    atomic_long fail_at;  /* n, from 1; 0: none */
    atomic_bool for_good; /* all later ones fail, too */
    atomic_int error;     /* errno of operations, or FAULTS_KILL, FAULTS_HOLD, FAULTS_SLOW */
    atomic_int delay_ms;  /* of FAULTS_SLOW */
    atomic_int armed;     /* so many times */
    atomic_bool is_told;  /* whoever is held up has been told to stop */
    atomic_long failed;   /* so many have */
    char what[16];        /* the call that did, with preload/calls.c */
    /* Hashes of the calls that led to allocations: to the n-th, at n - 1, while none is to fail; else, at 0, to
     * the first that does. */
    uint64_t calls[FAULTS_CALLS_MAX];
    /* The log, where log_path is not empty. One operation at a time is done and logged. */
    pthread_mutex_t mutex; /* of all processes; survives the death of one that holds it */
    char log_path[256];
};

/* --- the log ------------------------------------------------------------------------------- */

/* `inode` names the file or folder that an operation is about; a and b are as said; the text of
 * length `length` follows: a path, two with a NUL between, or bytes. */
enum faults_op {
    OP_CREATE,   /* of the path; a: 1 for a folder */
    OP_WRITE,    /* bytes at a */
    OP_SIZE,     /* to a; what is new is zero */
    OP_GROW,     /* as OP_SIZE, unless it is larger already */
    OP_SYNC,     /* fsync or fdatasync */
    OP_SYNC_ALL, /* syncfs */
    OP_RENAME,   /* from the first path to the second */
    OP_REMOVE,   /* of the path */
    OP_MARK      /* what is acknowledged from now on, as text; of a worker: its line, inode is its folder's */
};

struct faults_record {
    uint32_t op, length;
    uint64_t inode, a;
};

/* --- both sides ------------------------------------------------------------------------------ */

static inline struct faults *faults_map(const char *path) {
    int fd = open(path, O_RDWR | O_CLOEXEC);
    void *page = fd >= 0 ? mmap(NULL, sizeof(struct faults), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0) : MAP_FAILED;
    if (fd >= 0)
        close(fd);
    return page == MAP_FAILED ? NULL : page;
}

static inline void faults_lock(struct faults *f) {
    if (pthread_mutex_lock(&f->mutex) == EOWNERDEAD)
        pthread_mutex_consistent(&f->mutex);
}

static inline void faults_unlock(struct faults *f) { pthread_mutex_unlock(&f->mutex); }

/* Appends a record; the lock is held. */
static inline void faults_log(int log_fd, enum faults_op op, uint64_t inode, uint64_t a, const void *text,
                              size_t length) {
    struct faults_record record = {.op = op, .length = (uint32_t)length, .inode = inode, .a = a};
    struct iovec parts[2] = {{&record, sizeof record}, {(void *)(uintptr_t)text, length}};
    if (writev(log_fd, parts, 2) != (ssize_t)(sizeof record + length))
        _exit(99); /* a log with a hole proves nothing */
}

/* --- the test's side --------------------------------------------------------------------------- */

/* Makes the page as the file `path`. log_path may be NULL. */
static inline struct faults *faults_new(const char *path, const char *root, const char *log_path) {
    int fd = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    bool made = fd >= 0 && ftruncate(fd, sizeof(struct faults)) == 0;
    if (fd >= 0)
        close(fd);
    struct faults *f = made ? faults_map(path) : NULL;
    if (!f)
        return NULL;
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    pthread_mutex_init(&f->mutex, &attributes);
    pthread_mutexattr_destroy(&attributes);
    strncpy(f->root, root, sizeof f->root - 1);
    if (log_path)
        strncpy(f->log_path, log_path, sizeof f->log_path - 1);
    return f;
}

/* From now on the n-th operation or allocation fails, and `for_good` all that follow; 0: they are counted. */
static inline void faults_arm(struct faults *f, int roles, long n, int error, bool for_good) {
    atomic_store(&f->count, 0);
    atomic_store(&f->failed, 0);
    atomic_store(&f->error, error);
    atomic_store(&f->for_good, for_good);
    atomic_store(&f->is_told, false);
    atomic_store(&f->fail_at, n);
    atomic_store(&f->roles, roles);
    atomic_fetch_add(&f->armed, 1);
}

static inline void faults_lift(struct faults *f) {
    atomic_store(&f->roles, 0);
    atomic_fetch_add(&f->armed, 1);
}

/* --- the libraries' side ------------------------------------------------------------------------ */

/* One more; which, from 1, or 0 where this role's do not count. */
static inline long faults_count(struct faults *f, int role) {
    return f && (atomic_load(&f->roles) & role) ? atomic_fetch_add(&f->count, 1) + 1 : 0;
}

/* Whether it is the one that fails. */
static inline bool faults_strikes(struct faults *f, long which) {
    long at = which > 0 ? atomic_load(&f->fail_at) : 0;
    if (at == 0 || (atomic_load(&f->for_good) ? which < at : which != at))
        return false;
    atomic_fetch_add(&f->failed, 1);
    return true;
}

/* What this process is: a worker is the daemon's program with "worker" as its first argument. `folder`
 * gets the second. */
static inline int faults_role(char *folder, size_t size) {
    char line[1024] = "";
    int fd = open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
    ssize_t got = fd >= 0 ? read(fd, line, sizeof line - 3) : 0;
    if (fd >= 0)
        close(fd);
    memset(line + (got > 0 ? got : 0), 0, 3);
    const char *first = line + strlen(line) + 1;
    if (strcmp(first, "worker") != 0)
        return FAULTS_DAEMON;
    strncpy(folder, first + strlen(first) + 1, size - 1);
    return FAULTS_WORKER;
}

#endif
