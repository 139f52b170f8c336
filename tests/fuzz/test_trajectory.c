/* test_trajectory.c -- a list of poses as text. */
#include "server/ingest/trajectory.h"

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct lens lens = {.width = 64, .height = 48, .fl_x = 50, .fl_y = 50};
    struct findings f = {.problems = cJSON_CreateArray()};
    struct transforms t;
    struct error err = {.message = ""};
    enum status status = trajectory_parse(data, size, "case", &lens, &t, &f, &err);
    MUST(status == STATUS_OK || (status == STATUS_INPUT && err.message[0] != '\0'));
    MUST(t.frame_count <= t.named_count);
    for (size_t i = 0; i < t.frame_count; i++)
        MUST(t.frame[i].file && isfinite(t.frame[i].world_from_camera.translation[0]));
    transforms_release(&t);
    cJSON_Delete(f.problems);
    findings_release(&f);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_text(s, "1 0 0 0.5 0 0 -1 1.5 0 1 0 -2.5 0 0 0 1\n\n-inf 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\r\n"
                  "1e0 +0 0 1E2 0 1 0 0 0 0 1 0 0 0 0 1");
}
