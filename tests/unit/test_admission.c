/* test_admission.c -- a job begins while there is memory for it by what the check of its scene foretells, alone in any
 * case; one that waits says why, and nothing behind it begins. */
#include "server/job/admission.h"

#include "common/output_names.h"

#include "server/store/job_files.h"
#include "tests/unit/fault_rig.h"

#define GIB 0x1p30

static const char facts[] = "{\"memory_bytes\":1073741824,\"memory_texture_size\":1024,\"memory_texel_bytes\":100}";

static double need_of(const char *with, const char *settings, int step, uint64_t worker_limit) {
    struct admission a;
    char *text = mem_strdup(settings);
    const struct job job = {.settings = text, .memory_step = step};
    admission_init(&a, 0, worker_limit);
    double need = admission_need(&a, with, &job);
    mem_free(text);
    return need;
}

/* For the textures that the attempt makes: as submitted, or as reduced after it ran out of memory. */
static void test_need(void) {
    CHECK_NEAR(need_of(facts, "{\"texture_size\":1024}", 0, 0), GIB, 0.5);
    CHECK_NEAR(need_of(facts, "{\"texture_size\":2048}", 0, 0), GIB + 100.0 * 3.0 * 1024 * 1024, 0.5);
    CHECK_NEAR(need_of(facts, "{\"texture_size\":512}", 0, 0), GIB - 75.0 * 1024 * 1024, 0.5);
    CHECK_NEAR(need_of(facts, "{\"texture_size\":2048}", 2, 0), GIB, 0.5);
    CHECK_NEAR(need_of(facts, "{\"texture_size\":2048}", 0, 1 << 28), 0x1p28, 0.5);
    CHECK_NEAR(need_of(facts, "{\"texture_size\":\"x\"}", 0, 0), GIB, 0.5);
    static const char *const unknown[] = {"{}",
                                          "",
                                          "[]",
                                          "{\"memory_bytes\":\"x\"}",
                                          "{\"memory_bytes\":-1}",
                                          "{\"memory_bytes\":1e9,\"memory_texture_size\":[]}"};
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++)
        CHECK(need_of(unknown[i], "{}", 0, 0) == 0.0);
    static const char reduced[] =
        "{\"memory_bytes\":1073741824,\"memory_texture_size\":2048,\"memory_texel_bytes\":100,"
        "\"memory_kept_pixels\":3.2e6,\"memory_whole_bytes\":4294967296}";
    CHECK_NEAR(need_of(reduced, "{}", 0, 0), GIB, 0.5);
    CHECK_NEAR(need_of(reduced, "{\"quality\":\"draft\"}", 0, 0), GIB, 0.5);
    CHECK_NEAR(need_of(reduced, "{\"quality\":\"fine\"}", 0, 0), 4.0 * GIB, 0.5);
    CHECK_NEAR(need_of(reduced, "{\"photograph_megapixels\":6}", 0, 0), 4.0 * GIB, 0.5);
    CHECK_NEAR(need_of("{\"memory_bytes\":1e9}", "{}", 0, 0), 1e9, 0.5); /* of a version that did not tell more */
}

static void expect_reason(int64_t id, const char *wanted) {
    struct job job;
    OK(store_job_get(store, id, &job, &err));
    CHECK_THAT(*wanted ? strstr(job.reason, wanted) != NULL && *job.hint : !*job.reason, "job %lld: \"%s\"",
               (long long)id, job.reason);
    job_release(&job);
}

static bool ask(struct admission *a, int64_t id, size_t running, double used) {
    bool may;
    double need;
    OK(admission_decide(a, store, id, running, used, &may, &need, &err));
    CHECK_NEAR(need, GIB, 0.5);
    return may;
}

