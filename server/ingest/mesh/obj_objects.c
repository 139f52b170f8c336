/* obj_objects.c -- see obj_objects.h. */
#include "server/ingest/mesh/obj_objects.h"

#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/mesh/texture_pages.h"
#include "server/ingest/path.h"

#define MAX_LIBRARY_BYTES ((size_t)16 << 20) /* of an MTL file */

void obj_objects_init(struct obj_objects *o) {
    *o = (struct obj_objects){0};
    intern_init(&o->labels);
    intern_init(&o->objects);
    for (int i = 0; i < OBJ_LABEL_COUNT; i++)
        o->label[i] = intern_number(&o->labels, "", 1); /* names have their NUL */
}

void obj_objects_release(struct obj_objects *o) {
    intern_release(&o->objects);
    intern_release(&o->labels);
    mem_free(o->library);
}

void obj_objects_set(struct obj_objects *o, enum obj_label kind, const void *name, size_t length) {
    char *copy = mem_strndup(name, length);
    o->label[kind] = intern_number(&o->labels, copy, strlen(copy) + 1);
    o->object_known = false;
    mem_free(copy);
}

void obj_objects_set_library(struct obj_objects *o, const void *name, size_t length) {
    mem_free(o->library);
    o->library = mem_strndup(name, length);
}

uint32_t obj_objects_current(struct obj_objects *o) {
    if (!o->object_known)
        o->object = intern_number(&o->objects, o->label, sizeof o->label);
    o->object_known = true;
    return o->object;
}

/* --- pages of a texture --------------------------------------------------------------------- */

/* The labels of an object, by number. */
static void labels_of(const struct obj_objects *o, size_t object, uint32_t label[OBJ_LABEL_COUNT]) {
    memcpy(label, intern_text(&o->objects, object), OBJ_LABEL_COUNT * sizeof *label);
}

/* Distinct names of a kind, in order of first use: name[objects.count], borrowed. */
static size_t list_names(const struct obj_objects *o, enum obj_label kind, const char **name) {
    bool *seen = mem_calloc(o->labels.count, sizeof *seen);
    size_t count = 0;
    for (size_t i = 0; i < o->objects.count; i++) {
        uint32_t label[OBJ_LABEL_COUNT];
        labels_of(o, i, label);
        if (!seen[label[kind]])
            name[count++] = intern_text(&o->labels, label[kind]);
        seen[label[kind]] = true;
    }
    mem_free(seen);
    return count;
}

static enum texture_pages ask_library(const struct obj_objects *o, const char *folder, const char *const *name,
                                      size_t count, size_t *picture_count) {
    struct mapping file = {0};
    char *clean = NULL;
    enum texture_pages answer = TEXTURE_PAGES_UNKNOWN;
    if (!folder || !o->library || path_clean(o->library, &clean, NULL) != STATUS_OK)
        return answer;
    if (file_is_in(folder, clean)) {
        char *path = file_join(folder, clean);
        if (mapping_open(&file, path, clean, "a library of materials", NULL) == STATUS_OK &&
            file.size <= MAX_LIBRARY_BYTES)
            answer = texture_pages_by_mtl((const char *)file.data, file.size, name, count, picture_count);
        mapping_close(&file);
        mem_free(path);
    }
    mem_free(clean);
    return answer;
}

/* Whether each name of the kind goes with one material and each material with one name. */
static bool goes_with_materials(const struct obj_objects *o, enum obj_label kind) {
    uint32_t *name = mem_array(o->labels.count, sizeof *name), *material = mem_array(o->labels.count, sizeof *material);
    bool goes = true;
    memset(name, 0xff, o->labels.count * sizeof *name);
    memset(material, 0xff, o->labels.count * sizeof *material);
    for (size_t i = 0; i < o->objects.count; i++) {
        uint32_t label[OBJ_LABEL_COUNT];
        labels_of(o, i, label);
        uint32_t *of_material = &name[label[OBJ_MATERIAL]], *of_name = &material[label[kind]];
        *of_material = *of_material == UINT32_MAX ? label[kind] : *of_material;
        *of_name = *of_name == UINT32_MAX ? label[OBJ_MATERIAL] : *of_name;
        goes = goes && *of_material == label[kind] && *of_name == label[OBJ_MATERIAL];
    }
    mem_free(material);
    mem_free(name);
    return goes;
}

/* Forgets materials, and the names that go with them, and numbers the objects anew. */
static void drop_materials(struct obj_objects *o, struct mesh *mesh) {
    bool dropped[OBJ_LABEL_COUNT] = {goes_with_materials(o, OBJ_OBJECT), goes_with_materials(o, OBJ_GROUP), true};
    uint32_t none = intern_number(&o->labels, "", 1);
    uint32_t *number = mem_array(o->objects.count, sizeof *number);
    struct intern left;
    intern_init(&left);
    for (size_t i = 0; i < o->objects.count; i++) {
        uint32_t label[OBJ_LABEL_COUNT];
        labels_of(o, i, label);
        for (int k = 0; k < OBJ_LABEL_COUNT; k++)
            label[k] = dropped[k] ? none : label[k];
        number[i] = intern_number(&left, label, sizeof label);
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        mesh->object_id[t] = number[mesh->object_id[t]];
    mem_free(number);
    intern_release(&o->objects);
    o->objects = left;
}

/* --- names ---------------------------------------------------------------------------------- */

/* The distinct names among the labels, with a slash between them; the caller's. */
static char *name_of(const struct obj_objects *o, size_t object) {
    uint32_t label[OBJ_LABEL_COUNT];
    char *name = mem_strdup("");
    labels_of(o, object, label);
    for (int k = 0; k < OBJ_LABEL_COUNT; k++) {
        bool repeats = (k > 0 && label[k] == label[0]) || (k > 1 && label[k] == label[1]);
        const char *own = intern_text(&o->labels, label[k]);
        if (repeats || own[0] == '\0')
            continue;
        char *longer = mem_printf("%s%s%s", name, name[0] ? "/" : "", own);
        mem_free(name);
        name = longer;
    }
    return name;
}

void obj_objects_settle(struct obj_objects *o, const char *folder, struct mesh *mesh, struct faces_report *report) {
    const char **name = mem_array(o->objects.count + 1, sizeof *name);
    size_t count = list_names(o, OBJ_MATERIAL, name);
    enum texture_pages pages = ask_library(o, folder, name, count, &mesh->picture_count);
    if (pages == TEXTURE_PAGES_YES ||
        (pages == TEXTURE_PAGES_UNKNOWN && count > 1 && texture_pages_by_name(name, count))) {
        faces_note(report, "its %zu materials (%.40s, ...) are pages of a texture: they do not divide it into segments",
                   count, name[0]);
        drop_materials(o, mesh);
    }
    mem_free(name);
    if (o->objects.count < 2) {
        mem_free(mesh->object_id);
        mesh->object_id = NULL;
        return;
    }
    mesh->name_count = o->objects.count;
    mesh->name = mem_array(mesh->name_count, sizeof *mesh->name);
    for (size_t i = 0; i < mesh->name_count; i++)
        mesh->name[i] = name_of(o, i);
}
