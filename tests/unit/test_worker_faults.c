/* test_worker_faults.c -- the check of a scene and an attempt of a job while calls of the system or of SQLite fail: the
 * machine is blamed, and what is asked again succeeds. And a folder that another worker does not leave. */
#include <sys/wait.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/worker/tasks.h"
#include "server/worker/worker.h"
#include "tests/check.h"
#include "tests/system_faults.h"

SYSTEM_CALL(int, stat, -1, true, (const char *path, struct stat *info), path, info)
SYSTEM_CALL(int, syncfs, -1, true, (int fd), fd)

/* Nobody is waited for. */
int usleep(useconds_t time) {
    (void)time;
    return 0;
}

static struct error err;
#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

#define FRAME(name) "{\"file_path\":\"" name "\",\"transform_matrix\":[[1,0,0,0.3],[0,1,0,0.3],[0,0,1,1]]}"
#define MESH "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
#define SETTINGS                                                                                                       \
    "\"texture_size\":64,\"iterations\":1,\"texels_per_iteration\":64,"                                                \
    "\"cameras_per_texel\":1,\"samples_per_camera\":2,\"report_samples\":1,\"preview_interval_sec\":60"

static char dir[64]; /* in memory where possible: much is made sure to be on disk */
static char *scene;  /* its files */

static void put(const char *name, const char *text) {
    char *path = mem_printf("%s/%s", dir, name);
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(path);
}

/* Two triangles, three photographs, a frame that is left out, and the archive of them. */
static void put_scene(void) {
    static const char *const names[] = {"a", "b", "c"};
    OK(file_make_dirs(scene, &err));
    put("scene/room.obj", MESH);
    for (int i = 0; i < 3; i++) {
        struct image image;
        char *path = mem_printf("%s/%s.png", scene, names[i]);
        image_init_rgb(&image, 8, 8);
        for (size_t k = 0; k < 192; k++)
            image.pixel[k] = 0.25f;
        OK(image_write_png(path, &image, 1.0f, &err));
        image_release(&image);
        mem_free(path);
    }
    put("scene/transforms.json",
        "{\"fl_x\":8,\"frames\":[" FRAME("a") "," FRAME("b") "," FRAME("c") "," FRAME("d") "]}");
    char *command = mem_printf("tar -C '%s' -cf '%s/archive' .", scene, dir);
    CHECK(system(command) == 0);
    mem_free(command);
}

static struct progress silent = {.fd = -1};

static enum status check(void) {
    struct order order = {.dir = dir, .kind = "check", .thread_count = 1};
    err = (struct error){0};
    return task_check(&order, &silent, &err);
}

static enum status reconstruct(const char *settings, const char *from, const char *reduced) {
    cJSON *json = cJSON_Parse(settings);
    struct order order = {.dir = dir,
                          .kind = "reconstruct",
                          .thread_count = 1,
                          .scene = from,
                          .scene_id = "x",
                          .name = "",
                          .reduced = reduced,
                          .settings = json};
    err = (struct error){0};
    enum status status = task_reconstruct(&order, &silent, &err);
    cJSON_Delete(json);
    return status;
}

/* --- a check ---------------------------------------------------------------------------------------- */

static void check_checking(void) {
    char *files = file_join(dir, "files");
    OK(check());
    CHECK(access(files, F_OK) == 0);
    bool struck = true;
    for (long n = 1; struck && check_failed_count == 0; n++) {
        faults_are_off = false;
        system_faults_arm(n);
        system_fault = EIO;
        enum status status = check();
        struck = system_faults_lift();
        faults_are_off = true;
        CHECK_THAT(status == STATUS_OK || (struck && status == STATUS_IO && *err.message), "call %ld (%s): %s: %s", n,
                   system_failed, status_name(status), err.message);
        CHECK(status != STATUS_OK || access(files, F_OK) == 0);
    }
    mem_free(files);
}

/* --- an attempt ------------------------------------------------------------------------------------- */

static void attempt_fails(const char *calls, long n, bool stays, const char *part) {
    faults_are_off = false;
    system_faults_arm_only(calls, n, stays);
    system_fault = EIO;
    enum status status = reconstruct("{" SETTINGS "}", scene, "");
    bool struck = system_faults_lift();
    faults_are_off = true;
    CHECK_THAT(struck && status == STATUS_IO && strstr(err.message, part), "%s: %s: %s", calls, status_name(status),
               err.message);
}

