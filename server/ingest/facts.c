/* facts.c -- see facts.h. */
#include "server/ingest/facts.h"

#include <math.h>

#include "common/mem.h"
#include "server/ingest/photo_color.h"

static cJSON *vec3_facts(vec3 v) {
    cJSON *array = cJSON_CreateArray();
    cJSON_AddItemToArray(array, cJSON_CreateNumber((double)v.x));
    cJSON_AddItemToArray(array, cJSON_CreateNumber((double)v.y));
    cJSON_AddItemToArray(array, cJSON_CreateNumber((double)v.z));
    return array;
}

#define MAX_NAMES 200 /* of objects, in the facts; report.json has all */

/* What the input calls its objects, by object_id; only where it has names. */
static void add_names(cJSON *facts, const struct mesh *mesh) {
    if (mesh->name_count == 0)
        return;
    cJSON *names = cJSON_AddArrayToObject(facts, "object_names");
    for (size_t i = 0; i < mesh->name_count && i < MAX_NAMES; i++)
        cJSON_AddItemToArray(names, json_new_string(mesh->name[i]));
    json_add_int(facts, "object_count", (int64_t)mesh->name_count);
}

static void add_mesh_facts(cJSON *facts, const struct scene *scene) {
    const struct mesh *mesh = &scene->mesh;
    vec3 lower, upper;
    mesh_bounds(mesh, &lower, &upper);
    json_add_int(facts, "vertex_count", (int64_t)mesh->vertex_count);
    json_add_int(facts, "triangle_count", (int64_t)mesh->triangle_count);
    json_add_int(facts, "face_count", (int64_t)mesh->face_count);
    json_add_bool(facts, "has_normals", mesh->normal != NULL);
    json_add_bool(facts, "has_object_id", mesh->object_id != NULL);
    add_names(facts, mesh);
    json_add_int(facts, "degenerate_count", (int64_t)scene->mesh_report.degenerate_count);
    json_add_int(facts, "duplicate_count", (int64_t)scene->mesh_report.duplicate_count);
    json_add_number(facts, "area_m2", mesh_area(mesh));
    json_add(facts, "lower_m", vec3_facts(lower));
    json_add(facts, "upper_m", vec3_facts(upper));
    json_add(facts, "offset", cJSON_CreateDoubleArray(mesh->offset, 3));
}

static cJSON *exposure_facts(const struct scene *scene) {
    cJSON *facts = cJSON_CreateObject();
    size_t known_count = 0;
    double least = INFINITY, largest = 0.0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *p = &scene->photograph[i];
        if (!p->exposure_known)
            continue;
        known_count++;
        least = fmin(least, (double)p->exposure);
        largest = fmax(largest, (double)p->exposure);
    }
    json_add_int(facts, "known_count", (int64_t)known_count);
    json_add_int(facts, "unknown_count", (int64_t)(scene->photograph_count - known_count));
    if (known_count > 0) {
        json_add_number(facts, "least", least);
        json_add_number(facts, "largest", largest);
    }
    return facts;
}

cJSON *facts_warnings(const struct scene *scene) {
    cJSON *warnings = cJSON_CreateArray();
    for (size_t i = 0; i < scene->warning_count; i++)
        cJSON_AddItemToArray(warnings, json_new_string(scene->warning[i]));
    return warnings;
}

cJSON *facts_of(const struct scene *scene) {
    cJSON *facts = cJSON_CreateObject();
    size_t test_count = 0, hdr_count = 0, mask_count = 0;
    uint64_t pixel_count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *p = &scene->photograph[i];
        test_count += p->is_test;
        hdr_count += p->is_hdr;
        mask_count += p->file.has_mask;
        struct camera camera = photograph_file_camera(p);
        pixel_count += (uint64_t)camera.width * camera.height;
    }
    add_mesh_facts(facts, scene);
    json_add_string(facts, "source", scene->source);
    json_add_int(facts, "named_count", (int64_t)scene->named_count);
    json_add_int(facts, "frame_count", (int64_t)scene->photograph_count);
    json_add_int(facts, "train_count", (int64_t)(scene->photograph_count - test_count));
    json_add_int(facts, "test_count", (int64_t)test_count);
    json_add_int(facts, "hdr_count", (int64_t)hdr_count);
    json_add_int(facts, "mask_count", (int64_t)mask_count);
    json_add_int(facts, "pixel_count", (int64_t)pixel_count);
    json_add(facts, "exposure", exposure_facts(scene));
    char *color = photo_color_fact(scene);
    if (color)
        json_add_string(facts, "photographs", color);
    mem_free(color);
    json_add(facts, "warnings", facts_warnings(scene));
    return facts;
}
