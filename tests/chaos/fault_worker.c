/* fault_worker BUILD ROOM ARCHIVE disk|memory STEP ALL [FROM] -- a worker's n-th operation on a file or n-th
 * allocation fails: a disk by ENOSPC or EIO, once or from then on, memory once or from then on. The worker
 * ends with the status that says so (server/worker/progress.h), by which the daemon pauses the job or tries
 * again with less, never by a signal, and without a leak; a full disk leaves no half-written file. The next
 * attempt, when all is well again, ends with the textures of one that nobody disturbed. The same of the check
 * of a scene, which never finds fault with the scene for it.
 *
 * From n = FROM (1) on. Of operations every STEP-th fails, of a check's more; ALL: 1 for all of these ways at each, 0
 * for one in turn. Of allocations, which are many and alike, the first that the same calls led to, for every STEP-th
 * such stack of calls; ALL: in both ways, and once more, in turn, the last and the one in the middle. */
#include <dirent.h>

#include "tests/chaos/faults.h"
#include "tests/chaos/worker.h"

#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":6,\"texels_per_iteration\":64,"                                                \
    "\"cameras_per_texel\":1,\"samples_per_camera\":2,\"report_samples\":1,"                                           \
    "\"gather_samples\":16,\"gloss_passes\":1,\"preview_interval_sec\":60"

/* Few texels, for a disk: what is done to them does nothing to files. Given a density the atlas is made once, not
 * twice, whose memory is to fail as well. */
#define FEW_TEXELS ",\"texels_per_metre\":2"

/* What is to fail, and how. */
struct turn {
    long n;         /* 0: none */
    uint64_t calls; /* to this allocation, when none failed */
    int error;
    bool for_good;
};

static char binary[512], library[PATH_MAX], log_path[128];
static const char *room, *archive;
static char *root;                                  /* the faults are below it */
static char peace[WORKER_OUTPUTS][SHA256_HEX_SIZE]; /* the outputs when nothing failed */
static struct faults *faults;
static bool is_memory; /* not the disk */
static bool is_long;   /* ALL: surface is sought that a scan lacks, too */
static long vague;     /* attempts that could not say that it was memory */
static long astray;    /* allocations that failed elsewhere than planned: progress is told by the clock */

/* One attempt; its wait status. */
static int attempt(const char *dir, int number) {
    int fd, status;
    /* libseccomp (2.5.4) uses memory that it did not get. */
    char *settings = mem_printf("%s%s%s", SETTINGS, is_memory ? "" : FEW_TEXELS, is_long ? "" : "," CLOSED_ROOM);
    worker_order(dir, room, number, 1, 0.0, !is_memory, settings);
    mem_free(settings);
    pid_t pid = worker_start(binary, dir, library, log_path, &fd);
    worker_hear(fd, "nothing", 120.0); /* until it ends */
    waitpid(pid, &status, 0);
    close(fd);
    return status;
}

static long count_scraps(const char *dir) {
    char *out = file_join(dir, "out");
    DIR *folder = opendir(out);
    long count = 0;
    for (struct dirent *entry; folder && (entry = readdir(folder)) != NULL;)
        count += strstr(entry->d_name, ".tmp") != NULL || strstr(entry->d_name, ".part") != NULL;
    if (folder)
        closedir(folder);
    mem_free(out);
    return count;
}

static void strike(const struct turn *t) {
    char sums[WORKER_OUTPUTS][SHA256_HEX_SIZE];
    long n = t->n;
    int error = t->error;
    bool for_good = t->for_good;
    const char *word = strerrorname_np(error), *how = for_good ? "for good" : "once";
    char *dir = file_join(root, "job");
    int wanted = is_memory ? PROGRESS_EXIT_MEMORY : error == ENOSPC ? PROGRESS_EXIT_NO_SPACE : PROGRESS_EXIT_FAILED;
    file_make_dirs(dir, NULL);
    faults_arm(faults, FAULTS_WORKER, n, error, for_good);
    int status = attempt(dir, 1);
    long failed = atomic_load(&faults->failed);
    faults_lift(faults);
    astray += is_memory && n > 0 && faults->calls[0] != t->calls;
    CHECK_THAT(WIFEXITED(status), "operation %ld fails %s with %s: signal %d", n, how, word, WTERMSIG(status));
    /* It may do without one, as that which removes the journal, the last. */
    bool is_vague = is_memory && WEXITSTATUS(status) == PROGRESS_EXIT_FAILED;
    vague += is_vague; /* OpenEXR does not tell that its zlib had no memory; the next attempt is as large */
    CHECK_THAT(WEXITSTATUS(status) == wanted || is_vague || (WEXITSTATUS(status) == 0 && (!for_good || failed <= 1)),
               "operation %ld fails %s with %s: exit status %d", n, how, word, WEXITSTATUS(status));
    CHECK_THAT(error != ENOSPC || count_scraps(dir) == 0, "operation %ld fails %s with %s: scraps are left", n, how,
               word);
    if (WEXITSTATUS(status) != 0) {
        status = attempt(dir, 2);
        CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "after operation %ld failed %s with %s: %x", n, how,
                   word, (unsigned)status);
    }
    if (check_failed_count == 0)
        worker_hash(dir, sums);
    for (size_t i = 0; i < WORKER_OUTPUTS && check_failed_count == 0; i++)
        CHECK_THAT(strcmp(peace[i], sums[i]) == 0, "after operation %ld failed %s with %s: %s differs", n, how, word,
                   worker_outputs[i]);
    if (check_failed_count == 0)
        file_remove_tree(dir, NULL);
    mem_free(dir);
}

