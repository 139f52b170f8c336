/* test_memory_reduction.c -- what an attempt gets after one that ran out of memory. */
#include "server/job/memory_reduction.h"

#include "common/error.h"
#include "tests/check.h"

static double number_of(const cJSON *settings, const char *name) {
    return cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(settings, name));
}

int main(void) {
    struct buf what;
    cJSON *settings = cJSON_CreateObject();
    json_add_number(settings, "texture_size", 512);
    json_add_number(settings, "seed", 7);
    buf_init(&what, 4096);

    int threads = 4;
    cJSON *same = memory_reduction_apply(JOB_RECONSTRUCT, settings, 0, &threads, &what);
    CHECK(threads == 4 && what.length == 0 && cJSON_Compare(same, settings, true));
    cJSON_Delete(same);

    /* First what the checkpoint does not mind, then the textures too. */
    cJSON *once = memory_reduction_apply(JOB_RECONSTRUCT, settings, 1, &threads, &what);
    CHECK(threads == 2 && number_of(once, "texture_size") == 512 && number_of(once, "seed") == 7);
    CHECK(number_of(once, "texels_per_iteration") == 1024);
    CHECK_STRING(buf_text(&what), "2 threads, texels_per_iteration 1024");
    cJSON_Delete(once);
    buf_clear(&what);
    threads = 4;
    cJSON *twice = memory_reduction_apply(JOB_RECONSTRUCT, settings, 2, &threads, &what);
    CHECK(threads == 1 && number_of(twice, "texture_size") == 256);
    CHECK_STRING(buf_text(&what), "1 thread, texels_per_iteration 256, texture_size 256");
    cJSON_Delete(twice);

    /* It comes to an end. */
    int step = 0;
    for (; step < 20; step++) {
        buf_clear(&what);
        if (!memory_reduction_is_possible(JOB_RECONSTRUCT, settings, step, 4, &what))
            break;
    }
    CHECK_THAT(step == 4, "%d steps", step);
    cJSON_Delete(settings);
    buf_release(&what);
    return check_result();
}
