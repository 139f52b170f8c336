/* test_glb_lights.c -- stand-ins for lamps in scene.glb: their flux and directions, in closed form. */
#include "server/export/glb_lights.h"

#include "common/mem.h"
#include "tests/check.h"

#define STRIP 40 /* squares of 10 cm */
#define SQUARES (1 + 6 + STRIP + 1)

/* A panel of 2 m2 that faces down, a cube of side .2 m, a strip 4 m long that faces +x, and a wall that emits
 * nothing. */
static void make_room(struct mesh *mesh, struct segments *segments) {
    *mesh = (struct mesh){.position = mem_array(4 * SQUARES, sizeof *mesh->position),
                          .index = mem_array(2 * SQUARES, sizeof *mesh->index)};
    segments->of_triangle = mem_array(2 * SQUARES, sizeof *segments->of_triangle);
    for (uint32_t i = 0; i < SQUARES; i++) {
        uint32_t segment = i == 0 ? 0 : i < 7 ? 1 : i < 7 + STRIP ? 2 : 3;
        vec3 centre = {0.0f, 0.0f, 3.0f}, u = {1.0f, 0.0f, 0.0f}, v = {0.0f, -0.5f, 0.0f};
        if (segment == 1) {
            static const vec3 axes[3] = {{0.1f, 0, 0}, {0, 0.1f, 0}, {0, 0, 0.1f}};
            uint32_t axis = (i - 1) / 2;
            bool is_front = i % 2 == 1;
            u = axes[(axis + 1) % 3];
            v = is_front ? axes[(axis + 2) % 3] : vec3_neg(axes[(axis + 2) % 3]);
            centre = vec3_add((vec3){1, 2, 1}, is_front ? axes[axis] : vec3_neg(axes[axis]));
        } else if (segment == 2) {
            centre = (vec3){-2.0f, 0.1f * (float)(i - 7), 1.0f};
            u = (vec3){0.0f, 0.05f, 0.0f};
            v = (vec3){0.0f, 0.0f, 0.05f};
        }
        for (uint32_t k = 0; k < 4; k++) {
            float a = k == 1 || k == 2 ? 1.0f : -1.0f, b = k >= 2 ? 1.0f : -1.0f;
            mesh->position[4 * i + k] = vec3_mad(vec3_mad(centre, a, u), b, v);
        }
        for (uint32_t h = 0; h < 2; h++) {
            const uint32_t corner[3] = {4 * i, 4 * i + 1 + h, 4 * i + 2 + h};
            memcpy(mesh->index[2 * i + h], corner, sizeof corner);
            segments->of_triangle[2 * i + h] = segment;
        }
    }
    mesh->vertex_count = 4 * SQUARES;
    mesh->triangle_count = 2 * SQUARES;
    segments->count = 4;
}

static double number(const cJSON *array, int index) { return cJSON_GetNumberValue(cJSON_GetArrayItem(array, index)); }

static double intensity(const cJSON *light) { return cJSON_GetNumberValue(cJSON_GetObjectItem(light, "intensity")); }

/* The third column of a node's matrix, which the light shines against. */
static void check_back(const cJSON *node, double x, double y, double z) {
    const cJSON *m = cJSON_GetObjectItem(node, "matrix");
    CHECK(fabs(number(m, 8) - x) < 1e-6 && fabs(number(m, 9) - y) < 1e-6 && fabs(number(m, 10) - z) < 1e-6);
}

static const char *type_of(const cJSON *light) { return cJSON_GetStringValue(cJSON_GetObjectItem(light, "type")); }

static void check_lights(const struct export_input *in, double unit) {
    cJSON *lights = cJSON_CreateArray(), *nodes = cJSON_CreateArray(), *light;
    glb_lights_add(in, lights, nodes);
    int count = cJSON_GetArraySize(lights);
    CHECK_THAT(count == cJSON_GetArraySize(nodes) && count == 1 + 1 + 4 + 1, "%d", count);
    double strip = 0.0;
    int panels = 0, bulbs = 0, strips = 0;
    for (int i = 0; i < count; i++) {
        const cJSON *node = cJSON_GetArrayItem(nodes, i), *color;
        const char *name = cJSON_GetStringValue(cJSON_GetObjectItem(node, "name"));
        light = cJSON_GetArrayItem(lights, i);
        color = cJSON_GetObjectItem(light, "color");
        if (strcmp(name, "segment 0 light") == 0) {
            panels++;
            CHECK_STRING(type_of(light), "spot");
            CHECK_NEAR(intensity(light), 1.5 * 2.0 * 6.0 * unit, 1e-3 * unit);
            CHECK_NEAR(number(color, 1), 0.5, 1e-6);
            CHECK_NEAR(number(cJSON_GetObjectItem(node, "matrix"), 14), 2.99, 1e-6); /* in front of it */
            check_back(node, 0, 0, 1);
        } else if (strcmp(name, "segment 1 light") == 0) {
            bulbs++;
            CHECK_STRING(type_of(light), "point");
            CHECK_NEAR(intensity(light), 0.25 * 6.0 * 0.04 * 8.0 * unit, 1e-3 * unit);
            CHECK_NEAR(number(cJSON_GetObjectItem(node, "translation"), 1), 2.0, 1e-6);
        } else if (strncmp(name, "segment 2 light", 15) == 0) {
            strips++;
            strip += intensity(light);
            check_back(node, -1, 0, 0);
        } else {
            CHECK_STRING(type_of(light), "directional");
            CHECK_NEAR(intensity(light), 5.0 * unit, 1e-3 * unit);
            check_back(node, 0, 0.6, 0.8);
        }
    }
    CHECK(panels == 1 && bulbs == 1 && strips == 4);
    CHECK_NEAR(strip, 1.5 * STRIP * 0.01 * 1.0 * unit, 1e-3 * unit);
    cJSON_Delete(lights);
    cJSON_Delete(nodes);
}

/* No emitter, no light. */
static void check_dark(struct export_input *in, struct materials *dark) {
    cJSON *lights = cJSON_CreateArray(), *nodes = cJSON_CreateArray();
    memset(dark->emission, 0, dark->segment_count * sizeof *dark->emission);
    in->sun.is_there = false;
    glb_lights_add(in, lights, nodes);
    CHECK(cJSON_GetArraySize(lights) == 0 && cJSON_GetArraySize(nodes) == 0);
    cJSON_Delete(lights);
    cJSON_Delete(nodes);
}

int main(void) {
    struct mesh mesh;
    struct segments segments = {.id = (int64_t[]){0, 1, 2, 3}};
    rgb emission[4] = {{6, 3, 3}, {8, 8, 8}, {1, 1, 1}, {0, 0, 0}};
    struct materials materials = {.segment_count = 4, .emission = emission};
    make_room(&mesh, &segments);
    struct export_input in = {.mesh = &mesh,
                              .segments = &segments,
                              .materials = &materials,
                              .options = {.glb_has_lights = true},
                              .sun = {true, {0.0f, 0.6f, 0.8f}, 0.005f, {5, 5, 5}}};
    check_lights(&in, 1.0);
    in.luminance_per_unit = 200.0;
    check_lights(&in, 200.0);
    check_dark(&in, &materials);
    mem_free(mesh.position);
    mem_free(mesh.index);
    mem_free(segments.of_triangle);
    return check_result();
}
