/* fault_daemon BUILD ARCHIVE disk|memory STEP ALL -- the daemon's n-th operation on a file or n-th
 * allocation fails, for every STEP-th n: a disk by ENOSPC or EIO, once or from then on, memory once or
 * from then on (ALL: 1 for all of these at each n, 0 for one in turn). First while clients send scenes,
 * upload in parts, make, change and remove jobs that never run; then, of a disk, over the life of jobs
 * that do (without ALL at every sixth of these n).
 *
 * Each request does what it should or says why not: 507 for a full disk, 500 for a broken one, and on a
 * full disk what is there can be removed. Without memory a request may find its connection closed, and
 * the daemon may end, by the status that says so and never by a signal: it is started again. Nothing that
 * was acknowledged is lost; afterwards all goes on, and jobs succeed; no descriptor, no file and no
 * memory is left over. */
#include "tests/chaos/fault_requests.h"

#define ROUNDS_PER_LIFE 100 /* then the daemon is stopped, which looks for leaks, and started again */

/* --- after ---------------------------------------------------------------------------------------------- */

static void check_things(void) {
    for (size_t i = 0; i < thing_count; i++) {
        struct buf body;
        const struct thing *it = &thing[i];
        char part[40];
        int status = http_get(daemon_.port, it->path, &body);
        snprintf(part, sizeof part, "\"state\":\"%s\"", it->state);
        CHECK_THAT(it->is_unsure || status == (it->is_gone ? 404 : 200), "%s: %s gets %d", round_, it->path, status);
        CHECK_THAT(it->is_unsure || it->is_gone || !*it->state || strstr(buf_text(&body), part), "%s: %s is not %s: %s",
                   round_, it->path, it->state, buf_text(&body));
        buf_release(&body);
    }
}

/* What counts of an upload is what was sent. */
static void check_upload(long number) {
    struct buf body, bytes;
    unsigned char sent[600];
    char hex[65] = "";
    int status = *kept_upload ? http_get(daemon_.port, kept_upload, &body) : 0;
    if (!*kept_upload)
        return;
    fill(sent, number);
    const char *offset = strstr(buf_text(&body), "\"offset\":"), *made = strstr(buf_text(&body), "\"scene\":\"");
    size_t length = offset ? strtoull(offset + 9, NULL, 10) : 0;
    if (made)
        sscanf(made + 9, "%64[0-9a-f]", hex);
    char *path = *hex ? mem_printf("%s/scenes/%s/archive", daemon_.data, hex)
                      : mem_printf("%s%s", daemon_.data, kept_upload + strlen("/v1"));
    buf_init(&bytes, 1 << 20);
    CHECK_THAT(status != 200 || (file_read(path, &bytes, NULL) == STATUS_OK && bytes.length >= length &&
                                 length <= 600 && memcmp(bytes.data ? bytes.data : "", sent, length) == 0),
               "%s: of %zu bytes of an upload not all are as they were sent", round_, length);
    buf_release(&bytes);
    buf_release(&body);
    mem_free(path);
}

/* After a failure the scheduler looks again in five seconds, or when there is something new. */
static void wake(void) {
    char path[40];
    struct buf body;
    CHECK(submit("wakes", 3, path));
    http_ask(daemon_.port, "DELETE", path, "", "", 0, &body);
    buf_release(&body);
}

/* Removes all that a listing has, but for the scene that jobs use. */
static void clear(const char *folder) {
    char list[40], path[120];
    snprintf(list, sizeof list, "/v1/%s?limit=200", folder);
    for (int tries = 0; tries < 3000; tries++) {
        struct buf body, reply;
        long left = 0;
        cJSON *value = NULL;
        const cJSON *item;
        CHECK(http_get(daemon_.port, list, &body) == 200);
        json_parse(buf_text(&body), body.length, "a list", &value, NULL);
        cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(value, "items")) {
            const cJSON *id = cJSON_GetObjectItemCaseSensitive(item, "id");
            if (cJSON_IsString(id) && strcmp(id->valuestring, scene) == 0)
                continue;
            if (cJSON_IsString(id))
                snprintf(path, sizeof path, "/v1/%s/%s", folder, id->valuestring);
            else
                snprintf(path, sizeof path, "/v1/%s/%.0f", folder, id ? id->valuedouble : 0.0);
            int status = http_ask(daemon_.port, "DELETE", path, TUS, "", 0, &reply);
            CHECK_THAT(status == 204 || status == 409, "%s: DELETE %s gets %d: %s", round_, path, status,
                       buf_text(&reply));
            buf_release(&reply);
            left++;
        }
        cJSON_Delete(value);
        buf_release(&body);
        if (left == 0)
            return;
        if (tries == 3)
            wake();
        if (tries > 3)
            usleep(20000); /* a scene is being checked */
    }
    CHECK_THAT(false, "%s: %s cannot be removed", round_, folder);
}

