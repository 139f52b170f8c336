/* test_user_corrections.c -- what a user puts right of a job: photographs left out, a part of the mesh kept, a segment
 * that emits or does not. */
#include "server/scene/select.h"
#include "tests/unit/tiny_scene.h"

#define SETTINGS TINY_SETTINGS ",\"quality\":\"draft\""

static double number(const cJSON *json, const char *object, const char *key) {
    return cJSON_GetNumberValue(cJSON_GetObjectItem(cJSON_GetObjectItem(json, object), key));
}

/* How many segments emit. */
static int emitters(const cJSON *json) {
    int count = 0;
    const cJSON *segment;
    cJSON_ArrayForEach(segment, cJSON_GetObjectItem(json, "segments"))
        count += cJSON_IsTrue(cJSON_GetObjectItem(segment, "emitter"));
    return count;
}

static void refused(const char *settings, const char *part) {
    CHECK_THAT(reconstruct(settings, scene, "") == STATUS_INPUT && strstr(err.message, part), "%s: %s", settings,
               err.message);
}

static void check_photographs(void) {
    refused("{" SETTINGS ",\"exclude\":\"b.png,x*\"}", "no photograph is named x*");
    refused("{" SETTINGS ",\"exclude\":\"[ab].png\"}", "exclude leaves 1 photographs; 3 are needed");
    OK(reconstruct("{" SETTINGS ",\"exclude\":\"\"}", scene, ""));
}

static void check_mesh(void) {
    OK(reconstruct("{" SETTINGS "}", scene, ""));
    cJSON *whole = read_report();
    OK(reconstruct("{" SETTINGS ",\"crop\":\"0 0 -1, .5 .5 1\"}", scene, ""));
    cJSON *part = read_report();
    CHECK(number(whole, "prepare", "triangles") == 2.0 && number(part, "prepare", "triangles") == 1.0);
    refused("{" SETTINGS ",\"crop\":\"5 5 5 6 6 6\"}", "no triangle");
    refused("{" SETTINGS ",\"crop\":\"1 0 0 0 1 1\"}", "six numbers");
    cJSON_Delete(whole);
    cJSON_Delete(part);

    /* The same triangle of a mesh that was recentred. */
    vec3 position[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    uint32_t index[2][3] = {{0, 1, 2}, {1, 3, 2}}, face[2] = {0, 1};
    struct scene far = {.mesh = {.vertex_count = 4,
                                 .position = position,
                                 .triangle_count = 2,
                                 .index = index,
                                 .face = face,
                                 .offset = {600000.0, 5000000.0, 0.0}}};
    size_t left_out;
    const double lower[3] = {600000.0, 5000000.0, -1.0}, upper[3] = {600000.5, 5000000.5, 1.0};
    OK(scene_crop(&far, lower, upper, &left_out, &err));
    CHECK(left_out == 1 && index[0][1] == 1);
}

static void check_emitters(void) {
    OK(reconstruct("{" SETTINGS ",\"emitters.0\":\"on\"}", scene, ""));
    cJSON *lit = read_report();
    OK(reconstruct("{" SETTINGS ",\"emitters.0\":\"off\"}", scene, ""));
    cJSON *dark = read_report();
    CHECK_THAT(emitters(lit) == 1 && emitters(dark) == 0, "%d, %d", emitters(lit), emitters(dark));
    cJSON_Delete(lit);
    cJSON_Delete(dark);
}

int main(void) {
    tiny_scene_make("corrections");
    check_photographs();
    check_mesh();
    check_emitters();
    refused("{" SETTINGS ",\"emitters.7\":\"on\"}", "emitters.7: there are");
    tiny_scene_remove();
    return check_result();
}
