/* test_progress.c -- what a worker says on its pipe, as the daemon hears it: a worker has parsed
 * untrusted files, so it may say anything. The first byte chooses a job's attempt or a scene's
 * check; the outcome is entered after. */
#include <fcntl.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/views.h"
#include "server/job/counters.h"
#include "server/job/line_reader.h"
#include "server/job/outcome.h"
#include "server/job/worker_messages.h"
#include "server/worker/progress.h"
#include "tests/fuzz/fuzz.h"

#define SCENE "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define CHECKED "ffeeddccbbaa99887766554433221100ffeeddccbbaa99887766554433221100"
#define JOBS_MAX 50        /* then the store is made anew */
#define SIZE_MAX_HERE 4096 /* each line of it may be a transaction */

static struct store *store;
static int job_count;

static void start(void) {
    struct error err;
    bool existed;
    log_set_level(LOG_ERROR);
    job_count = 0;
    MUST_OK(store_open(&store, fuzz_folder(), &err), &err);
    MUST_OK(store_scene_add(store, SCENE, "room", 10, 0, &existed, &err), &err);
    MUST_OK(store_scene_ready(store, SCENE, NULL, "{}", &err), &err);
    char *out = file_join(fuzz_folder(), "out/preview"), *file = file_join(fuzz_folder(), "out/a.exr");
    MUST_OK(file_make_dirs(out, &err), &err);
    fuzz_write(file, (const uint8_t *)"0123456789", 10);
    mem_free(file);
    mem_free(out);
}

static void stop(void) {
    char *path = file_join(fuzz_folder(), "state.db"), *log = file_join(fuzz_folder(), "state.db-wal");
    store_close(store);
    unlink(path);
    unlink(log);
    mem_free(log);
    mem_free(path);
}

/* A pipe that holds the bytes, its other end closed. */
static int pipe_of(const uint8_t *data, size_t size) {
    int ends[2];
    MUST(pipe2(ends, O_CLOEXEC | O_NONBLOCK) == 0);
    MUST(write(ends[1], data, size) == (ssize_t)size);
    close(ends[1]);
    return ends[0];
}

/* A run that has said the bytes, and has ended. */
struct said {
    struct run run;
    struct line_reader lines;
    struct run_end end;
};

static struct said *said_of(struct run *run) { return (struct said *)(void *)run; }

static void said_read(struct run *run, run_line_fn *each, void *user) {
    struct said *said = said_of(run);
    line_reader_read(&said->lines, SIZE_MAX, each, user);
    run->long_lines = said->lines.dropped;
}

static bool said_ended(struct run *run, struct run_end *end, run_line_fn *each, void *user) {
    said_read(run, each, user);
    *end = said_of(run)->end;
    return true;
}

static double said_cpu_sec(const struct run *run) {
    (void)run;
    return 0.0;
}

static char *said_last_words(const struct run *run, size_t limit) {
    (void)run, (void)limit;
    return mem_strdup("");
}

static void said_free(struct run *run) {
    line_reader_release(&said_of(run)->lines);
    mem_free(run);
}

static struct said *said_new(const uint8_t *data, size_t size) {
    static const struct run_kind kind = {.read = said_read,
                                         .ended = said_ended,
                                         .cpu_sec = said_cpu_sec,
                                         .log_tail = said_last_words,
                                         .free = said_free};
    struct said *said = mem_calloc(1, sizeof *said);
    said->run.kind = &kind;
    line_reader_init(&said->lines, pipe_of(data, size));
    return said;
}

/* A scene that waits for its check, whatever became of it the last time. */
static void start_check(void) {
    struct error err;
    bool existed;
    store_scene_delete(store, CHECKED, -1, false, &existed, NULL);
    MUST_OK(store_scene_add(store, CHECKED, "room", 10, 0, &existed, &err), &err);
}

static int64_t start_job(int *number) {
    struct error err;
    struct job_new job = {.scene_id = SCENE, .name = "job", .labels = "{}", .settings = "{}", .max_attempts = 2};
    int64_t id;
    bool replayed;
    MUST_OK(store_job_add(store, &job, 100, &id, &replayed, &err), &err);
    MUST_OK(store_job_start(store, id, "process", number, &err), &err);
    return id;
}

/* --- what came of it: it is shown to clients --------------------------------------------------- */

static void check_json(const char *text) {
    struct error err;
    cJSON *value;
    MUST_OK(json_parse(text, strlen(text), "what is kept", &value, &err), &err);
    cJSON_Delete(value);
}

