/* reconstruct_room ROOM OUT [name=value ...] -- one reconstruction without the daemon, for
 * benches and experiments: reads the unpacked bundle ROOM, writes the outputs to OUT, prints the
 * curve and the figures. No checkpoints. Where the environment has ROOM_PIXEL_MIB, pixels of photographs
 * beyond so many MiB lie in a file in OUT. Where it has ROOM_CORES, what each stage would gain by so many cores is
 * printed (cores.h). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/kept_pixels.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/pixels.h"
#include "server/worker/results.h"
#include "server/worker/working_time.h"
#include "tests/bench/cores.h"

struct room_clock {
    double last; /* when a figure was printed */
    struct working_time worked;
};

static double worked_sec(void *user) {
    struct room_clock *clock = user;
    return working_time_sec(&clock->worked);
}

static bool never(void *user) {
    (void)user;
    return false;
}

static void print_stage(void *user, const char *stage) {
    (void)user;
    cores_begin_stage(stage);
    printf("stage %s\n", stage);
    fflush(stdout);
}

/* Where the environment has ROOM_ETA: each forecast, with the time that it was made at. */
static void print_progress(void *user, const char *stage, double done, double total, double eta) {
    if (getenv("ROOM_ETA"))
        printf("eta %s %.3f after %.1f s: %.1f s left\n", stage, done / total, worked_sec(user), eta);
}

static void print_metric(void *user, const char *series, long step, double value) {
    struct room_clock *clock = user;
    if (clock_sec() - clock->last < 10.0)
        return;
    clock->last = clock_sec();
    printf("%s %ld %.5f\n", series, step, value);
    fflush(stdout);
}

static void print_log(void *user, const char *message) {
    (void)user;
    printf("%s\n", message);
}

static enum status keep_nothing(void *user, long iteration, const struct state_array *array, size_t count,
                                struct error *err) {
    (void)user;
    (void)iteration;
    (void)array;
    (void)count;
    (void)err;
    return STATUS_OK;
}

static enum status find_nothing(void *user, struct state_array *array, size_t count, bool *found, struct error *err) {
    (void)user;
    (void)array;
    (void)count;
    (void)err;
    *found = false;
    return STATUS_OK;
}

static enum status no_preview(void *user, const struct reconstruction *r, struct error *err) {
    (void)user;
    (void)r;
    (void)err;
    return STATUS_OK;
}

static enum status write_outputs(const char *dir, const struct reconstruction *r, struct error *err) {
    struct export_input input;
    results_make(&input, r, "room");
    enum status status = file_make_dirs(dir, err);
    if (status == STATUS_OK)
        status = export_outputs(dir, &input, NULL, NULL, err);
    mem_free((void *)input.comparison);
    mem_free((void *)input.camera);
    return status;
}

/* NULL: all in memory. */
static struct spill *new_spill(const char *out, struct error *err) {
    const char *mib = getenv("ROOM_PIXEL_MIB");
    if (!mib || file_make_dirs(out, err) != STATUS_OK)
        return NULL;
    return spill_new(out, &(struct spill_limits){.memory_bytes = (uint64_t)(atof(mib) * 1048576.0)});
}

/* As a worker loads it: photographs as far as the settings keep them, cameras by the setting `transforms`. */
static enum status load(const char *room, const struct settings *settings, struct spill *spill, struct parallel *pool,
                        struct scene *scene, struct error *err) {
    double begin = clock_sec();
    struct bundle_limits limits = bundle_default_limits();
    if (spill)
        pixels_use(spill, &limits);
    limits.later_bytes = PHOTOGRAPH_LATER_BYTES;
    limits.kept_pixels = kept_pixels(settings, settings_number(settings, "texture_size"));
    struct reading reading = reading_default();
    reading.transforms = mem_strdup(settings_text(settings, "transforms"));
    cJSON *problems = cJSON_CreateArray(); /* err has the first */
    enum status status = bundle_load(room, &reading, &limits, pool, scene, problems, err);
    cJSON_Delete(problems);
    reading_release(&reading);
    printf("loaded in %.1f s\n", clock_sec() - begin);
    if (scene->photograph_count > 0)
        printf("the first photograph has %u x %u pixels\n", scene->photograph[0].camera.width,
               scene->photograph[0].camera.height);
    return status;
}

static enum status run(int argc, char **argv, struct error *err) {
    struct room_clock clock = {.last = clock_sec()};
    double begin = clock.last;
    struct reconstruct_hooks hooks = {
        .user = &clock,
        .stop_requested = never,
        .stage = print_stage,
        .progress = print_progress,
        .metric = print_metric,
        .log = print_log,
        .warning = print_log,
        .worked_sec = worked_sec,
        .checkpoint_due = never,
        .preview_due = never,
        .checkpoint_save = keep_nothing,
        .checkpoint_load = find_nothing,
        .preview = no_preview,
    };
    struct settings settings;
    settings_init(&settings);
    cJSON *object = cJSON_CreateObject();
    enum status status = STATUS_OK;
    for (int i = 3; i < argc && status == STATUS_OK; i++)
        status = settings_parse_assignment(argv[i], object, err);
    if (status == STATUS_OK)
        status = settings_apply(&settings, object, NULL, err);
    struct parallel *pool = parallel_new(0);
    working_time_init(&clock.worked, parallel_thread_count(pool));
    cores_begin_stage("load");
    struct scene scene = {0};
    struct reconstruction r = {0};
    struct spill *spill = new_spill(argv[2], err);
    if (status == STATUS_OK)
        status = load(argv[1], &settings, spill, pool, &scene, err);
    if (status == STATUS_OK)
        status = reconstruct_run(&scene, &settings, pool, &hooks, &r, err);
    cores_begin_stage("export");
    if (status == STATUS_OK)
        status = write_outputs(argv[2], &r, err);
    cores_print();
    if (status == STATUS_OK) {
        char *text = json_page(cJSON_GetObjectItem(r.report, "metrics"));
        struct rusage usage;
        getrusage(RUSAGE_SELF, &usage);
        printf("%s\npeak memory %.0f MiB, total %.1f s\n", text, (double)usage.ru_maxrss / 1024.0, clock_sec() - begin);
        mem_free(text);
    }
    if (spill)
        printf("pixels in a file: %.0f MiB\n", (double)spill_file_bytes(spill) / 1048576.0);
    reconstruct_release(&r);
    scene_release(&scene);
    spill_free(spill);
    parallel_free(pool);
    cJSON_Delete(object);
    settings_release(&settings);
    return status;
}

int main(int argc, char **argv) {
    if (argc < 3) {
        fprintf(stderr, "usage: reconstruct_room ROOM OUT [name=value ...]\n");
        return 2;
    }
    const char *wanted = getenv("ROOM_CORES");
    cores.cores = wanted ? atoi(wanted) : 0;
    if (cores.cores < 0 || cores.cores > CORES_MAX) {
        fprintf(stderr, "reconstruct_room: ROOM_CORES is from 1 to %d\n", CORES_MAX);
        return 2;
    }
    struct error err = {0};
    if (run(argc, argv, &err) == STATUS_OK)
        return 0;
    fprintf(stderr, "reconstruct_room: %s\n", err.message);
    return 1;
}
