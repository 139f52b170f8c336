/* solve.h, in no time at all: it measures one texel in four, says so, and what it finds is a whole room all the same. */
#include "server/reconstruct/reconstruct.h"
#include "tests/render/shell.h"
#include "tests/render/small_room.h"

static void set_number(struct settings *s, const char *name, double value) {
    size_t count;
    s->number[settings_find(name) - settings_table(&count)] = value;
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    struct scene scene = {0};
    make_scene(&scene, pool);
    struct settings s = shell_settings("{\"texture_size\":256,\"report_samples\":1,\"gather_samples\":128}");
    set_number(&s, "time_limit_sec", 0.0); /* less than a job may ask for */
    struct shell shell = {.polls_until_stop = -1};
    struct reconstruction r;
    CHECK(shell_run(&scene, &s, 0, &shell, &r) == STATUS_OK);
    const cJSON *solved = cJSON_GetObjectItem(r.report, "solve");
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(solved, "measured_one_texel_in")) == 4.0);
    for (int64_t wall = 0; wall < LAMP; wall++)
        CHECK_RGB(shell_mean_color(&r, wall), wall_color[wall], 0.1f);
    reconstruct_release(&r);
    shell_release(&shell);
    settings_release(&s);
    scene_release(&scene);
    parallel_free(pool);
    return check_result();
}
