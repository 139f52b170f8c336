/* light_estimate.h: the report states the radiance of sky and ground, of a sun, and of segments that are emitters, with
 * its deviation; not of a white surface that saturates. */
#include "server/light/light_estimate.h"
#include "tests/check.h"

int main(void) {
    int64_t id[3] = {7, 8, 9};
    bool is_emitter[3] = {true, false, true};
    static struct scene scene; /* whose mesh names nothing */
    struct reconstruction r = {
        .scene = &scene, .report = cJSON_CreateObject(), .is_emitter = is_emitter, .segments = {.count = 3, .id = id}};
    static const struct estimated_source source[] = {{ESTIMATED_SATURATED_SKY, 0, {9, 9, 9}, 0.2f},
                                                     {ESTIMATED_SATURATED_GROUND, 0, {3, 3, 3}, 0.3f},
                                                     {ESTIMATED_SATURATED, 1, {1, 1, 1}, 0.5f},
                                                     {ESTIMATED_SUN, 0, {2, 2, 1}, 0.3f},
                                                     {ESTIMATED_HIDDEN, 2, {6, 5, 4}, 0.4f}};
    r.light.source_count = sizeof source / sizeof *source;
    memcpy(r.light.source, source, sizeof source);
    light_report(&r);
    static const char *const kind[] = {"saturated_sky", "saturated_ground", "sun", "hidden"};
    const cJSON *list = cJSON_GetObjectItem(r.report, "lights");
    CHECK(cJSON_GetArraySize(list) == 4);
    for (int i = 0; i < 4; i++) {
        const cJSON *entry = cJSON_GetArrayItem(list, i);
        CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(entry, "kind")), kind[i]);
    }
    const cJSON *last = cJSON_GetArrayItem(list, 3);
    CHECK(cJSON_GetNumberValue(cJSON_GetObjectItem(last, "object_id")) == 9.0);
    CHECK_NEAR(cJSON_GetNumberValue(cJSON_GetObjectItem(last, "deviation")), 0.4, 1e-6);
    cJSON_Delete(r.report);
    return check_result();
}
