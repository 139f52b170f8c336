/* plan.h in a whole reconstruction. Without a time limit its bytes do not hang on the clock: neither on the one that
 * its surroundings keep nor on clock_sec, which here runs as fast as is wanted. With one that is far too short
 * everything is cut that can be, that is said, and what it finds is a whole room all the same. */
#include "common/clock.h"
#include "common/sha256.h"
#include "server/reconstruct/reconstruct.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

#define SLOW_SEC 20.0 /* between two looks at the clock */

/* In place of the library's. */
static double clock_now, clock_step;
double clock_sec(void) { return clock_now += clock_step; }

static void digest(const struct reconstruction *r, char hex[SHA256_HEX_SIZE]) {
    const struct materials *m = &r->materials;
    struct sha256 sha;
    sha256_init(&sha);
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    sha256_update(&sha, m->base_color.texel, texels * sizeof *m->base_color.texel);
    sha256_update(&sha, m->emission, m->segment_count * sizeof *m->emission);
    for (size_t i = 0; i < r->held_out_count; i++)
        sha256_update(&sha, r->held_out[i].render.pixel, WIDTH * HEIGHT * 3 * sizeof(float));
    sha256_hex(&sha, hex);
}

/* Amounts of work of which a test has time; nothing is said of time. */
#define LITTLE SHELL_COARSE_TEXTURE ",\"report_samples\":2,\"texels_per_iteration\":512"

static void run(struct scene *scene, const char *json, int threads, double step_sec, char hex[SHA256_HEX_SIZE]) {
    struct settings s = shell_settings(json);
    struct shell shell = {.polls_until_stop = -1, .sec_a_look = step_sec};
    struct reconstruction r;
    clock_step = step_sec;
    CHECK(shell_run(scene, &s, threads, &shell, &r) == STATUS_OK);
    CHECK_STRING(r.left_out, "");
    digest(&r, hex);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

static void test_busy_machine(struct scene *scene, const char *json) {
    char quiet[SHA256_HEX_SIZE], busy[SHA256_HEX_SIZE];
    run(scene, json, 2, 0.0, quiet);
    run(scene, json, 1, SLOW_SEC, busy);
    CHECK_STRING(busy, quiet);
}

static void test_limit(struct scene *scene) {
    struct settings s = shell_settings("{\"texture_size\":128,\"report_samples\":16,\"gather_samples\":128,"
                                       "\"time_limit_sec\":1}");
    struct shell shell = {.polls_until_stop = -1, .sec_a_look = SLOW_SEC};
    struct reconstruction r;
    CHECK(shell_run(scene, &s, 0, &shell, &r) == STATUS_OK);
    const cJSON *solved = cJSON_GetObjectItem(r.report, "solve"), *limit = cJSON_GetObjectItem(r.report, "time_limit");
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(solved, "measured_one_texel_in")) == 4.0);
    double directions = cJSON_GetNumberValue(cJSON_GetObjectItem(solved, "directions_a_probe"));
    /* A quarter, and the part of probes that were planned but not added. */
    CHECK_THAT(directions >= 32.0 && directions < 64.0, "%g directions", directions);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(cJSON_GetObjectItem(r.report, "refine"), "iterations")) == 0.0);
    const cJSON *view = cJSON_GetArrayItem(cJSON_GetObjectItem(r.report, "views"), 0);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(view, "samples")) == 1.0);
    CHECK(cJSON_IsFalse(cJSON_GetObjectItem(limit, "kept")));
    CHECK_THAT(strstr(r.left_out, "100 % of refine's observations") &&
                   strstr(r.left_out, "in place of time_limit_sec=1"),
               "%s", r.left_out);
    CHECK_STRING(shell.warned, r.left_out);
    for (int64_t wall = 0; wall < LAMP; wall++)
        CHECK_RGB(shell_mean_color(&r, wall), wall_color[wall], 0.1f);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    make_scene(&scene, pool);
    test_busy_machine(&scene, "{" LITTLE ",\"gather_samples\":64,\"refine_looks\":3}");
    test_busy_machine(&scene, "{" LITTLE ",\"method\":\"listing1\",\"listing1_looks\":2,\"coarse_levels\":3}");
    test_limit(&scene);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
