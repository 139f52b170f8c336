/* shell.h -- surroundings of a reconstruction in a test: a checkpoint in memory, and a stop when
 * it is asked for often enough. */
#ifndef UNBAKE_TESTS_RENDER_SHELL_H
#define UNBAKE_TESTS_RENDER_SHELL_H

#include "common/mem.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/check.h"

/* To a sanitizer, which takes minutes, further rooms are much the same code again. */
#if defined __SANITIZE_THREAD__ || defined __SANITIZE_ADDRESS__
#define IS_BRIEF true
#else
#define IS_BRIEF false
#endif

/* The long form of a test: in full size, and once more what adds little to a day's run. */
#define IS_LONG (getenv("UNBAKE_LONG") != NULL)

struct shell {
    long polls_until_stop; /* negative: never */
    bool spares_solve;     /* polls count from the first checkpoint on */
    unsigned char *saved[32];
    size_t saved_count;
    bool has_checkpoint;
    int formats_behind;            /* of the program that wrote the checkpoint */
    char warned[512];              /* the last warning */
    double worked_sec, sec_a_look; /* a clock that moves on by so much whenever it is looked at */
};

static inline bool shell_stop_requested(void *user) {
    struct shell *s = user;
    if (s->spares_solve && !s->has_checkpoint)
        return false;
    return s->polls_until_stop >= 0 && s->polls_until_stop-- == 0;
}
static inline void shell_ignore_stage(void *user, const char *stage) { (void)user, (void)stage; }
static inline void shell_ignore_progress(void *user, const char *stage, double done, double total, double eta) {
    (void)user, (void)stage, (void)done, (void)total, (void)eta;
}
static inline void shell_ignore_metric(void *user, const char *series, long step, double value) {
    (void)user, (void)series, (void)step, (void)value;
}
static inline void shell_ignore_log(void *user, const char *message) { (void)user, (void)message; }
static inline void shell_warn(void *user, const char *message) {
    snprintf(((struct shell *)user)->warned, sizeof((struct shell *)user)->warned, "%s", message);
}
static inline double shell_worked_sec(void *user) {
    struct shell *s = user;
    return s->worked_sec += s->sec_a_look;
}
static inline bool shell_never(void *user) {
    (void)user;
    return false;
}
static inline enum status shell_save(void *user, long iteration, const struct state_array *array, size_t count,
                                     struct error *err) {
    struct shell *s = user;
    (void)iteration, (void)err;
    for (size_t i = 0; i < count; i++) {
        if (!s->has_checkpoint)
            s->saved[i] = mem_alloc(array[i].bytes);
        memcpy(s->saved[i], array[i].data, array[i].bytes);
    }
    s->saved_count = count;
    s->has_checkpoint = true;
    return STATUS_OK;
}
static inline enum status shell_load(void *user, struct state_array *array, size_t count, bool *found,
                                     struct error *err) {
    struct shell *s = user;
    (void)err;
    *found = s->has_checkpoint;
    for (size_t i = 0; *found && i < count; i++)
        if (array[i].since <= STATE_FORMAT - s->formats_behind)
            memcpy(array[i].data, s->saved[i], array[i].bytes);
    return STATUS_OK;
}
static inline enum status shell_no_preview(void *user, const struct reconstruction *r, struct error *err) {
    (void)user, (void)r, (void)err;
    return STATUS_OK;
}

static inline enum status shell_run(struct scene *scene, const struct settings *settings, int threads,
                                    struct shell *shell, struct reconstruction *r) {
    struct reconstruct_hooks hooks = {
        .user = shell,
        .stop_requested = shell_stop_requested,
        .stage = shell_ignore_stage,
        .progress = shell_ignore_progress,
        .metric = shell_ignore_metric,
        .log = shell_ignore_log,
        .warning = shell_warn,
        .worked_sec = shell_worked_sec,
        .checkpoint_due = shell_never,
        .preview_due = shell_never,
        .checkpoint_save = shell_save,
        .checkpoint_load = shell_load,
        .preview = shell_no_preview,
    };
    struct parallel *pool = parallel_new(threads);
    struct error err = {0};
    enum status status = reconstruct_run(scene, settings, pool, &hooks, r, &err);
    if (status != STATUS_OK && status != STATUS_CANCELLED)
        fprintf(stderr, "%s\n", err.message);
    parallel_free(pool);
    r->pool = NULL;
    return status;
}

static inline void shell_release(struct shell *s) {
    for (size_t i = 0; i < s->saved_count; i++)
        mem_free(s->saved[i]);
}

/* Where JSON does not say otherwise gutters are narrow, as of 64 texels a side wide ones would be a fifth, and
 * photographs are not calibrated, which takes half of the time and has tests of its own; in the long form
 * (UNBAKE_LONG) they are. */
static inline struct settings shell_settings(const char *json) {
    struct settings s;
    struct error err = {0};
    cJSON *object = cJSON_CreateObject();
    json_add_int(object, "padding", 2);
    json_add_bool(object, "calibrate", IS_LONG);
    settings_init(&s);
    CHECK(settings_apply(&s, object, NULL, &err) == STATUS_OK);
    cJSON_Delete(object);
    CHECK(json_parse(json, strlen(json), "settings", &object, &err) == STATUS_OK);
    CHECK_THAT(settings_apply(&s, object, NULL, &err) == STATUS_OK, "%s", err.message);
    cJSON_Delete(object);
    return s;
}

/* Half of the texels that a texture of 64 x 64 has room for: where something is decided, or only bytes are compared. */
#define SHELL_COARSE_TEXTURE "\"texture_size\":64,\"texels_per_metre\":4.8"

/* Hardly anything is refined. The time of the whole goes with the number of texels. */
#define SHELL_LITTLE "\"iterations\":2,\"report_samples\":1,\"gather_samples\":64,\"texels_per_iteration\":64"
#define SHELL_SETTINGS(texture_size) "{\"texture_size\":" texture_size "," SHELL_LITTLE "}"
#define SHELL_COARSE "{" SHELL_COARSE_TEXTURE "," SHELL_LITTLE "}"
#define SHELL_SMALL SHELL_SETTINGS("64")
/* For what is found from few texels: one of several lamps, light in the shade of a small part of the floor. */
#define SHELL_FINE SHELL_SETTINGS("128")

/* A run from beginning to end with one of the settings above. */
static inline void shell_solve_with(const char *json, struct scene *scene, int threads, struct reconstruction *r) {
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = -1};
    CHECK(shell_run(scene, &s, threads, &shell, r) == STATUS_OK);
    shell_release(&shell);
    settings_release(&s);
}

static inline void shell_solve(struct scene *scene, int threads, struct reconstruction *r) {
    shell_solve_with(SHELL_SMALL, scene, threads, r);
}

/* Mean base colour that was found of an object. */
static inline rgb shell_mean_color(const struct reconstruction *r, int64_t object) {
    rgb sum = rgb_gray(0.0f);
    float count = 0.0f;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        if (r->segments.id[reconstruction_segment(r, texel)] != object)
            continue;
        const float *c = r->materials.base_color.texel[texel];
        sum = rgb_add(sum, rgb_make(c[0], c[1], c[2]));
        count += 1.0f;
    }
    return rgb_scale(sum, 1.0f / count);
}

#endif