static void test_ask(void) {
    struct admission a;
    struct job job;
    char scene[SCENE_ID_SIZE];
    bool existed, replayed, may;
    double need;
    int64_t ids[3];
    int number;
    snprintf(scene, sizeof scene, "bbbb%.60s", SCENE_A);
    OK(store_scene_add(store, scene, "scene", 1, 0, &existed, &err));
    OK(store_scene_ready(store, scene, NULL, facts, &err));
    for (int i = 0; i < 3; i++) {
        const struct job_new new = {
            .scene_id = scene, .name = "job", .labels = "{}", .settings = "{\"texture_size\":1024}", .max_attempts = 2};
        OK(store_job_add(store, &new, 1000, &ids[i], &replayed, &err));
    }
    admission_init(&a, (uint64_t)5 << 29, 0); /* 2.5 GiB */
    CHECK(ask(&a, ids[0], 0, 0.0) && ask(&a, ids[1], 1, GIB));
    CHECK(!ask(&a, ids[1], 2, 2.0 * GIB));
    expect_reason(ids[1], "waits for memory: it needs about 1.0 GiB, and all jobs that run may take 2.5 GiB together");
    expect_reason(ids[0], "");
    OK(store_job_get(store, ids[1], &job, &err));
    int64_t revision = job.revision;
    job_release(&job);
    CHECK(!ask(&a, ids[1], 2, 2.0 * GIB)); /* told once */
    OK(store_job_get(store, ids[1], &job, &err));
    CHECK(job.revision == revision);
    job_release(&job);
    /* Another one's turn. */
    CHECK(!ask(&a, ids[2], 2, 2.0 * GIB));
    expect_reason(ids[1], "");
    expect_reason(ids[2], "waits for memory");
    CHECK(ask(&a, ids[2], 1, GIB));
    expect_reason(ids[2], "");
    /* A daemon that starts finds what an earlier one has told. */
    CHECK(!ask(&a, ids[2], 2, 2.0 * GIB));
    admission_init(&a, 1 << 20, 0);
    CHECK(ask(&a, ids[0], 0, 0.0)); /* alone, though there is too little */
    expect_reason(ids[2], "");
    CHECK(!ask(&a, ids[1], 1, 0.0)); /* beside one of which nothing is known */
    OK(store_job_start(store, ids[1], "process", &number, &err));
    expect_reason(ids[1], "");
    /* One that is gone is nobody's. */
    OK(admission_decide(&a, store, 777, 1, GIB, &may, &need, &err));
    CHECK(may && need == 0.0);
    /* Where the store fails, nobody is let in by mistake. */
    strike_sql("FROM jobs", 1, true);
    CHECK(admission_decide(&a, store, ids[2], 1, GIB, &may, &need, &err) != STATUS_OK);
    CHECK(lift());
    /* Without a limit it is the machine that has one. */
    admission_init(&a, 0, 0);
    CHECK(ask(&a, ids[0], 0, 0.0) && a.total_bytes > 0.0 && !ask(&a, ids[0], 1, a.total_bytes));
}

#define HEX "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"

/* A render's need with one file of so many bytes, over that of the room alone. */
static double more_with(int64_t source, const char *settings, const char *file, uint64_t bytes) {
    struct admission a;
    double need[2];
    admission_init(&a, 0, 0);
    for (int i = 0; i < 2; i++) {
        struct job_new new = {.kind = JOB_RENDER,
                              .source_id = source,
                              .file = &file,
                              .file_count = (size_t)i,
                              .scene_id = SCENE_A,
                              .name = "render",
                              .labels = "{}",
                              .settings = settings,
                              .max_attempts = 2};
        bool replayed, queued, may;
        int64_t id;
        OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
        if (i == 1)
            OK(store_job_file_put(store, id, file, bytes, HEX, NULL, &queued, &err));
        OK(admission_decide(&a, store, id, 1, 0.0, &may, &need[i], &err));
    }
    return need[1] - need[0];
}

/* Pictures of meshes that are put into a room are larger in memory than the room may be. */
static void test_render(void) {
    static const char insert[] = "{\"insert.1.file\":\"m.glb\"}",
                      two[] = "{\"insert.1.file\":\"m.glb\",\"insert.2.file\":\"m.glb\"}";
    int64_t source = add_job("{}", NULL);
    int number;
    OK(store_job_start(store, source, "process", &number, &err));
    OK(store_output_put(store, source, number, EVENT_OUTPUT, OUTPUT_MESH, 100, HEX, "model/x", &err));
    OK(store_job_succeed(store, source, number, "", &err));
    CHECK_NEAR(more_with(source, insert, "m.glb", 100000), 1.2e8, 1.0); /* 1.6 megapixels of 75 bytes */
    CHECK_NEAR(more_with(source, insert, "m.glb", 100000000), 1.15 * GIB, 1.0);
    CHECK_NEAR(more_with(source, two, "m.glb", 100000000), 2.3 * GIB, 1.0);
    CHECK_NEAR(more_with(source, "{\"environment\":\"sky.PNG\"}", "sky.PNG", 100000), 1.2e8, 1.0);
    CHECK_NEAR(more_with(source, "{\"insert.1.file\":\"m.ply\"}", "m.ply", 1000000), 8e6, 1.0);
}

int main(void) {
    rig_start();
    test_need();
    test_ask();
    test_render();
    rig_stop();
    return check_result();
}
