/* obj_materials.c -- see obj_materials.h. */
#include "server/ingest/mesh/obj_materials.h"

#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/mesh/mtl.h"
#include "server/ingest/path.h"

#define MAX_LIBRARY_BYTES ((size_t)16 << 20) /* of an MTL file */

/* Gives each name of a material that a face has a material of the materials. */
static void number_materials(const struct obj_objects *o, struct mesh *mesh, struct mesh_materials *materials) {
    int64_t *number = mem_array(o->labels.count, sizeof *number);
    for (size_t i = 0; i < o->labels.count; i++)
        number[i] = -1;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t label[OBJ_LABEL_COUNT];
        memcpy(label, intern_text(&o->objects, (size_t)mesh->object_id[t]), sizeof label);
        int64_t *own = &number[label[OBJ_MATERIAL]];
        if (*own < 0) {
            *own = (int64_t)materials->material_count;
            mesh_materials_add(materials, intern_text(&o->labels, label[OBJ_MATERIAL]));
        }
        mesh->object_id[t] = *own;
    }
    mem_free(number);
}

/* The path of the library, or NULL; the caller's. */
static char *find_library(const struct obj_objects *o, const char *folder) {
    char *clean = NULL, *path = NULL;
    if (!o->library || !folder || path_clean_foreign(o->library, &clean, NULL) != STATUS_OK)
        return NULL;
    const char *at = file_is_in(folder, clean) ? clean : path_base(clean);
    if (file_is_in(folder, at))
        path = file_join(folder, at);
    mem_free(clean);
    return path;
}

enum status obj_materials_settle(const struct obj_objects *o, const char *name, const char *folder, struct mesh *mesh,
                                 struct mesh_materials *materials, struct faces_report *report, struct error *err) {
    struct mapping file = {0};
    enum status status = STATUS_OK;
    size_t missing = 0;
    number_materials(o, mesh, materials);
    char *path = find_library(o, folder);
    bool *found = mem_calloc(materials->material_count + 1, sizeof *found);
    if (path)
        status = mapping_open(&file, path, o->library, "a library of materials", err);
    if (status == STATUS_OK && file.size > MAX_LIBRARY_BYTES)
        status = error_set(err, STATUS_LIMIT, "%s: %s is larger than %zu bytes", name, o->library, MAX_LIBRARY_BYTES);
    if (status == STATUS_OK && path)
        status = mtl_read(o->library, file.data, file.size, folder, materials, found, err);
    for (size_t i = 0; i < materials->material_count; i++)
        missing += !found[i] && materials->material[i].name[0] != '\0';
    if (status == STATUS_OK && o->library && !path)
        faces_note(report, "its materials are in %.80s, which is not there: they are neutral", o->library);
    else if (status == STATUS_OK && missing > 0)
        faces_note(report, "%zu of its materials are not in its library: they are neutral", missing);
    mesh_materials_note(materials, report);
    mapping_close(&file);
    mem_free(found);
    mem_free(path);
    return status;
}
