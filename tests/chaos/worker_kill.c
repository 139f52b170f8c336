/* worker_kill BUILD ROOM KILLS -- workers are killed with SIGKILL while they iterate, while they write
 * a checkpoint, and anywhere; each next one goes on from the newest checkpoint. Every job that comes
 * of it has the textures, byte for byte, of one that nobody disturbed. */
#include <poll.h>

#include "common/sha256.h"
#include "server/worker/progress.h"
#include "tests/chaos/daemon.h"

#define KILLS_PER_JOB 25

static const char *const outputs[] = {"base_color.exr", "roughness.exr", "specular.exr", "emission.exr",
                                      "confidence.exr", "scene.ply"};
#define OUTPUTS (sizeof outputs / sizeof *outputs)

static char binary[512];
static unsigned random_ = 99;

static unsigned draw(unsigned limit) {
    random_ = random_ * 1664525u + 1013904223u;
    return (random_ >> 8) % limit;
}

static void write_order(const char *dir, const char *room, int attempt) {
    char *path = file_join(dir, "job.json");
    char *text = mem_printf(
        "{\"kind\":\"reconstruct\",\"scene\":\"%s\",\"scene_id\":\"x\",\"name\":\"x\",\"job_id\":1,\"attempt\":%d,"
        "\"thread_count\":%d,\"memory_bytes\":0,\"sandbox\":true,\"checkpoint_interval_sec\":0.03,\"settings\":"
        "{\"texture_size\":128,\"iterations\":400,\"texels_per_iteration\":512,\"coarse_levels\":2,"
        "\"cameras_per_texel\":1,\"samples_per_camera\":4,\"report_samples\":1,\"preview_interval_sec\":60}}",
        room, attempt, 1 + attempt % 2);
    struct error err;
    if (file_replace(path, text, strlen(text), &err) != STATUS_OK)
        exit(1);
    mem_free(text);
    mem_free(path);
}

static pid_t start(const char *dir, int *pipe_fd) {
    int ends[2];
    pid_t parent = getpid();
    if (pipe(ends) != 0)
        exit(1);
    pid_t pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent || dup2(ends[1], PROGRESS_FD) < 0 || !freopen("/dev/null", "w", stderr))
            _exit(126);
        for (int fd = PROGRESS_FD + 1; fd < 64; fd++)
            close(fd);
        execl(binary, "unbaked", "worker", dir, (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    *pipe_fd = ends[0];
    return pid;
}

/* Reads the pipe until a line has `part`, the pipe ends, or so much time has passed. */
static bool hear(int fd, const char *part, double seconds) {
    static char text[1 << 16];
    size_t length = 0;
    double end = clock_sec() + seconds;
    for (;;) {
        struct pollfd wait = {.fd = fd, .events = POLLIN};
        double left = end - clock_sec();
        if (left <= 0.0 || poll(&wait, 1, (int)(left * 1e3) + 1) <= 0)
            return false;
        ssize_t got = read(fd, text + length, sizeof text - 1 - length);
        if (got <= 0)
            return false;
        length += (size_t)got;
        text[length] = '\0';
        if (strstr(text, part))
            return true;
        if (length > sizeof text / 2)
            length = 0;
    }
}

/* Whether the file is the journal of a transaction that is under way. */
static bool journal_is_hot(const char *dir) {
    unsigned char head[8] = {0};
    char *path = file_join(dir, "checkpoint.db-journal");
    FILE *file = fopen(path, "re");
    bool hot = file && fread(head, 1, 8, file) == 8 && head[0] == 0xd9 && head[1] == 0xd5;
    if (file)
        fclose(file);
    mem_free(path);
    return hot;
}

enum kind { WHILE_IT_ITERATES, WHILE_IT_SAVES, ANYWHERE };

/* One life; true when it ended by itself, in success. */
static bool live(const char *dir, enum kind kind, long *while_saving) {
    int fd, status;
    pid_t pid = start(dir, &fd);
    if (kind == ANYWHERE) {
        hear(fd, "\"end\"", draw(600) * 1e-3);
    } else if (hear(fd, "\"checkpoint\"", 120.0)) {
        if (kind == WHILE_IT_ITERATES)
            usleep(draw(30000));
        for (int i = 0; kind == WHILE_IT_SAVES && i < 4000 && !journal_is_hot(dir); i++)
            usleep(50);
        if (kind == WHILE_IT_SAVES)
            usleep(draw(2000));
    }
    kill(pid, SIGKILL);
    *while_saving += journal_is_hot(dir);
    waitpid(pid, &status, 0);
    close(fd);
    CHECK_THAT(WIFSIGNALED(status) || WEXITSTATUS(status) == 0, "a worker ends with %d", WEXITSTATUS(status));
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static void finish(const char *dir) {
    int fd, status;
    pid_t pid = start(dir, &fd);
    hear(fd, "\"end\"", 600.0);
    waitpid(pid, &status, 0);
    close(fd);
    CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "the last worker ends with %x", (unsigned)status);
}

static void hash(const char *dir, char sums[OUTPUTS][SHA256_HEX_SIZE]) {
    struct error err;
    for (size_t i = 0; i < OUTPUTS; i++) {
        char *path = mem_printf("%s/out/%s", dir, outputs[i]);
        CHECK_THAT(sha256_of_file(path, sums[i], &err) == STATUS_OK, "%s", err.message);
        mem_free(path);
    }
}

int main(int argc, char **argv) {
    long kills = argc == 4 ? strtol(argv[3], NULL, 10) : 0, while_saving = 0, done = 0, jobs = 0, unequal = 0;
    char peace[OUTPUTS][SHA256_HEX_SIZE], war[OUTPUTS][SHA256_HEX_SIZE];
    char root[] = "/tmp/unbake-chaos-XXXXXX";
    struct error err;
    if (kills <= 0 || !mkdtemp(root))
        return 2;
    snprintf(binary, sizeof binary, "%s/unbaked", argv[1]);
    char *dir = file_join(root, "peace");
    file_make_dirs(dir, &err);
    write_order(dir, argv[2], 1);
    finish(dir);
    hash(dir, peace);
    mem_free(dir);
    while (done < kills && check_failed_count == 0) {
        dir = mem_printf("%s/war%ld", root, jobs++);
        file_make_dirs(dir, &err);
        bool ended = false;
        for (int i = 0; i < KILLS_PER_JOB && done < kills && !ended; i++) {
            write_order(dir, argv[2], i + 1);
            ended = live(dir, i % 5 == 4 ? ANYWHERE : i % 2 ? WHILE_IT_SAVES : WHILE_IT_ITERATES, &while_saving);
            done += !ended;
        }
        if (!ended)
            finish(dir);
        hash(dir, war);
        for (size_t i = 0; i < OUTPUTS; i++) {
            unequal += strcmp(peace[i], war[i]) != 0;
            CHECK_THAT(strcmp(peace[i], war[i]) == 0, "job %ld: %s differs", jobs, outputs[i]);
        }
        if (check_failed_count == 0)
            file_remove_tree(dir, NULL);
        mem_free(dir);
    }
    printf("%ld kills of workers, %ld of them in the middle of a checkpoint, in %ld jobs\n", done, while_saving, jobs);
    figure("kills of workers", (double)done, 500, "higher");
    figure("kills of workers in the middle of a checkpoint", (double)while_saving, 100, "higher");
    figure("kills of workers: textures that differ", (double)unequal, 0, "lower");
    CHECK(while_saving > 0);
    if (check_failed_count == 0)
        file_remove_tree(root, NULL);
    return check_result();
}
