/* A small closed room of known materials: what the default method recovers, that the outcome of
 * either method does not depend on threads, and that a stopped and resumed run ends in the same
 * bytes, also from checkpoints of the format before. */
#include "common/mem.h"
#include "common/sha256.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/check.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

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

/* json has as many iterations. */
static void test_same_bytes(struct scene *scene, bool solves, int iterations, const char *json) {
    struct settings s = shell_settings(json);
    char first[SHA256_HEX_SIZE], hex[SHA256_HEX_SIZE];
    const int threads[] = {1, 7}; /* the stopped run has 1, 2 and 3 in turn */
    for (int i = 0; i < 2; i++) {
        struct shell shell = {.polls_until_stop = -1};
        struct reconstruction r;
        CHECK(shell_run(scene, &s, threads[i], &shell, &r) == STATUS_OK);
        digest(&r, i == 0 ? first : hex);
        if (i > 0)
            CHECK_STRING(hex, first);
        reconstruct_release(&r);
        shell_release(&shell);
    }
    /* Stopped after every single iteration: at every level, on both sides of the emitter decision. */
    struct shell shell = {.polls_until_stop = -1, .spares_solve = solves};
    enum status status = STATUS_CANCELLED;
    int stops = 0;
    for (; status == STATUS_CANCELLED && stops < 3 * iterations; stops++) {
        struct reconstruction r;
        /* The stages before the loop ask twice, those after it as well. */
        shell.polls_until_stop = stops < iterations ? 2 : -1;
        shell.formats_behind = stops % 2; /* every other one as the program before wrote it */
        status = shell_run(scene, &s, 1 + stops % 3, &shell, &r);
        if (status == STATUS_OK)
            digest(&r, hex);
        reconstruct_release(&r);
    }
    CHECK(status == STATUS_OK);
    CHECK_THAT(stops == iterations + 1, "%d stops", stops);
    CHECK_STRING(hex, first);
    shell_release(&shell);
    settings_release(&s);
}

static void test_stop_in_solve(struct scene *scene) {
    struct settings s = shell_settings("{\"texture_size\":64,\"iterations\":4,\"gather_samples\":16}");
    struct shell shell = {.polls_until_stop = 3};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 2, &shell, &r) == STATUS_CANCELLED);
    CHECK(!shell.has_checkpoint);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

static double refine_figure(const struct reconstruction *r, const char *name) {
    return cJSON_GetNumberValue(cJSON_GetObjectItem(cJSON_GetObjectItem(r->report, "refine"), name));
}

static const char few_looks[] =
    "{" SHELL_COARSE_TEXTURE ",\"refine_looks\":%d,\"time_limit_sec\":%d,\"report_samples\":2,"
    "\"calibrate\":false,\"gather_samples\":64,\"texels_per_iteration\":512}";

/* Goes on from the checkpoint, if there is one, to so many looks, or to the limit: the iterations by then. */
static double run_looks(struct scene *scene, struct shell *shell, int wanted, int limit_sec, double *looks) {
    char json[256];
    snprintf(json, sizeof json, few_looks, wanted, limit_sec);
    struct settings s = shell_settings(json);
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 2, shell, &r) == STATUS_OK);
    *looks = refine_figure(&r, "paths") / 16.0 / (double)r.inverse.valid_count;
    double iterations = refine_figure(&r, "iterations"), slack = 2.0 * 512.0 / (double)r.inverse.valid_count;
    CHECK_THAT(wanted == 0 || (*looks >= wanted && *looks < wanted + slack), "%g looks, not %d", *looks, wanted);
    CHECK_THAT(limit_sec > 0 || !r.left_out[0], "%s", r.left_out);
    reconstruct_release(&r);
    settings_release(&s);
    return iterations;
}

/* A run ends when windows (of one texel here) had the looks asked for; extended by looks or time it goes on from
 * there. */
static void test_ends_early(struct scene *scene) {
    struct shell shell = {.polls_until_stop = -1};
    double looks, first = run_looks(scene, &shell, 3, 0, &looks);
    double second = run_looks(scene, &shell, 4, 0, &looks);
    CHECK_THAT(second > first, "%g iterations, then %g", first, second);
    shell.sec_a_look = 1.0;
    double third = run_looks(scene, &shell, 0, 80, &looks);
    CHECK_THAT(third > second && third < second + 80.0, "%g iterations, then %g", second, third);
    shell_release(&shell);
}

