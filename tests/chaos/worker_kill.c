/* worker_kill BUILD ROOM KILLS -- workers are killed with SIGKILL while they iterate, at one of the operations on
 * files of their checkpoints, and anywhere; each next one goes on from the newest checkpoint. Every job that comes
 * of it has the textures, byte for byte, of one that nobody disturbed.
 *
 * A checkpoint follows each iteration, and after so many operations a worker is held up until it is killed: none
 * ends before, however fast it is. */
#include <sys/stat.h>

#include "tests/chaos/faults.h"
#include "tests/chaos/worker.h"

#define KILLS_PER_JOB 25
#define LIVES_PER_JOB 20 /* such a part of a job's operations a life has at most */
/* So few texels that each is looked at some hundred times: the correction is solved of what checkpoints hold. */
#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":150,\"texels_per_iteration\":256,"                                             \
    "\"cameras_per_texel\":1,\"samples_per_camera\":4,\"report_samples\":1,"                                           \
    "\"gather_samples\":16,\"gloss_passes\":1,\"texels_per_metre\":2,\"preview_interval_sec\":60," CLOSED_ROOM

static char binary[512], library[PATH_MAX];
static struct faults *faults;
static unsigned random_ = 99;

static unsigned draw(unsigned limit) {
    random_ = random_ * 1664525u + 1013904223u;
    return (random_ >> 8) % limit;
}

/* Whether a transaction is under way: its journal is cut off when all is said. */
static bool is_saving(const char *dir) {
    struct stat info;
    char *path = file_join(dir, "checkpoint/checkpoint.db-journal");
    bool saving = stat(path, &info) == 0 && info.st_size > 0;
    mem_free(path);
    return saving;
}

enum kind { WHILE_IT_ITERATES, WHILE_IT_SAVES, ANYWHERE };

/* Until the worker is held up. */
static void await_hold(void) {
    for (int i = 0; atomic_load(&faults->failed) == 0; i++, usleep(2000))
        if (i == 60000) {
            fprintf(stderr, "a worker does not come to its end\n");
            exit(1);
        }
}

/* One life, of `most` operations. */
static void live(const char *dir, enum kind kind, unsigned most, long *while_saving) {
    int fd, status;
    faults_arm(faults, FAULTS_WORKER, kind == WHILE_IT_SAVES ? 1 + draw(most) : most, FAULTS_HOLD, true);
    pid_t pid = worker_start(binary, dir, library, "/dev/null", &fd);
    if (kind == WHILE_IT_SAVES)
        await_hold();
    else if (kind == ANYWHERE)
        worker_hear(fd, "\"end\"", draw(600) * 1e-3);
    else if (worker_hear(fd, "\"checkpoint\"", 120.0))
        usleep(draw(30000));
    kill(pid, SIGKILL);
    waitpid(pid, &status, 0);
    faults_lift(faults);
    *while_saving += is_saving(dir);
    close(fd);
    CHECK_THAT(WIFSIGNALED(status), "a worker ends with %d", WEXITSTATUS(status));
}

static void finish(const char *dir) {
    int fd, status;
    pid_t pid = worker_start(binary, dir, library, "/dev/null", &fd);
    worker_hear(fd, "\"end\"", 600.0);
    waitpid(pid, &status, 0);
    close(fd);
    CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "the last worker ends with %x", (unsigned)status);
}

int main(int argc, char **argv) {
    long kills = argc == 4 ? strtol(argv[3], NULL, 10) : 0, while_saving = 0, done = 0, jobs = 0, unequal = 0;
    char peace[WORKER_OUTPUTS][SHA256_HEX_SIZE], war[WORKER_OUTPUTS][SHA256_HEX_SIZE];
    char root[] = "/tmp/unbake-chaos-XXXXXX", page[64];
    struct error err;
    if (kills <= 0 || !mkdtemp(root))
        return 2;
    snprintf(binary, sizeof binary, "%s/unbaked", argv[1]);
    snprintf(page, sizeof page, "%s/faults", root);
    preload_find(argv[1], "files", library);
    faults = faults_new(page, root, NULL);
    if (!faults)
        return 1;
    setenv("UNBAKE_FAULTS", page, 1);
    char *dir = file_join(root, "peace");
    file_make_dirs(dir, &err);
    worker_order(dir, argv[2], 1, 2, 0.0, true, SETTINGS);
    faults_arm(faults, FAULTS_WORKER, 0, 0, false);
    finish(dir);
    unsigned most = (unsigned)atomic_load(&faults->count) / LIVES_PER_JOB;
    faults_lift(faults);
    worker_hash(dir, peace);
    mem_free(dir);
    while (done < kills && check_failed_count == 0) {
        dir = mem_printf("%s/war%ld", root, jobs++);
        file_make_dirs(dir, &err);
        for (int i = 0; i < KILLS_PER_JOB && done < kills && check_failed_count == 0; i++, done++) {
            worker_order(dir, argv[2], i + 1, 1 + (i + 1) % 2, 0.0, true, SETTINGS);
            live(dir, i % 5 == 4 ? ANYWHERE : i % 2 ? WHILE_IT_SAVES : WHILE_IT_ITERATES, most, &while_saving);
        }
        finish(dir);
        worker_hash(dir, war);
        for (size_t i = 0; i < WORKER_OUTPUTS; i++) {
            unequal += strcmp(peace[i], war[i]) != 0;
            CHECK_THAT(strcmp(peace[i], war[i]) == 0, "job %ld: %s differs", jobs, worker_outputs[i]);
        }
        if (check_failed_count == 0)
            file_remove_tree(dir, NULL);
        mem_free(dir);
    }
    printf("%ld kills of workers, %ld of them in the middle of a checkpoint, in %ld jobs\n", done, while_saving, jobs);
    figure("kills of workers", (double)done, 500, "higher");
    figure("kills of workers in the middle of a checkpoint", (double)while_saving, 100, "higher");
    figure("kills of workers: textures that differ", (double)unequal, 0, "lower");
    CHECK(while_saving >= done / 10);
    if (check_failed_count == 0)
        file_remove_tree(root, NULL);
    return check_result();
}
