/* light_lamp.h: of segments at which all photographs saturate those are lamps that no sun lights, unless people say
 * otherwise. */
#include "server/light/light_lamp.h"
#include "common/mem.h"
#include "server/state/evidence.h"
#include "tests/check.h"

enum { PLAIN, IS_OFF, IS_SUNLIT, SUNLIT_ON, SEGMENTS };

int main(void) {
    vec3 position[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    uint32_t index[SEGMENTS][3], of_triangle[SEGMENTS];
    int64_t id[SEGMENTS] = {7, 8, 9, 10};
    struct emitter_evidence evidence[SEGMENTS] = {{.is_seen = false}};
    for (uint32_t i = 0; i < SEGMENTS; i++) {
        for (uint32_t k = 0; k < 3; k++)
            index[i][k] = k;
        of_triangle[i] = i;
        /* of other radiances: what looks alike is one lamp */
        evidence[i] = (struct emitter_evidence){.observed = rgb_gray(1.0f + (float)i),
                                                .is_seen = true,
                                                .saturated = {true, true, true},
                                                .is_sunlit = i == IS_SUNLIT || i == SUNLIT_ON};
        evidence_set_radiance(&evidence[i], evidence[i].observed);
    }
    struct scene scene = {
        .mesh = {.vertex_count = 3, .position = position, .triangle_count = SEGMENTS, .index = index}};
    struct settings settings;
    struct error err;
    cJSON *told = cJSON_Parse("{\"emitters.1\":\"off\",\"emitters.3\":\"on\"}");
    settings_init(&settings);
    CHECK(settings_apply(&settings, told, NULL, &err) == STATUS_OK);
    struct reconstruction r = {.scene = &scene, .settings = &settings, .evidence = evidence};
    r.segments = (struct segments){.count = SEGMENTS, .of_triangle = of_triangle, .is_given = true, .id = id};
    struct light_lamps lamps;
    light_lamps_init(&lamps, &r, 0.1f);
    light_lamps_choose(&lamps, false);
    CHECK(lamps.count == 2);
    for (int i = 0; i < SEGMENTS; i++)
        CHECK_THAT(lamps.is_lamp[i] == (i == PLAIN || i == SUNLIT_ON), "segment %d", i);
    light_lamps_release(&lamps);
    settings_release(&settings);
    cJSON_Delete(told);
    return check_result();
}