static void clear_all(void) {
    clear("jobs");
    clear("uploads");
    clear("scenes");
}

static long count_entries(const char *path) {
    DIR *folder = opendir(path);
    long count = -2;
    while (folder && readdir(folder))
        count++;
    if (folder)
        closedir(folder);
    return count;
}

static long count_descriptors(void) {
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/fd", (int)daemon_.pid);
    return count_entries(path);
}

/* Stops the daemon and starts it again: nothing has leaked, the database is whole, no file is left. */
static void renew(long scenes) {
    static const char *const folders[] = {"scenes", "jobs", "uploads", "trash"};
    int status;
    clear_all();
    kill(daemon_.pid, SIGTERM);
    waitpid(daemon_.pid, &status, 0);
    CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == 0, "%s: the daemon ends with %x", round_, (unsigned)status);
    daemon_start(&daemon_);
    for (size_t i = 0; i < 4; i++) {
        char *path = file_join(daemon_.data, folders[i]);
        long count = count_entries(path);
        for (int ms = 0; i == 3 && count > 0 && ms < 20000; ms += 10) { /* removed after the start, not before it */
            usleep(10000);
            count = count_entries(path);
        }
        CHECK_THAT(count == (i == 0 ? scenes : 0), "%s: %ld things are left in %s", round_, count, path);
        mem_free(path);
    }
}

/* --- the rounds ------------------------------------------------------------------------------------------- */

/* One of `ways` ways to fail. */
static void arm(long n, long way) {
    bool for_good = is_memory ? way % 2 : way / 2;
    int error = is_memory ? ENOMEM : way % 2 ? EIO : ENOSPC;
    snprintf(round_, sizeof round_, "%s %ld fails %s with %s", is_memory ? "allocation" : "operation", n,
             for_good ? "for good" : "once", strerrorname_np(error));
    thing_count = 0;
    faults_arm(faults, FAULTS_DAEMON, n, error, for_good);
}

/* Whether no thread of the daemon is at work. */
static bool is_at_rest(void) {
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task", (int)daemon_.pid);
    DIR *folder = opendir(path);
    bool rests = true;
    for (const struct dirent *it; folder && rests && (it = readdir(folder));) {
        struct buf stat;
        char *file = mem_printf("%s/%s/stat", path, it->d_name);
        buf_init(&stat, 4096);
        const char *state = file_read(file, &stat, NULL) == STATUS_OK ? strrchr(buf_text(&stat), ')') : NULL;
        rests = !state || (state[2] != 'R' && state[2] != 'D');
        buf_release(&stat);
        mem_free(file);
    }
    if (folder)
        closedir(folder);
    return rests;
}

/* Without memory it may have ended, if it said why; then there is another. A thread that got none may still be on
 * its way to the end, while others answer. */
static void revive(void) {
    struct buf body;
    int status = 0;
    for (int i = 0; is_memory && i < 3000 && !is_at_rest(); i++)
        usleep(10000);
    bool lives = !is_memory || http_get(daemon_.port, "/healthz", &body) == 200;
    if (is_memory)
        buf_release(&body);
    if (lives)
        return;
    for (int i = 0; i < 6000 && waitpid(daemon_.pid, &status, WNOHANG) != daemon_.pid; i++)
        usleep(10000);
    CHECK_THAT(WIFEXITED(status) && WEXITSTATUS(status) == MEM_EXIT_STATUS, "%s: the daemon ends with %x", round_,
               (unsigned)status);
    ends++;
    daemon_start(&daemon_);
}

/* False when there is no n-th operation. */
static bool talk_once(long n, long way) {
    static long number;
    arm(n, way);
    talk(++number);
    bool struck = atomic_load(&faults->failed) > 0;
    faults_lift(faults);
    revive();
    check_things();
    check_upload(number);
    clear_all();
    strikes += struck;
    return struck;
}

static bool wait_for(const char *path, const char *state, double seconds) {
    char part[40];
    bool is_so = false;
    snprintf(part, sizeof part, "\"state\":\"%s\"", state);
    for (double end = clock_sec() + seconds; !is_so; usleep(10000)) {
        struct buf body;
        http_get(daemon_.port, path, &body);
        is_so = strstr(buf_text(&body), part) != NULL;
        buf_release(&body);
        if (clock_sec() >= end)
            break;
    }
    return is_so;
}

