/* fault_worker BUILD ROOM ARCHIVE disk|memory STEP ALL [FROM] -- a worker's n-th operation on a file or n-th
 * allocation fails, for every STEP-th n from FROM (1) on: a disk by ENOSPC or EIO, once or from then on,
 * memory once or from then on (ALL: 1 for all of these at each n, 0 for one in turn). The worker ends with
 * the status that says so (server/worker/progress.h), by which the daemon pauses the job or tries again with
 * less, never by a signal, and without a leak; a full disk leaves no half-written file. The next attempt,
 * when all is well again, ends with the textures of one that nobody disturbed. The same of the check of a
 * scene, which never finds fault with the scene for it. */
#include <dirent.h>

#include "tests/chaos/faults.h"
#include "tests/chaos/worker.h"

#define SETTINGS                                                                                                \
    "\"texture_size\":64,\"iterations\":6,\"texels_per_iteration\":64,\"coarse_levels\":1,"                         \
    "\"cameras_per_texel\":1,\"samples_per_camera\":2,\"report_samples\":1,\"preview_interval_sec\":60"

static char binary[512], library[PATH_MAX], log_path[128];
static struct faults *faults;
static bool is_memory; /* not the disk */
static long vague;     /* attempts that could not say that it was memory */

/* One attempt; its wait status. */
static int attempt(const char *dir, const char *room, int number) {
    int fd, status;
    /* libseccomp (2.5.4) uses memory that it did not get. */
    worker_order(dir, room, number, 1, 0.0, !is_memory, SETTINGS);
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

/* False when there is no n-th operation. */
static bool strike(const char *root, const char *room, long n, int error, bool for_good,
                   char peace[WORKER_OUTPUTS][SHA256_HEX_SIZE]) {
    char sums[WORKER_OUTPUTS][SHA256_HEX_SIZE];
    const char *word = strerrorname_np(error), *how = for_good ? "for good" : "once";
    char *dir = file_join(root, "job");
    int wanted = is_memory ? PROGRESS_EXIT_MEMORY : error == ENOSPC ? PROGRESS_EXIT_NO_SPACE : PROGRESS_EXIT_FAILED;
    file_make_dirs(dir, NULL);
    faults_arm(faults, FAULTS_WORKER, n, error, for_good);
    int status = attempt(dir, room, 1);
    bool has_struck = atomic_load(&faults->failed) > 0;
    faults_lift(faults);
    CHECK_THAT(WIFEXITED(status), "operation %ld fails %s with %s: signal %d", n, how, word, WTERMSIG(status));
    /* Some it may do without. */
    bool is_vague = is_memory && WEXITSTATUS(status) == PROGRESS_EXIT_FAILED;
    vague += is_vague; /* OpenEXR does not tell that its zlib had no memory; the next attempt is as large */
    CHECK_THAT(WEXITSTATUS(status) == wanted || is_vague || (WEXITSTATUS(status) == 0 && (!for_good || !has_struck)),
               "operation %ld fails %s with %s: exit status %d", n, how, word, WEXITSTATUS(status));
    CHECK_THAT(error != ENOSPC || count_scraps(dir) == 0, "operation %ld fails %s with %s: scraps are left", n, how, word);
    if (WEXITSTATUS(status) != 0) {
        status = attempt(dir, room, 2);
        CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "after operation %ld failed %s with %s: %x", n, how, word,
                   (unsigned)status);
    }
    if (check_failed_count == 0)
        worker_hash(dir, sums);
    for (size_t i = 0; i < WORKER_OUTPUTS && check_failed_count == 0; i++)
        CHECK_THAT(strcmp(peace[i], sums[i]) == 0, "after operation %ld failed %s with %s: %s differs", n, how, word,
                   worker_outputs[i]);
    if (check_failed_count == 0)
        file_remove_tree(dir, NULL);
    mem_free(dir);
    return has_struck;
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
static bool strike_check(const char *root, const char *archive, long n, int error, bool for_good) {
    struct buf bytes;
    const char *word = strerrorname_np(error), *how = for_good ? "for good" : "once";
    char *dir = file_join(root, "scene"), *copy = file_join(dir, "archive"), *files = file_join(dir, "files");
    int wanted = is_memory ? PROGRESS_EXIT_MEMORY : error == ENOSPC ? PROGRESS_EXIT_NO_SPACE : PROGRESS_EXIT_FAILED;
    file_make_dirs(dir, NULL);
    buf_init(&bytes, (size_t)64 << 20);
    CHECK(file_read(archive, &bytes, NULL) == STATUS_OK && file_replace(copy, bytes.data, bytes.length, NULL) == STATUS_OK);
    buf_release(&bytes);
    worker_order_check(dir, !is_memory);
    faults_arm(faults, FAULTS_WORKER, n, error, for_good);
    int status = check(dir);
    bool has_struck = atomic_load(&faults->failed) > 0, is_good = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    faults_lift(faults);
    CHECK_THAT(WIFEXITED(status), "check, operation %ld fails %s with %s: signal %d", n, how, word, WTERMSIG(status));
    bool is_vague = is_memory && WEXITSTATUS(status) == PROGRESS_EXIT_FAILED;
    vague += is_vague;
    CHECK_THAT(WEXITSTATUS(status) == wanted || is_vague || (is_good && (!for_good || !has_struck)),
               "check, operation %ld fails %s with %s: exit status %d", n, how, word, WEXITSTATUS(status));
    CHECK_THAT(is_good || error != ENOSPC || access(files, F_OK) != 0, "check, operation %ld fails %s with %s: files are left",
               n, how, word);
    CHECK_THAT(check(dir) == 0, "after the check's operation %ld failed %s with %s", n, how, word);
    if (check_failed_count == 0)
        file_remove_tree(dir, NULL);
    mem_free(files);
    mem_free(copy);
    mem_free(dir);
    return has_struck;
}

int main(int argc, char **argv) {
    long step = argc >= 7 ? strtol(argv[5], NULL, 10) : 0, n = argc > 7 ? strtol(argv[7], NULL, 10) : 1, strikes = 0;
    bool all = step > 0 && argv[6][0] == '1', more = true;
    char peace[WORKER_OUTPUTS][SHA256_HEX_SIZE], top[] = "/tmp/unbake-chaos-XXXXXX", page[64];
    if (step <= 0 || !mkdtemp(top))
        return 2;
    char *root = file_join(top, "jobs"), *dir = file_join(root, "job");
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
    CHECK(attempt(dir, argv[2], 1) == 0);
    worker_hash(dir, peace);
    file_remove_tree(dir, NULL);
    long ways = is_memory ? 2 : 4;
    for (long turn = 0; more && check_failed_count == 0; n += step, turn++)
        for (long way = all ? 0 : turn % ways; more && way < (all ? ways : turn % ways + 1); way++, strikes++)
            more = strike(root, argv[2], n, is_memory ? ENOMEM : way % 2 ? EIO : ENOSPC, is_memory ? way % 2 : way / 2,
                          peace);
    printf("workers: %ld %s, %ld of them made to fail\n", n - step, is_memory ? "allocations" : "operations on files",
           strikes - 1);
    more = true;
    long m = 1, checks = 0, stride = (step + 6) / 7; /* a check does less than a job, and sooner */
    for (long turn = 0; more && check_failed_count == 0; m += stride, turn++)
        for (long way = all ? 0 : turn % ways; more && way < (all ? ways : turn % ways + 1); way++, checks++)
            more = strike_check(root, argv[3], m, is_memory ? ENOMEM : way % 2 ? EIO : ENOSPC, is_memory ? way % 2 : way / 2);
    printf("checks of scenes: %ld %s, %ld of them made to fail\n", m - stride,
           is_memory ? "allocations" : "operations on files", checks - 1);
    strikes += checks - 1;
    if (is_memory) {
        figure("no memory, workers: allocations made to fail", (double)strikes - 1, 500, "higher");
        figure("no memory, workers: attempts that cannot say so", (double)vague, 0.02 * (double)strikes, "lower");
        figure("no memory, workers: wrong ends, textures that differ", check_failed_count, 0, "lower");
    } else {
        figure("failing disk, workers: operations made to fail", (double)strikes - 1, 1000, "higher");
        figure("failing disk, workers: wrong ends, leaks, textures that differ", check_failed_count, 0, "lower");
    }
    CHECK(n > 100);
    if (check_failed_count == 0)
        file_remove_tree(top, NULL);
    else
        fprintf(stderr, "kept: %s\n", top);
    mem_free(dir);
    mem_free(root);
    return check_result();
}