/* One check; its wait status. No problem is told. */
static int check(const char *dir) {
    int fd, status;
    worker_order_check(dir, !is_memory);
    pid_t pid = worker_start(binary, dir, library, log_path, &fd);
    CHECK_THAT(!worker_hear(fd, "\"type\":\"problem\"", 120.0), "%s: a problem is told", dir);
    waitpid(pid, &status, 0);
    close(fd);
    return status;
}

/* As strike, of the check of the archive. */
static void strike_check(const struct turn *t) {
    struct buf bytes;
    long n = t->n;
    int error = t->error;
    bool for_good = t->for_good;
    const char *word = strerrorname_np(error), *how = for_good ? "for good" : "once";
    char *dir = file_join(root, "scene"), *copy = file_join(dir, "archive"), *files = file_join(dir, "files");
    int wanted = is_memory ? PROGRESS_EXIT_MEMORY : error == ENOSPC ? PROGRESS_EXIT_NO_SPACE : PROGRESS_EXIT_FAILED;
    file_make_dirs(dir, NULL);
    buf_init(&bytes, (size_t)64 << 20);
    CHECK(file_read(archive, &bytes, NULL) == STATUS_OK &&
          file_replace(copy, bytes.data, bytes.length, NULL) == STATUS_OK);
    buf_release(&bytes);
    worker_order_check(dir, !is_memory);
    faults_arm(faults, FAULTS_WORKER, n, error, for_good);
    int status = check(dir);
    long failed = atomic_load(&faults->failed);
    bool is_good = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    faults_lift(faults);
    astray += is_memory && n > 0 && faults->calls[0] != t->calls;
    CHECK_THAT(WIFEXITED(status), "check, operation %ld fails %s with %s: signal %d", n, how, word, WTERMSIG(status));
    bool is_vague = is_memory && WEXITSTATUS(status) == PROGRESS_EXIT_FAILED;
    vague += is_vague;
    CHECK_THAT(WEXITSTATUS(status) == wanted || is_vague || (is_good && (!for_good || failed <= 1)),
               "check, operation %ld fails %s with %s: exit status %d", n, how, word, WEXITSTATUS(status));
    CHECK_THAT(is_good || error != ENOSPC || access(files, F_OK) != 0,
               "check, operation %ld fails %s with %s: files are left", n, how, word);
    CHECK_THAT(check(dir) == 0, "after the check's operation %ld failed %s with %s", n, how, word);
    if (check_failed_count == 0)
        file_remove_tree(dir, NULL);
    mem_free(files);
    mem_free(copy);
    mem_free(dir);
}

/* --- which of them ------------------------------------------------------------------------------ */

struct plan {
    struct turn *turn; /* [count], owned */
    size_t count;
    int ways;
};

static void add(struct plan *p, long n, int way) {
    p->turn = mem_realloc_array(p->turn, p->count + 1, sizeof *p->turn);
    struct turn *t = &p->turn[p->count++];
    if (is_memory)
        *t = (struct turn){n, faults->calls[n - 1], ENOMEM, way == 1};
    else
        *t = (struct turn){n, 0, way % 2 ? EIO : ENOSPC, way / 2 == 1};
}

/* All ways, or one in turn. */
static void add_ways(struct plan *p, long n, long index, bool all) {
    for (int way = 0; way < p->ways; way++)
        if (all || way == index % p->ways)
            add(p, n, way);
}