static void check_event(void *user, int64_t id, int64_t at_ms, int attempt, const char *type, const char *data) {
    (void)user, (void)id, (void)at_ms, (void)attempt, (void)type;
    check_json(data);
}

static void check_job(int64_t id) {
    struct error err;
    struct job job;
    MUST_OK(store_event_list(store, id, 0, 1000, check_event, NULL, &err), &err);
    MUST_OK(store_job_get(store, id, &job, &err), &err);
    cJSON *view = view_job(&job, &(struct caller){.role = ROLE_ADMIN});
    char *text = json_text(view);
    check_json(text);
    mem_free(text);
    cJSON_Delete(view);
    job_release(&job);
}

static void check_scene(void) {
    struct error err;
    struct scene_row row;
    MUST_OK(store_scene_get(store, CHECKED, &row, &err), &err);
    check_json(row.problems);
    check_json(row.facts);
    scene_row_release(&row);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct counters counters;
    struct attempt a = {.phase = ATTEMPT_ALIVE,
                        .iteration = -1.0,
                        .data_dir = fuzz_folder(),
                        .dir = mem_strdup(fuzz_folder()),
                        .whole_dir = mem_strdup(fuzz_folder()),
                        .scene_id = CHECKED,
                        .settings = mem_strdup("{}"),
                        .number = 1};
    int64_t job_id = 0;
    if (size < 1 || size > SIZE_MAX_HERE) {
        mem_free(a.dir);
        mem_free(a.whole_dir);
        mem_free(a.settings);
        return 0;
    }
    if (!store)
        start();
    start_check();
    if (data[0] & 1)
        job_id = a.job_id = start_job(&a.number);
    else
        a.problems = cJSON_CreateArray();
    struct said *said = said_new(data + 1, size - 1);
    said->end.code = data[0] & 2 ? PROGRESS_EXIT_OK : data[0] & 4 ? PROGRESS_EXIT_INPUT : PROGRESS_EXIT_FAILED;
    a.run = &said->run;
    worker_messages_read(&a, store, &counters);
    MUST(a.phase == ATTEMPT_ENDED);
    struct error err;
    enum status status = outcome_settle(&a, store, NULL, &counters, &err);
    MUST_OK(status, &err);
    MUST(a.phase == ATTEMPT_EMPTY);
    if (job_id)
        check_job(job_id);
    else
        check_scene();
    if (++job_count > JOBS_MAX) {
        stop();
        store = NULL;
    }
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 600;
    seeds_text(s, "3{\"type\":\"stage\",\"stage\":\"refine\"}\n"
                  "{\"type\":\"progress\",\"stage\":\"refine\",\"done\":120,\"total\":1000,\"eta_sec\":33.5}\n"
                  "{\"type\":\"metric\",\"series\":\"loss\",\"step\":120,\"value\":0.0123}\n"
                  "{\"type\":\"metric\",\"series\":\"loss\",\"step\":140,\"value\":0.0113}\n"
                  "{\"type\":\"metric\",\"series\":\"rays\",\"step\":120,\"value\":1e9}\n"
                  "{\"type\":\"checkpoint\",\"iteration\":120,\"bytes\":1e6,\"seconds\":0.5}\n"
                  "{\"type\":\"space\",\"bytes\":1e9}\n");
    seeds_text(
        s, "3{\"type\":\"output\",\"name\":\"a.exr\",\"bytes\":10,\"sha256\":\"" SCENE "\","
           "\"content_type\":\"image/x-exr\"}\n{\"type\":\"preview\",\"name\":\"../a\",\"bytes\":10,\"sha256\":\"\"}\n"
           "{\"type\":\"log\",\"level\":\"info\",\"message\":\"hello\"}\n");
    seeds_text(s,
               "1{\"type\":\"end\",\"status\":\"no-space\",\"message\":\"full\",\"hint\":\"free some\"}\n{}\n[]\n3\n");
    seeds_text(s, "4{\"type\":\"problem\",\"file\":\"images/003.png\",\"reason\":\"damaged\",\"hint\":\"\"}\n");
    seeds_text(s, "2{\"type\":\"scene\",\"facts\":{\"triangle_count\":12}}\n");
    seeds_text(s, "2{\"type\":\"scene\",\"facts\":[]}\n{\"type\":\"scene\"}\n");
}
