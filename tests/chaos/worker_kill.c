/* worker_kill BUILD ROOM KILLS -- workers are killed with SIGKILL while they iterate, while they write
 * a checkpoint (at one of its operations on files), and anywhere; each next one goes on from the newest checkpoint. Every job that comes
 * of it has the textures, byte for byte, of one that nobody disturbed. */
#include <sys/stat.h>

#include "tests/chaos/faults.h"
#include "tests/chaos/worker.h"

#define KILLS_PER_JOB 25
#define SETTINGS                                                                                                \
    "\"texture_size\":128,\"iterations\":400,\"texels_per_iteration\":512,\"coarse_levels\":2,"                     \
    "\"cameras_per_texel\":1,\"samples_per_camera\":4,\"report_samples\":1,\"preview_interval_sec\":60"

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
    char *path = file_join(dir, "checkpoint.db-journal");
    bool saving = stat(path, &info) == 0 && info.st_size > 0;
    mem_free(path);
    return saving;
}

enum kind { WHILE_IT_ITERATES, WHILE_IT_SAVES, ANYWHERE };

/* Of the operations on files of one save, one is the last that the worker lives to see. */
static void kill_in_save(int fd) {
    faults_arm(faults, FAULTS_WORKER, 0, 0, false);
    if (!worker_hear(fd, "\"checkpoint\"", 120.0))
        return;
    unsigned operations = (unsigned)atomic_load(&faults->count);
    faults_arm(faults, FAULTS_WORKER, 1 + draw(operations + 1), FAULTS_KILL, true);
    worker_hear(fd, "nothing", 120.0); /* until it is dead, or has ended */
}

/* One life; true when it ended by itself, in success. */
static bool live(const char *dir, enum kind kind, long *while_saving) {
    int fd, status;
    pid_t pid = worker_start(binary, dir, library, "/dev/null", &fd);
    if (kind == ANYWHERE) {
        worker_hear(fd, "\"end\"", draw(600) * 1e-3);
    } else if (worker_hear(fd, "\"checkpoint\"", 120.0)) {
        if (kind == WHILE_IT_ITERATES)
            usleep(draw(30000));
        if (kind == WHILE_IT_SAVES)
            kill_in_save(fd);
    }
    kill(pid, SIGKILL);
    faults_lift(faults);
    *while_saving += is_saving(dir);
    waitpid(pid, &status, 0);
    close(fd);
    CHECK_THAT(WIFSIGNALED(status) || WEXITSTATUS(status) == 0, "a worker ends with %d", WEXITSTATUS(status));
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static void finish(const char *dir) {
    int fd, status;
    pid_t pid = worker_start(binary, dir, NULL, "/dev/null", &fd);
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
    worker_order(dir, argv[2], 1, 2, 0.03, true, SETTINGS);
    finish(dir);
    worker_hash(dir, peace);
    mem_free(dir);
    while (done < kills && check_failed_count == 0) {
        dir = mem_printf("%s/war%ld", root, jobs++);
        file_make_dirs(dir, &err);
        bool ended = false;
        for (int i = 0; i < KILLS_PER_JOB && done < kills && !ended; i++) {
            worker_order(dir, argv[2], i + 1, 1 + (i + 1) % 2, 0.03, true, SETTINGS);
            ended = live(dir, i % 5 == 4 ? ANYWHERE : i % 2 ? WHILE_IT_SAVES : WHILE_IT_ITERATES, &while_saving);
            done += !ended;
        }
        if (!ended)
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