/* Whether it succeeds in the end; where the failing disk has paused it, now or in a moment, it is resumed. */
static bool comes_to_its_end(const char *path) {
    bool is_over = false;
    for (double end = clock_sec() + 120.0; !is_over && clock_sec() < end;) {
        struct buf body;
        if (wait_for(path, "paused", 0.0)) {
            char *resume = mem_printf("%s/resume", path);
            CHECK(ask(202, "POST", resume, "", "", 0, &body));
            buf_release(&body);
            mem_free(resume);
        }
        is_over = wait_for(path, "succeeded", 0.1);
    }
    return is_over;
}

/* A job lives while the disk fails; then it is well again, and this job and another succeed. */
static bool live_once(long n, long way) {
    char first[40], second[40];
    arm(n, way);
    bool made = submit("first", 3, first);
    /* Until it has been struck for a while, or its life is over. */
    for (int left = 50; made && left > 0 && !wait_for(first, "succeeded", 0.0); left -= has_struck())
        usleep(10000);
    bool struck = atomic_load(&faults->failed) > 0;
    faults_lift(faults);
    CHECK(submit("second", 3, second));
    CHECK_THAT(!made || comes_to_its_end(first), "%s: the job does not succeed", round_);
    CHECK_THAT(wait_for(second, "succeeded", 120.0), "%s: the next job does not succeed", round_);
    clear_all();
    strikes += struck;
    return struck;
}

/* With jobs that wait since no disk is large enough, or jobs that run. */
static void begin(const char *build, bool jobs_wait, const char *archive) {
    static char library[PATH_MAX];
    char page[128];
    daemon_init(&daemon_, build);
    const char *settings[] = {"min_free_mib=0",
                              "max_running=1",
                              "threads=1",
                              "log_level=error",
                              "checkpoint_interval_sec=0.1",
                              jobs_wait ? "low_disk_mib=16000000" : "low_disk_mib=0"};
    memcpy(daemon_.settings, settings, sizeof settings);
    preload_find(build, is_memory ? "memory" : "files", library);
    snprintf(page, sizeof page, "%s/faults", daemon_.dir);
    faults = faults_new(page, daemon_.data, NULL);
    if (!faults)
        exit(1);
    setenv("UNBAKE_FAULTS", page, 1);
    daemon_.preload = library;
    daemon_.ready_path = "/healthz"; /* with jobs that wait for room it is not "ready" */
    daemon_start(&daemon_);
    daemon_scene(&daemon_, archive, scene);
}

static long go_on(bool (*round)(long n, long way), long step, bool all) {
    bool more = true;
    long n = 1, rounds = 0, before = 0, ways = is_memory ? 2 : 4;
    for (long turn = 0; more && check_failed_count == 0; n += step, turn++)
        for (long way = all ? 0 : turn % ways; more && way < (all ? ways : turn % ways + 1); way++) {
            more = round(n, way);
            if (++rounds == 4)
                before = count_descriptors();
            if (rounds % ROUNDS_PER_LIFE == 0)
                renew(1);
        }
    for (int i = 0; i < 6000 && count_descriptors() > before + 3; i++)
        usleep(10000); /* the last connections are being closed */
    CHECK_THAT(rounds < 5 || count_descriptors() <= before + 3, "%ld descriptors are open, there were %ld",
               count_descriptors(), before);
    renew(1);
    return n - step;
}

int main(int argc, char **argv) {
    long step = argc == 6 ? strtol(argv[4], NULL, 10) : 0;
    if (step <= 0)
        return 2;
    bool all = argv[5][0] == '1';
    is_memory = strcmp(argv[3], "memory") == 0;
    begin(argv[1], true, argv[2]);
    long talked = go_on(talk_once, step, all), lived = 0;
    daemon_remove(&daemon_);
    if (check_failed_count == 0 && !is_memory) {
        begin(argv[1], false, argv[2]);
        lived = go_on(live_once, all ? step : 6 * step, all); /* a life takes longer than a talk */
        daemon_remove(&daemon_);
    }
    printf("the daemon, %s: %ld in a talk, %ld in a job's life; %ld made to fail; %ld requests, %ld ends\n",
           is_memory ? "allocations" : "operations on files", talked, lived, strikes, requests, ends);
    if (is_memory) {
        figure("no memory, daemon: allocations made to fail", (double)strikes, 1000, "higher");
        figure("no memory, daemon: crashes, wrong answers, losses", check_failed_count, 0, "lower");
    } else {
        figure("failing disk, daemon: operations made to fail", (double)strikes, 500, "higher");
        figure("failing disk, daemon: wrong answers, losses, leaks", check_failed_count, 0, "lower");
        CHECK(lived > 60);
    }
    CHECK(talked > 100);
    return check_result();
}
