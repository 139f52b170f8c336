/* light_lamp.h: of segments at which all photographs saturate those are lamps that no sun lights, unless people say
 * otherwise. Where there is no room for all, those that turned out to reflect make room. What is assumed of a sun in
 * which photographs saturate. */
#include "server/light/light_lamp.h"
#include <math.h>

#include "common/mem.h"
#include "server/state/evidence.h"
#include "tests/check.h"

enum { PLAIN, IS_OFF, IS_SUNLIT, SUNLIT_ON, SEGMENTS };

#define MANY (LIGHT_MAX + 8)

/* Segments of one triangle each, at which photographs saturate; of other radiances, since what looks alike is one
 * lamp. */
struct room {
    uint32_t index[MANY][3], of_triangle[MANY];
    int64_t id[MANY];
    struct emitter_evidence evidence[MANY];
    struct settings settings;
    struct scene scene;
    struct reconstruction r;
};

static void make_room(struct room *room, size_t segments, const char *told) {
    static vec3 position[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    struct error err;
    cJSON *json = cJSON_Parse(told);
    *room = (struct room){0};
    for (uint32_t i = 0; i < segments; i++) {
        for (uint32_t k = 0; k < 3; k++)
            room->index[i][k] = k;
        room->of_triangle[i] = i;
        room->id[i] = 7 + i;
        room->evidence[i] = (struct emitter_evidence){
            .observed = rgb_gray(powf(1.2f, (float)i)), .is_seen = true, .saturated = {true, true, true}};
        evidence_set_radiance(&room->evidence[i], room->evidence[i].observed);
    }
    settings_init(&room->settings);
    CHECK(settings_apply(&room->settings, json, NULL, &err) == STATUS_OK);
    cJSON_Delete(json);
    room->scene.mesh =
        (struct mesh){.vertex_count = 3, .position = position, .triangle_count = segments, .index = room->index};
    room->r = (struct reconstruction){.scene = &room->scene, .settings = &room->settings, .evidence = room->evidence};
    room->r.segments =
        (struct segments){.count = segments, .of_triangle = room->of_triangle, .is_given = true, .id = room->id};
}

static void test_told(void) {
    static struct room room;
    struct light_lamps lamps;
    make_room(&room, SEGMENTS, "{\"emitters.1\":\"off\",\"emitters.3\":\"on\"}");
    room.evidence[IS_SUNLIT].is_sunlit = room.evidence[SUNLIT_ON].is_sunlit = true;
    light_lamps_init(&lamps, &room.r, 0.1f);
    light_lamps_choose(&lamps, false);
    CHECK(lamps.count == 2 && !lamps.left_some_out);
    for (int i = 0; i < SEGMENTS; i++)
        CHECK_THAT(lamps.is_lamp[i] == (i == PLAIN || i == SUNLIT_ON), "segment %d", i);
    light_lamps_release(&lamps);
    settings_release(&room.settings);
}

/* The most powerful ones are the last. */
static void test_many(void) {
    static struct room room;
    struct light_lamps lamps;
    make_room(&room, MANY, "{}");
    for (int round = 0; round < 2; round++) {
        light_lamps_init(&lamps, &room.r, 0.1f);
        light_lamps_choose(&lamps, false);
        CHECK_THAT(lamps.left_some_out == (round == 0) && lamps.is_lamp[0] == (round == 1), "round %d", round);
        for (size_t i = 0; i < MANY; i++)
            room.evidence[i].is_lit = lamps.is_lamp[i];
        light_lamps_release(&lamps);
    }
    settings_release(&room.settings);
}

/* Of a sun in which photographs saturate no more is known than of a lamp that none shows, but for what they show. */
static void test_sun(void) {
    static struct room room;
    struct light_lamps lamps;
    make_room(&room, 1, "{}");
    light_lamps_init(&lamps, &room.r, 0.1f);
    double lamp = light_lamps_hidden_prior(&lamps).mean;
    for (int k = 0; k < 2; k++) {
        float least = k == 0 ? 1e-3f : 1e3f;
        light_lamps_add_sun(&lamps, rgb_gray(least), rgb_gray(0.0f));
        struct joint_source prior = light_lamps_prior(&lamps, &lamps.lamp[k]);
        CHECK_NEAR(prior.mean, fmax(lamp, log((double)least)), 1e-6);
        CHECK_NEAR(prior.least, log((double)least), 1e-6);
        CHECK_NEAR(prior.value, prior.least, 1e-6);
    }
    light_lamps_release(&lamps);
    settings_release(&room.settings);
}

int main(void) {
    test_told();
    test_many();
    test_sun();
    return check_result();
}
