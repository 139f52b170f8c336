/* gltf_objects.c -- see gltf_objects.h. */
#include "server/ingest/mesh/gltf_objects.h"

#include <string.h>

#include "common/mem.h"
#include "server/ingest/mesh/texture_pages.h"

static const cJSON *item_of(const struct gltf_file *g, const char *list, double number) {
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->json, list);
    return number >= 0.0 && number < 1e6 ? cJSON_GetArrayItem(array, (int)number) : NULL;
}

/* Its name, "" without one. */
static const char *name_of(const cJSON *object) {
    const char *name = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, "name"));
    return name ? name : "";
}

/* --- pages of a texture --------------------------------------------------------------------- */

/* Name or address of the picture of a material's base colour; NULL: it has none, "": one without a name. */
static const char *picture_of(const struct gltf_file *g, const cJSON *material) {
    const cJSON *model = cJSON_GetObjectItemCaseSensitive(material, "pbrMetallicRoughness");
    const cJSON *use = cJSON_GetObjectItemCaseSensitive(model, "baseColorTexture");
    const cJSON *index = cJSON_GetObjectItemCaseSensitive(use, "index");
    if (!cJSON_IsNumber(index))
        return NULL;
    const cJSON *source = cJSON_GetObjectItemCaseSensitive(item_of(g, "textures", index->valuedouble), "source");
    const cJSON *image = cJSON_IsNumber(source) ? item_of(g, "images", source->valuedouble) : NULL;
    const char *uri = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(image, "uri"));
    return uri && strncmp(uri, "data:", 5) != 0 ? uri : name_of(image);
}

/* Takes the numbers of textures out of a material's tree. */
static void forget_textures(cJSON *object) {
    for (cJSON *item = object->child, *next; item; item = next) {
        next = item->next;
        size_t length = item->string ? strlen(item->string) : 0;
        if (length >= 7 && strcmp(item->string + length - 7, "Texture") == 0)
            cJSON_DeleteItemFromObjectCaseSensitive(item, "index");
        else if (cJSON_IsObject(item))
            forget_textures(item);
    }
}

/* The material but for its name and its pictures; the caller's. */
static cJSON *rest_of(const cJSON *material) {
    cJSON *rest = cJSON_Duplicate(material, true);
    cJSON_DeleteItemFromObjectCaseSensitive(rest, "name");
    forget_textures(rest);
    return rest;
}

/* Whether all materials are equal but for a picture each, and materials or pictures are numbered. */
static bool find_pages(const struct gltf_file *g) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(g->json, "materials"), *item;
    size_t count = (size_t)cJSON_GetArraySize(list), found = 0;
    if (count < 2)
        return false;
    const char **name = mem_array(count, sizeof *name), **picture = mem_array(count, sizeof *picture);
    cJSON *first = rest_of(list->child);
    bool are_equal = true;
    cJSON_ArrayForEach(item, list) {
        cJSON *rest = rest_of(item);
        name[found] = name_of(item);
        picture[found] = picture_of(g, item);
        are_equal = are_equal && picture[found++] && cJSON_Compare(first, rest, true);
        cJSON_Delete(rest);
        if (!are_equal)
            break;
    }
    bool result = are_equal && (texture_pages_by_name(name, count) || texture_pages_are_numbered(picture, count));
    cJSON_Delete(first);
    mem_free(picture);
    mem_free(name);
    return result;
}

/* Whether no two objects have the same material. */
static bool have_a_page_each(const struct gltf_objects *o) {
    size_t count = (size_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(o->file->json, "materials"));
    bool *seen = mem_calloc(count + 1, sizeof *seen), each = o->count <= count;
    for (size_t i = 0; i < o->count && each; i++) {
        size_t own = o->material[i] >= 0.0 && o->material[i] < (double)count ? (size_t)o->material[i] : count;
        each = !seen[own];
        seen[own] = true;
    }
    mem_free(seen);
    return each;
}

/* --- objects -------------------------------------------------------------------------------- */

void gltf_objects_init(struct gltf_objects *o, const struct gltf_file *file) {
    *o = (struct gltf_objects){.file = file, .are_pages = find_pages(file)};
}

void gltf_objects_release(struct gltf_objects *o) {
    for (size_t i = 0; i < o->count; i++)
        mem_free(o->name[i]);
    mem_free(o->name);
    mem_free(o->material);
    *o = (struct gltf_objects){0};
}

void gltf_objects_start(struct gltf_objects *o, size_t node, size_t mesh, double material) {
    if (o->count == o->capacity) {
        o->capacity = o->capacity ? 2 * o->capacity : 64;
        o->name = mem_realloc_array(o->name, o->capacity, sizeof *o->name);
        o->material = mem_realloc_array(o->material, o->capacity, sizeof *o->material);
    }
    const char *own = name_of(o->file->nodes.item[node]), *of_mesh = name_of(o->file->meshes.item[mesh]);
    const char *of_material = o->are_pages ? "" : name_of(item_of(o->file, "materials", material));
    own = own[0] ? own : of_mesh;
    bool repeats = strcmp(own, of_material) == 0;
    o->name[o->count] =
        mem_printf("%s%s%s", own, own[0] && of_material[0] && !repeats ? "/" : "", repeats ? "" : of_material);
    o->material[o->count++] = material;
}

void gltf_objects_settle(struct gltf_objects *o, struct mesh *mesh, struct faces_report *report) {
    if (o->are_pages)
        faces_note(report, "its materials are pages of a texture: they do not divide it into segments");
    if (o->count < 2 || (o->are_pages && have_a_page_each(o))) {
        mem_free(mesh->object_id);
        mesh->object_id = NULL;
        return;
    }
    mesh->name_count = o->count;
    mesh->name = o->name;
    o->name = NULL;
    o->count = 0;
}