/* The allocations that the same calls led to as to the n-th, which is the first: where they are, ascending;
 * how many. */
static long find_alike(long n, long count, long *where) {
    long alike = 0;
    for (long i = n; i <= count; i++)
        if (faults->calls[i - 1] == faults->calls[n - 1])
            where[alike++] = i;
    return alike;
}

static bool is_first(long n) {
    long i = 1;
    while (faults->calls[i - 1] != faults->calls[n - 1])
        i++;
    return i == n;
}

/* How many stacks there are. */
static long plan_stacks(struct plan *p, long step, bool all, long from, long count) {
    static long where[FAULTS_CALLS_MAX];
    long stacks = 0;
    for (long n = 1; n <= count; n++) {
        if (!is_first(n) || stacks++ % step != 0 || n < from)
            continue;
        long alike = find_alike(n, count, where), index = stacks / step;
        add_ways(p, n, index, all);
        if (all && alike > 1)
            add(p, where[alike - 1], (int)(index % 2));
        if (all && alike > 2)
            add(p, where[alike / 2], (int)((index + 1) % 2));
    }
    return stacks;
}

/* How many were made to fail. */
static long campaign(const char *what, void (*strike_one)(const struct turn *), long step, bool all, long from) {
    struct plan p = {.ways = is_memory ? 2 : 4};
    strike_one(&(struct turn){0}); /* counts them */
    long count = atomic_load(&faults->count), index = 0;
    CHECK(count > 0 && count <= FAULTS_CALLS_MAX);
    if (is_memory && check_failed_count == 0) {
        long stacks = plan_stacks(&p, step, all, from, count);
        printf("%s: %ld allocations by %ld stacks of calls\n", what, count, stacks);
    } else {
        for (long n = from; n <= count; n += step)
            add_ways(&p, n, index++, all);
        printf("%s: %ld operations on files\n", what, count);
    }
    for (size_t i = 0; i < p.count && check_failed_count == 0; i++)
        strike_one(&p.turn[i]);
    printf("%s: %zu made to fail\n", what, p.count);
    mem_free(p.turn);
    return (long)p.count;
}

int main(int argc, char **argv) {
    long step = argc >= 7 ? strtol(argv[5], NULL, 10) : 0, from = argc > 7 ? strtol(argv[7], NULL, 10) : 1;
    char top[] = "/dev/shm/unbake-chaos-XXXXXX", page[64]; /* in memory: thousands of attempts wait for syncs */
    is_long = step > 0 && argv[6][0] == '1';
    if (access("/dev/shm", W_OK) != 0)
        strcpy(top, "/tmp/unbake-chaos-XXXXXX");
    if (step <= 0 || !mkdtemp(top))
        return 2;
    root = file_join(top, "jobs");
    room = argv[2];
    archive = argv[3];
    char *dir = file_join(root, "job");
    snprintf(binary, sizeof binary, "%s/unbaked", argv[1]);
    snprintf(log_path, sizeof log_path, "%s/log", top);
    snprintf(page, sizeof page, "%s/faults", top);
    is_memory = strcmp(argv[4], "memory") == 0;
    preload_find(argv[1], is_memory ? "memory" : "files", library);
    faults = faults_new(page, root, NULL);
    if (!faults)
        return 1;
    setenv("UNBAKE_FAULTS", page, 1);
    file_make_dirs(dir, NULL);
    CHECK(attempt(dir, 1) == 0);
    worker_hash(dir, peace);
    file_remove_tree(dir, NULL);
    long strikes = campaign("workers", strike, step, is_long, from);
    /* They do less, and sooner. */
    strikes += campaign("checks of scenes", strike_check, (step + 6) / 7, is_long, 1);
    if (is_memory) {
        figure("no memory, workers: allocations made to fail", (double)strikes, 5000, "higher");
        figure("no memory, workers: of them elsewhere than planned", (double)astray, 0.05 * (double)strikes, "lower");
        figure("no memory, workers: attempts that cannot say so", (double)vague, 0.02 * (double)strikes, "lower");
        figure("no memory, workers: wrong ends, textures that differ", check_failed_count, 0, "lower");
    } else {
        figure("failing disk, workers: operations made to fail", (double)strikes, 1000, "higher");
        figure("failing disk, workers: wrong ends, leaks, textures that differ", check_failed_count, 0, "lower");
    }
    if (check_failed_count == 0)
        file_remove_tree(top, NULL);
    else
        fprintf(stderr, "kept: %s\n", top);
    mem_free(dir);
    mem_free(root);
    return check_result();
}
