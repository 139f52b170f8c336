/* found_emitters.c -- see found_emitters.h. */
#include "server/evaluate/found_emitters.h"

#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"

#define OBJECTS_LIMIT ((size_t)1 << 26) /* bytes of objects.json */

/* Areas of one object in the recovered room. */
struct object {
    double area, emitting_area;
};

/* Areas of the object's triangles, all and emitting ones; sets `emits` of its triangles. */
static struct object measure_object(const struct mesh *mesh, const struct recovered *recovered, int64_t id,
                                    bool object_emits, bool *emits) {
    struct object object = {0.0, 0.0};
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (mesh->object_id[t] != id)
            continue;
        double area = (double)mesh_triangle_area(mesh, t);
        uint32_t segment = recovered->segments.of_triangle[t];
        object.area += area;
        if (!rgb_is_black(recovered->materials.emission[segment]))
            object.emitting_area += area;
        emits[t] = object_emits;
    }
    return object;
}

enum status found_emitters_count(const char *room, const struct mesh *mesh, const struct recovered *recovered,
                                 bool *emits, struct found_emitters *found, struct error *err) {
    char *path = file_join(room, "truth/objects.json");
    cJSON *list = NULL;
    *found = (struct found_emitters){0};
    enum status status = json_read(path, OBJECTS_LIMIT, &list, err);
    if (status == STATUS_OK && !cJSON_IsArray(list))
        status = error_set(err, STATUS_INPUT, "%s: not a list of objects", path);
    if (status == STATUS_OK && !mesh->object_id) {
        status = error_set(err, STATUS_INPUT,
                           "%s: the faces of the mesh have no object_id, by which the truth names objects", room);
        error_hint(err, "the room of the truth is a PLY with object_id, as `unbaked demo-room` writes it");
    }
    for (const cJSON *o = list ? list->child : NULL; o && status == STATUS_OK; o = o->next) {
        const cJSON *emission = cJSON_GetObjectItemCaseSensitive(o, "emission");
        double id;
        bool object_emits = false;
        for (const cJSON *c = emission ? emission->child : NULL; c; c = c->next)
            object_emits = object_emits || c->valuedouble > 0.0;
        status = json_number(o, "id", "truth/objects.json", -1.0, &id, err);
        struct object object = measure_object(mesh, recovered, (int64_t)id, object_emits, emits);
        if (object.area == 0.0)
            continue; /* all triangles of the object are degenerate */
        bool mostly = object.emitting_area > 0.5 * object.area;
        found->count += object_emits;
        found->found += object_emits && mostly;
        found->missed += object_emits && !mostly;
        found->unfounded += !object_emits && object.emitting_area > 0.0;
    }
    cJSON_Delete(list);
    mem_free(path);
    return status;
}