static void check_attempts(void) {
    OK(reconstruct("{" SETTINGS "}", scene, ""));
    OK(reconstruct("{" SETTINGS "}", scene, "texels_per_iteration was halved"));
    char *report = mem_printf("%s/out/report.json", dir);
    cJSON *json = NULL;
    OK(json_read(report, 1 << 20, &json, &err));
    CHECK(cJSON_GetObjectItem(json, "reduced_after_out_of_memory") != NULL);
    cJSON_Delete(json);
    mem_free(report);
    put("checkpoint.db", "this is no database, whatever it says; it is told, and a new one is begun");
    OK(reconstruct("{" SETTINGS "}", scene, ""));

    CHECK(reconstruct("{\"iterations\":\"many\"}", scene, "") == STATUS_INPUT && strstr(err.message, "iterations"));
    CHECK(reconstruct("{" SETTINGS ",\"transforms\":\"other.json\"}", scene, "") == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "no cameras: the bundle has no other.json"), "%s", err.message);
    CHECK(reconstruct("{" SETTINGS "}", "/nowhere", "") == STATUS_NOT_FOUND && strstr(err.message, "/nowhere"));
    attempt_fails(" mkdir ", 1, false, "cannot create folder");
    attempt_fails(" open ", 1, false, "checkpoint.db");
    attempt_fails(" stat ", 2, true, "cannot look at");
    bool is_output = false; /* until it is what was written that cannot be read */
    for (long n = 1; !is_output && check_failed_count == 0; n++) {
        faults_are_off = false;
        system_faults_arm_only(" read ", n, false);
        system_fault = EIO;
        enum status read = reconstruct("{" SETTINGS "}", scene, "");
        CHECK(system_faults_lift());
        faults_are_off = true;
        CHECK_THAT(read == STATUS_OK || (read == STATUS_IO && strstr(err.message, "cannot read")), "read %ld: %s: %s",
                   n, status_name(read), err.message);
        is_output = strstr(err.message, "/out/") != NULL;
    }
    put("checkpoint.db", ""); /* all is to be saved again */
    faults_are_off = false;
    sql_break();
    sql_faults_only = "INSERT INTO tiles";
    enum status status = reconstruct("{" SETTINGS "}", scene, "");
    sql_mend();
    faults_are_off = true;
    CHECK_THAT(status == STATUS_IO && strstr(err.message, "checkpoint.db"), "%s: %s", status_name(status), err.message);
    OK(reconstruct("{" SETTINGS "}", scene, ""));
}

/* --- the folder ------------------------------------------------------------------------------------- */

/* In a process of its own, where the n-th call of that name fails, the worker fails and says why. */
static void check_entry(const char *call, long n, const char *part) {
    char *log = file_join(dir, "log");
    pid_t child = fork();
    if (child == 0) {
        char name[] = "worker", *argv[] = {name, dir, NULL};
        int fd = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        dup2(fd, STDERR_FILENO);
        faults_are_off = false;
        if (call)
            system_faults_arm_only(call, n, true);
        system_fault = EIO;
        exit(worker_main(2, argv)); /* make coverage: its counts are written */
    }
    int status = 0;
    struct buf said;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status));
    CHECK_THAT(WEXITSTATUS(status) == PROGRESS_EXIT_FAILED, "%s: exit status %d", part, WEXITSTATUS(status));
    buf_init(&said, 1 << 16);
    OK(file_read(log, &said, &err));
    CHECK_THAT(strstr(buf_text(&said), part), "%s", buf_text(&said));
    buf_release(&said);
    mem_free(log);
}

static void check_folder(void) {
    put("job.json", "{\"kind\":\"check\",\"scene_id\":\"x\",\"thread_count\":1,\"sandbox\":false}");
    check_entry(" open ", 2, "cannot open folder");
    check_entry(" flock ", 1, "cannot lock folder");
    int lock = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    CHECK(flock(lock, LOCK_EX | LOCK_NB) == 0);
    check_entry(NULL, 0, "another worker is in folder");
    close(lock);
}

int main(void) {
    faults_are_off = true;
    snprintf(dir, sizeof dir, "%s/unbake-test-worker-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    scene = file_join(dir, "scene");
    put_scene();
    check_checking();
    check_attempts();
    check_folder();
    mem_free(scene);
    OK(file_remove_tree(dir, &err));
    return check_result();
}