#define INSIDE_OUT 2 /* a wall as a careless model would have it */

static void turn_inside_out(struct mesh *mesh, int64_t object) {
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t *v = mesh->index[t], second = v[1];
        if (mesh->object_id[t] != object)
            continue;
        v[1] = v[2];
        v[2] = second;
    }
}

static void test_recovers(struct scene *scene) {
    turn_inside_out(&scene->mesh, INSIDE_OUT);
    struct settings s =
        shell_settings("{\"texture_size\":64,\"iterations\":120,\"report_samples\":16,\"calibrate\":true,"
                       "\"gather_samples\":64,\"texels_per_iteration\":512}");
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    const cJSON *prepare = cJSON_GetObjectItem(r.report, "prepare");
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(prepare, "triangles_turned")) == 2.0);
    double error[OBJECTS] = {0}, bias[OBJECTS] = {0}, count[OBJECTS] = {0};
    for (size_t i = 0; i < r.inverse.valid_count; i++) {
        uint32_t texel = r.inverse.valid[i];
        if (r.fused.count[texel] < 2.0f)
            continue;
        uint32_t segment = r.segments.of_triangle[r.inverse.triangle[texel]];
        const float *t = r.materials.base_color.texel[texel];
        const rgb *c = &wall_color[segment];
        error[segment] += pow((double)(t[0] - c->r), 2) + pow((double)(t[1] - c->g), 2) + pow((double)(t[2] - c->b), 2);
        bias[segment] += (double)(t[0] - c->r + t[1] - c->g + t[2] - c->b);
        count[segment] += 3.0;
    }
    for (int o = 0; o < OBJECTS; o++) {
        double rms = sqrt(error[o] / count[o]);
        const rgb *e = &r.materials.emission[o];
        printf(
            "object %d: base colour off by %.4f, mean %+.4f, roughness %.3f, specular %.3f, emission %.4g %.4g %.4g\n",
            o, rms, bias[o] / count[o], (double)r.materials.roughness[o], (double)r.materials.specular[o], (double)e->r,
            (double)e->g, (double)e->b);
        if (o == LAMP) {
            CHECK_NEAR(e->r, lamp_radiance.r, 0.05f * lamp_radiance.r);
            CHECK_NEAR(e->g, lamp_radiance.g, 0.05f * lamp_radiance.g);
            CHECK_NEAR(e->b, lamp_radiance.b, 0.05f * lamp_radiance.b);
        } else {
            CHECK_THAT(rms < 0.06 && fabs(bias[o] / count[o]) < 0.03, "object %d: %.4f", o, rms);
            CHECK(rgb_is_black(*e));
        }
    }
    double msre = 0.0;
    for (size_t i = 0; i < r.held_out_count; i++)
        msre += r.held_out[i].msre / (double)r.held_out_count;
    printf("held-out MSRE %.4f\n", msre);
    CHECK(r.held_out_count == FRAMES / 5);
    CHECK_THAT(msre < 0.03, "held-out MSRE %.4f", msre);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

int main(void) {
    struct scene scene;
    struct parallel *pool = parallel_new(0);
    make_scene(&scene, pool);
    parallel_free(pool);
    test_same_bytes(&scene, true, 2,
                    "{" SHELL_COARSE_TEXTURE ",\"iterations\":2,\"report_samples\":2,"
                    "\"gather_samples\":64,\"texels_per_iteration\":256}");
    /* One iteration at each of the coarse levels, the first of which decides on emitters, and two at the finest. What
     * goes before is that of the run above, but for the calibration of the long form. */
    test_same_bytes(&scene, false, 5,
                    "{" SHELL_COARSE_TEXTURE ",\"iterations\":5,\"report_samples\":2,\"calibrate\":false,"
                    "\"method\":\"listing1\",\"texels_per_iteration\":256,\"coarse_levels\":2}");
    test_stop_in_solve(&scene);
    test_ends_early(&scene);
    test_recovers(&scene);
    scene_release(&scene);
    return check_result();
}
