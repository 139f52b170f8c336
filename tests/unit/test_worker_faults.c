/* test_worker_faults.c -- the check of a scene and an attempt of a job while calls of the system or of SQLite fail: the
 * machine is blamed, and what is asked again succeeds. And a folder that another worker does not leave. */
#include <sys/wait.h>

#include "server/worker/worker.h"
#include "tests/system_faults.h"
#include "tests/unit/tiny_scene.h"

SYSTEM_CALL(int, stat, -1, true, (const char *path, struct stat *info), path, info)
SYSTEM_CALL(int, syncfs, -1, true, (int fd), fd)

/* Nobody is waited for. */
int usleep(useconds_t time) {
    (void)time;
    return 0;
}

static void pack_scene(void) {
    char *command = mem_printf("tar -C '%s' -cf '%s/archive' .", scene, dir);
    CHECK(system(command) == 0);
    mem_free(command);
}

static enum status check(void) {
    struct order order = {.dir = dir, .kind = "check", .thread_count = 1};
    err = (struct error){0};
    return task_check(&order, &silent, &err);
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
    enum status status = reconstruct("{" TINY_SETTINGS "}", scene, "");
    bool struck = system_faults_lift();
    faults_are_off = true;
    CHECK_THAT(struck && status == STATUS_IO && strstr(err.message, part), "%s: %s: %s", calls, status_name(status),
               err.message);
}

static void check_attempts(void) {
    OK(reconstruct("{" TINY_SETTINGS "}", scene, ""));
    OK(reconstruct("{" TINY_SETTINGS "}", scene, "texels_per_iteration was halved"));
    char *report = mem_printf("%s/out/report.json", dir);
    cJSON *json = NULL;
    OK(json_read(report, 1 << 20, &json, &err));
    CHECK(cJSON_GetObjectItem(json, "reduced_after_out_of_memory") != NULL);
    cJSON_Delete(json);
    mem_free(report);
    put("checkpoint/checkpoint.db", "this is no database, whatever it says; it is told, and a new one is begun");
    OK(reconstruct("{" TINY_SETTINGS "}", scene, ""));

    CHECK(reconstruct("{\"iterations\":\"many\"}", scene, "") == STATUS_INPUT && strstr(err.message, "iterations"));
    CHECK(reconstruct("{" TINY_SETTINGS ",\"transforms\":\"other.json\"}", scene, "") == STATUS_INPUT);
    CHECK_THAT(strstr(err.message, "no cameras: the bundle has no other.json"), "%s", err.message);
    CHECK(reconstruct("{" TINY_SETTINGS "}", "/nowhere", "") == STATUS_NOT_FOUND && strstr(err.message, "/nowhere"));
    attempt_fails(" mkdir ", 1, false, "cannot create folder");
    attempt_fails(" open ", 1, false, "checkpoint.db");
    attempt_fails(" stat ", 1, false, "/out/preview/radiance.png"); /* its size, before it is announced */
    attempt_fails(" stat ", 2, true, "cannot access");
    bool is_output = false; /* until it is what was written that cannot be read */
    for (long n = 1; !is_output && check_failed_count == 0; n++) {
        faults_are_off = false;
        system_faults_arm_only(" read ", n, false);
        system_fault = EIO;
        enum status read = reconstruct("{" TINY_SETTINGS "}", scene, "");
        CHECK(system_faults_lift());
        faults_are_off = true;
        CHECK_THAT(read == STATUS_OK || (read == STATUS_IO && strstr(err.message, "cannot read")), "read %ld: %s: %s",
                   n, status_name(read), err.message);
        is_output = strstr(err.message, "/out/") != NULL;
    }
    put("checkpoint/checkpoint.db", ""); /* all is to be saved again */
    faults_are_off = false;
    sql_break();
    sql_faults_only = "INSERT INTO tiles";
    enum status status = reconstruct("{" TINY_SETTINGS "}", scene, "");
    sql_mend();
    faults_are_off = true;
    CHECK_THAT(status == STATUS_IO && strstr(err.message, "checkpoint.db"), "%s: %s", status_name(status), err.message);
    OK(reconstruct("{" TINY_SETTINGS "}", scene, ""));
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
    tiny_scene_make("test-worker");
    pack_scene();
    check_checking();
    check_attempts();
    check_folder();
    tiny_scene_remove();
    return check_result();
}
