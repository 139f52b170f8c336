/* worker_calls BUILD ROOM ARCHIVE STEP -- every STEP-th call of the system that the check of a scene, or an attempt of
 * a job, makes fails once by EIO, those that read as those that write: it does without, or says by its exit status and
 * its last line that the machine was at fault, never the scene or the job. The next attempt succeeds. */
#include "tests/chaos/faults.h"
#include "tests/chaos/worker.h"

#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":1,\"texels_per_iteration\":64,"                                                \
    "\"cameras_per_texel\":1,\"samples_per_camera\":2,\"report_samples\":1,"                                           \
    "\"gather_samples\":16,\"gloss_passes\":1,\"texels_per_metre\":2,\"preview_interval_sec\":60," CLOSED_ROOM

static char binary[512], library[PATH_MAX], log_path[128], dir[128];
static struct faults *faults;
static long strikes;

/* Its exit status, -1 for a signal; *said: it has told of its end. */
static int run(const char *preload, const char *end, bool *said) {
    int fd, status;
    pid_t pid = worker_start(binary, dir, preload, log_path, &fd);
    *said = worker_hear(fd, end, 120.0);
    while (worker_hear(fd, "nothing", 120.0))
        continue;
    waitpid(pid, &status, 0);
    close(fd);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void order(const char *room) {
    if (room)
        worker_order(dir, room, 1, 1, 0.0, false, SETTINGS);
    else
        worker_order_check(dir, false);
}

/* False where there is no n-th call. */
static bool strike(const char *room, long n) {
    const char *what = room ? "a job" : "a check";
    bool said;
    order(room);
    faults_arm(faults, FAULTS_WORKER, n, EIO, false);
    int code = run(library, "\"type\":\"end\"", &said);
    /* Who runs out of memory ends at once, and does not tell of the fault. The attempt after it would not succeed if it
     * had not been one. */
    bool struck = atomic_load(&faults->failed) > 0 || code == PROGRESS_EXIT_MEMORY;
    strikes += struck;
    CHECK_THAT(code == 0 || (struck && (code == PROGRESS_EXIT_FAILED || code == PROGRESS_EXIT_NO_SPACE ||
                                        code == PROGRESS_EXIT_MEMORY)),
               "%s, call %ld: exit status %d", what, n, code);
    /* The first call asks whether anybody listens; without an end that is told the daemon counts it as a crash. */
    CHECK_THAT(said || code == PROGRESS_EXIT_MEMORY || n == 1, "%s, call %ld: exit status %d, and no word", what, n,
               code);
    code = run(NULL, "\"status\":\"ok\"", &said);
    CHECK_THAT(code == 0 && said, "%s, after call %ld: exit status %d", what, n, code);
    return struck;
}

static void copy(const char *from, const char *name) {
    struct buf bytes;
    char *to = file_join(dir, name);
    buf_init(&bytes, (size_t)64 << 20);
    CHECK(file_read(from, &bytes, NULL) == STATUS_OK && file_replace(to, bytes.data, bytes.length, NULL) == STATUS_OK);
    buf_release(&bytes);
    mem_free(to);
}

int main(int argc, char **argv) {
    char top[] = "/tmp/unbake-chaos-XXXXXX", page[64];
    long step = argc == 5 ? strtol(argv[4], NULL, 10) : 0;
    if (step <= 0 || !mkdtemp(top))
        return 2;
    snprintf(binary, sizeof binary, "%s/unbaked", argv[1]);
    snprintf(log_path, sizeof log_path, "%s/log", top);
    snprintf(page, sizeof page, "%s/faults", top);
    snprintf(dir, sizeof dir, "%s/job", top);
    preload_find(argv[1], "calls", library);
    faults = faults_new(page, top, NULL);
    if (!faults || file_make_dirs(dir, NULL) != STATUS_OK)
        return 1;
    setenv("UNBAKE_FAULTS", page, 1);
    copy(argv[3], "archive");
    for (int i = 0; i < 2; i++)
        for (long n = 1; strike(i ? argv[2] : NULL, n) && check_failed_count == 0; n += step)
            continue;
    printf("%ld calls failed\n", strikes);
    if (check_failed_count == 0)
        file_remove_tree(top, NULL);
    else
        fprintf(stderr, "kept: %s\n", top);
    return check_result();
}
