/* test_check_table.c -- the table of a check: what the bundle holds, and what a job on it will take. */
#include "server/check/check_table.h"
#include "server/check/estimate.h"
#include "tests/unit/fit_rig.h"

static const char *value_of(const cJSON *facts, const char *label) {
    const cJSON *row;
    cJSON_ArrayForEach(row, cJSON_GetObjectItem(facts, "table"))
        if (strcmp(cJSON_GetStringValue(cJSON_GetObjectItem(row, "label")), label) == 0)
            return cJSON_GetStringValue(cJSON_GetObjectItem(row, "value"));
    return "";
}

static cJSON *facts_with(const struct scene_check *room, double memory_limit, struct parallel *pool) {
    struct settings settings;
    cJSON *facts = cJSON_CreateObject();
    cJSON_AddArrayToObject(facts, "warnings");
    settings_init(&settings);
    check_table_add(facts, room, &settings, memory_limit, pool);
    settings_release(&settings);
    return facts;
}

int main(void) {
    struct fit_rig rig;
    fit_rig_init(&rig, 0.3f);
    struct scene_check room = {.scene = rig.scene, .reading = reading_default(), .given_reading = reading_default()};
    room.scene.source = mem_strdup("a folder of tests");
    room.scene.named_count = FIT_PHOTOGRAPHS + 1;
    room.scene.warning_count = 1;
    room.scene.warning = mem_array(1, sizeof *room.scene.warning);
    room.scene.warning[0] = mem_strdup("016.jpg is damaged and was left out");
    room.scene.photograph[3].is_test = true;
    room.scene.photograph[4].exposure_known = room.scene.photograph[5].exposure_known = true;
    room.scene.photograph[5].exposure = 8.0f;
    cJSON *facts = facts_with(&room, 0.0, rig.pool);
    CHECK_STRING(value_of(facts, "source"), "a folder of tests");
    CHECK_STRING(value_of(facts, "frames used"), "16 of 17, 1 of them held out: 016.jpg is damaged and was left out");
    CHECK_STRING(value_of(facts, "sizes"), "16 of 96 x 72");
    CHECK_STRING(value_of(facts, "exposures"), "stated for 2 of 16, over 3.0 stops");
    CHECK_THAT(strncmp(value_of(facts, "mesh"), "48 triangles, 5 x 3.2 x 4 m, ", 29) == 0, "%s",
               value_of(facts, "mesh"));
    CHECK_STRING(value_of(facts, "holes and rims"), "none");
    CHECK_STRING(value_of(facts, "normals"), "none in the file: they are estimated");
    CHECK(strstr(value_of(facts, "segments"), "found in the mesh") != NULL);
    CHECK(cJSON_GetObjectItem(facts, "time_sec")->valuedouble > 1.0);
    CHECK(cJSON_GetObjectItem(facts, "memory_bytes")->valuedouble > 2e8);
    double side = cJSON_GetObjectItem(facts, "memory_texture_size")->valuedouble,
           texel_bytes = cJSON_GetObjectItem(facts, "memory_texel_bytes")->valuedouble;
    CHECK_NEAR(cJSON_GetObjectItem(facts, "memory_bytes")->valuedouble + texel_bytes * (500.0 * 500.0 - side * side),
               estimate_memory_bytes(&room.scene, 0.0, 500.0), 1.0);
    CHECK(cJSON_GetArraySize(cJSON_GetObjectItem(facts, "warnings")) == 0);
    CHECK_NEAR(cJSON_GetObjectItem(facts, "memory_whole_bytes")->valuedouble,
               cJSON_GetObjectItem(facts, "memory_bytes")->valuedouble, 0.0);
    CHECK_NEAR(estimate_memory_bytes(&room.scene, 0.0, 500.0) -
                   estimate_memory_bytes(&room.scene, 96.0 * 72.0 / 4.0, 500.0),
               25.0 * 0.75 * 16 * 96 * 72, 1.0);
    cJSON_Delete(facts);

    room.scene.mesh.triangle_count -= 2; /* of the box at the wall: a side is open */
    facts = facts_with(&room, estimate_memory_bytes(&room.scene, 0.0, 1100.0), rig.pool);
    CHECK_STRING(value_of(facts, "holes and rims"), "1 border, 2 m in all");
    const cJSON *warnings = cJSON_GetObjectItem(facts, "warnings");
    const char *warning = cJSON_GetStringValue(cJSON_GetArrayItem(warnings, 0));
    CHECK_THAT(warning && strstr(warning, "will not fit the memory") && strstr(warning, "texture_size=1024"), "%s",
               warning ? warning : "no warning");
    cJSON_Delete(facts);
    scene_check_release(&room);
    parallel_free(rig.pool);
    return check_result();
}
