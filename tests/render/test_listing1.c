/* Listing 1 on a small closed room of known materials: what it recovers, that the outcome does
 * not depend on threads, and that a stopped and resumed run ends in the same bytes. */
#include "common/mem.h"
#include "common/sha256.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/check.h"
#include "tests/render/small_room.h"

/* The surroundings: a checkpoint in memory, and a stop after some iterations. */
struct shell {
    long polls_until_stop; /* negative: never */
    unsigned char *saved[32];
    size_t saved_count;
    bool has_checkpoint;
};

static bool stop_requested(void *user) {
    struct shell *s = user;
    return s->polls_until_stop >= 0 && s->polls_until_stop-- == 0;
}
static void ignore_stage(void *user, const char *stage) { (void)user, (void)stage; }
static void ignore_progress(void *user, const char *stage, double done, double total, double eta) {
    (void)user, (void)stage, (void)done, (void)total, (void)eta;
}
static void ignore_metric(void *user, const char *series, long step, double value) {
    (void)user, (void)series, (void)step, (void)value;
}
static void ignore_log(void *user, const char *message) { (void)user, (void)message; }
static bool never(void *user) {
    (void)user;
    return false;
}
static enum status save(void *user, long iteration, const struct state_array *array, size_t count,
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
static enum status load(void *user, struct state_array *array, size_t count, bool *found,
                        struct error *err) {
    struct shell *s = user;
    (void)err;
    *found = s->has_checkpoint;
    for (size_t i = 0; *found && i < count; i++)
        memcpy(array[i].data, s->saved[i], array[i].bytes);
    return STATUS_OK;
}
static enum status no_preview(void *user, const struct reconstruction *r, struct error *err) {
    (void)user, (void)r, (void)err;
    return STATUS_OK;
}

static enum status run(struct scene *scene, const struct settings *settings, int threads,
                       struct shell *shell, struct reconstruction *r) {
    struct reconstruct_hooks hooks = {shell, stop_requested, ignore_stage, ignore_progress,
                                      ignore_metric, ignore_log, never, never, save, load,
                                      no_preview};
    struct parallel *pool = parallel_new(threads);
    struct error err = {0};
    enum status status = reconstruct_run(scene, settings, pool, &hooks, r, &err);
    if (status != STATUS_OK && status != STATUS_CANCELLED)
        fprintf(stderr, "%s\n", err.message);
    parallel_free(pool);
    r->pool = NULL;
    return status;
}

static void shell_release(struct shell *s) {
    for (size_t i = 0; i < s->saved_count; i++)
        mem_free(s->saved[i]);
}

static void digest(const struct reconstruction *r, char hex[SHA256_HEX_SIZE]) {
    const struct materials *m = &r->materials;
    struct sha256 sha;
    sha256_init(&sha);
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    sha256_update(&sha, m->base_color.texel, texels * sizeof *m->base_color.texel);
    sha256_update(&sha, m->roughness, m->segment_count * sizeof *m->roughness);
    sha256_update(&sha, m->specular, m->segment_count * sizeof *m->specular);
    sha256_update(&sha, m->emission, m->segment_count * sizeof *m->emission);
    sha256_hex(&sha, hex);
}

static struct settings make_settings(const char *json) {
    struct settings s;
    struct error err = {0};
    cJSON *object = NULL;
    settings_init(&s);
    CHECK(json_parse(json, strlen(json), "settings", &object, &err) == STATUS_OK);
    CHECK_THAT(settings_apply(&s, object, NULL, &err) == STATUS_OK, "%s", err.message);
    cJSON_Delete(object);
    return s;
}

#define ITERATIONS 30 /* as the settings below have it */

static void test_same_bytes(struct scene *scene, const char *json) {
    struct settings s = make_settings(json);
    char first[SHA256_HEX_SIZE], hex[SHA256_HEX_SIZE];
    const int threads[] = {1, 2, 3, 7};
    for (int i = 0; i < 4; i++) {
        struct shell shell = {.polls_until_stop = -1};
        struct reconstruction r;
        CHECK(run(scene, &s, threads[i], &shell, &r) == STATUS_OK);
        digest(&r, i == 0 ? first : hex);
        if (i > 0)
            CHECK_STRING(hex, first);
        reconstruct_release(&r);
        shell_release(&shell);
    }
    /* Stopped after every single iteration: at every level, on both sides of the emitter decision. */
    struct shell shell = {.polls_until_stop = -1};
    enum status status = STATUS_CANCELLED;
    int stops = 0;
    for (; status == STATUS_CANCELLED && stops < 60; stops++) {
        struct reconstruction r;
        /* The stages before the loop ask twice, those after it as well. */
        shell.polls_until_stop = stops < ITERATIONS ? 2 : -1;
        status = run(scene, &s, 1 + stops % 3, &shell, &r);
        if (status == STATUS_OK)
            digest(&r, hex);
        reconstruct_release(&r);
    }
    CHECK(status == STATUS_OK);
    CHECK_THAT(stops == ITERATIONS + 1, "%d stops", stops);
    CHECK_STRING(hex, first);
    shell_release(&shell);
    settings_release(&s);
}

static void test_recovers(struct scene *scene) {
    struct settings s = make_settings("{\"texture_size\":64,\"iterations\":700,\"report_samples\":32,"
                                      "\"texels_per_iteration\":512}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(run(scene, &s, 0, &shell, &r) == STATUS_OK);
    double error[OBJECTS] = {0}, bias[OBJECTS] = {0}, count[OBJECTS] = {0};
    for (size_t i = 0; i < r.inverse.valid_count; i++) {
        uint32_t texel = r.inverse.valid[i];
        if (r.observed.count[texel] < 2.0f)
            continue;
        uint32_t segment = r.segments.of_triangle[r.inverse.triangle[texel]];
        const float *t = r.materials.base_color.texel[texel];
        const rgb *c = &wall_color[segment];
        error[segment] += pow((double)(t[0] - c->r), 2) + pow((double)(t[1] - c->g), 2) +
                          pow((double)(t[2] - c->b), 2);
        bias[segment] += (double)(t[0] - c->r + t[1] - c->g + t[2] - c->b);
        count[segment] += 3.0;
    }
    for (int o = 0; o < OBJECTS; o++) {
        double rms = sqrt(error[o] / count[o]);
        const rgb *e = &r.materials.emission[o];
        printf("object %d: base colour off by %.4f, mean %+.4f, roughness %.3f, specular %.3f, emission %.4g %.4g %.4g\n",
               o, rms, bias[o] / count[o], (double)r.materials.roughness[o], (double)r.materials.specular[o], (double)e->r,
               (double)e->g, (double)e->b);
        if (o == LAMP) {
            CHECK_NEAR(e->r, lamp_radiance.r, 0.05f * lamp_radiance.r);
            CHECK_NEAR(e->g, lamp_radiance.g, 0.05f * lamp_radiance.g);
            CHECK_NEAR(e->b, lamp_radiance.b, 0.05f * lamp_radiance.b);
        } else {
            CHECK_THAT(rms < 0.09 && fabs(bias[o] / count[o]) < 0.06, "object %d: %.4f", o, rms);
            CHECK(rgb_is_black(*e));
        }
    }
    double msre = 0.0;
    for (size_t i = 0; i < r.held_out_count; i++)
        msre += r.held_out[i].msre / (double)r.held_out_count;
    printf("held-out MSRE %.4f\n", msre);
    CHECK(r.held_out_count == FRAMES / 5);
    CHECK_THAT(msre < 0.045, "held-out MSRE %.4f", msre);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

int main(void) {
    struct scene scene;
    struct parallel *pool = parallel_new(0);
    make_scene(&scene, pool);
    parallel_free(pool);
    test_same_bytes(&scene, "{\"texture_size\":64,\"iterations\":30,\"report_samples\":2,"
                            "\"texels_per_iteration\":256,\"coarse_levels\":3}");
    test_same_bytes(&scene, "{\"texture_size\":64,\"iterations\":30,\"report_samples\":2,\"guided\":false,"
                            "\"texels_per_iteration\":256,\"coarse_levels\":3}");
    test_recovers(&scene);
    scene_release(&scene);
    return check_result();
}
