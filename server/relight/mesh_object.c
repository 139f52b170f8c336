/* mesh_object.c -- see mesh_object.h. The settings insert.N.base_color and so on stand for all materials of the file
 * where they are given, and for the one of a file without materials where they are not. */
#include "server/relight/mesh_object.h"

#include <math.h>

#include "common/mem.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/relight/setting_files.h"
#include "server/relight/virtual_object_settings.h"

#define MAX_TRIANGLES ((size_t)1 << 24) /* a quarter of what a room may have (bundle.h) */

/* The file's y is up. */
static void move_mesh(const cJSON *s, uint32_t n, const struct compass *compass, vec3 to, struct mesh *m) {
    double turn = virtual_object_number(s, "insert", n, "turn") * PI / 180.0;
    float scale = (float)virtual_object_number(s, "insert", n, "scale"), c = (float)cos(turn), i = (float)sin(turn);
    for (size_t v = 0; v < m->vertex_count; v++) {
        vec3 file[2] = {
            vec3_add(m->position[v], vec3_make((float)m->offset[0], (float)m->offset[1], (float)m->offset[2])),
            m->normal ? m->normal[v] : vec3_make(0.0f, 0.0f, 0.0f)};
        for (int k = 0; k < 2; k++) {
            vec3 p = file[k];
            file[k] = compass_from_map(compass, vec3_make(c * p.x + i * p.z, p.y, c * p.z - i * p.x));
        }
        m->position[v] = vec3_mad(to, scale, file[0]);
        if (m->normal)
            m->normal[v] = file[1];
    }
}

/* --- materials ------------------------------------------------------------------------------------ */

/* Whether the setting is given, or nothing else says it. */
static bool decides(const cJSON *s, uint32_t n, const char *name, bool has_own) {
    return !has_own || render_settings_has(s, virtual_object_key("insert", n, name).text);
}

static void apply_settings(const cJSON *s, uint32_t n, bool has_own, struct mesh_material *m) {
    static const struct {
        const char *name;
        enum material_quantity quantity;
    } mapped[] = {{"base_color", MATERIAL_BASE_COLOR},
                  {"emission", MATERIAL_EMISSION},
                  {"roughness", MATERIAL_ROUGHNESS},
                  {"metallic", MATERIAL_METALLIC}};
    for (size_t i = 0; i < sizeof mapped / sizeof *mapped; i++) {
        if (!decides(s, n, mapped[i].name, has_own))
            continue;
        rgb value = virtual_object_color(s, "insert", n, mapped[i].name);
        float number = (float)virtual_object_number(s, "insert", n, mapped[i].name);
        m->map[mapped[i].quantity].is_there = false;
        switch (mapped[i].quantity) {
        case MATERIAL_BASE_COLOR: m->base_color = value; break;
        case MATERIAL_EMISSION: m->emission = value; break;
        case MATERIAL_ROUGHNESS: m->roughness = number; break;
        case MATERIAL_METALLIC: m->metallic = number; break;
        case MATERIAL_QUANTITIES: break;
        }
    }
    if (decides(s, n, "specular", has_own))
        m->specular = (float)virtual_object_number(s, "insert", n, "specular");
    m->emission = rgb_scale(m->emission, (float)virtual_object_number(s, "insert", n, "emission_scale"));
}

/* Leaves the materials that triangles have, in the order of their numbers; each triangle's object_id is its new one. */
static void keep_used(struct mesh *mesh, struct mesh_materials *materials) {
    size_t kept = 0;
    int64_t *number = mem_array(materials->material_count, sizeof *number);
    for (size_t i = 0; i < materials->material_count; i++)
        number[i] = -1;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        number[mesh->object_id[t]] = 0;
    for (size_t i = 0; i < materials->material_count; i++) {
        struct mesh_material own = materials->material[i];
        if (number[i] < 0)
            continue;
        number[i] = (int64_t)kept;
        materials->material[i] = materials->material[kept];
        materials->material[kept++] = own;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        mesh->object_id[t] = number[mesh->object_id[t]];
    for (size_t i = kept; i < materials->material_count; i++)
        mem_free(materials->material[i].name);
    materials->material_count = kept;
    mem_free(number);
}

/* Of a file without materials: one of the settings. */
static void settle_materials(const cJSON *s, uint32_t n, struct mesh *mesh, struct mesh_materials *materials) {
    bool has_own = materials->material_count > 0 && mesh->object_id;
    if (!has_own) {
        mesh_materials_release(materials);
        mesh_materials_add(materials, "");
        mem_free(mesh->object_id);
        mesh->object_id = mem_calloc(mesh->triangle_count, sizeof *mesh->object_id);
    }
    keep_used(mesh, materials);
    for (size_t i = 0; i < materials->material_count; i++)
        apply_settings(s, n, has_own && materials->material[i].is_own, &materials->material[i]);
}

/* --- the object ------------------------------------------------------------------------------------ */

/* The mean over the part's texels. */
static rgb mean_emission(const struct baked *b, size_t part) {
    double sum[3] = {0.0, 0.0, 0.0}, count = 0.0;
    for (size_t i = 0; i < (size_t)b->atlas.width * b->atlas.height; i++) {
        if (b->base_color[i][3] == 0.0f || b->part[i] != part)
            continue;
        for (int c = 0; c < 3; c++)
            sum[c] += (double)b->emission[i][c];
        count += 1.0;
    }
    return count > 0.0 ? rgb_make((float)(sum[0] / count), (float)(sum[1] / count), (float)(sum[2] / count))
                       : rgb_gray(0.0f);
}

static enum status make_parts(const struct mesh_materials *materials, struct parallel *pool,
                              struct virtual_object *object, struct error *err) {
    object->part_count = materials->material_count;
    object->part = mem_calloc(object->part_count, sizeof *object->part);
    for (size_t i = 0; i < object->part_count; i++) {
        const struct mesh_material *m = &materials->material[i];
        object->part[i] =
            (struct virtual_object_part){m->base_color, m->emission, m->roughness, m->specular, m->metallic};
    }
    if (!mesh_materials_have_maps(materials))
        return STATUS_OK;
    object->baked = mem_calloc(1, sizeof *object->baked);
    enum status status = bake_make(&object->mesh, materials, pool, object->baked, err);
    for (size_t i = 0; i < object->part_count && status == STATUS_OK && object->baked->emission; i++)
        object->part[i].emission = mean_emission(object->baked, i);
    return status;
}

/* Triangles of materials with pictures that have no texture coordinates. */
static size_t count_bare(const struct mesh *mesh, const struct mesh_materials *materials) {
    size_t count = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const struct material_map *map = materials->material[mesh->object_id[t]].map;
        bool has_map = false, has_uv = mesh->uv && isfinite(mesh->uv[t][0].x) && isfinite(mesh->uv[t][0].y);
        for (int q = 0; q < MATERIAL_QUANTITIES; q++)
            has_map = has_map || map[q].is_there;
        count += has_map && !has_uv;
    }
    return count;
}

static void add_notes(const char *name, const struct faces_report *report, size_t bare,
                      struct virtual_objects *objects) {
    objects->note =
        mem_realloc_array(objects->note, objects->note_count + report->note_count + 1, sizeof *objects->note);
    for (size_t i = 0; i < report->note_count; i++)
        objects->note[objects->note_count++] = mem_printf("%s: %s", name, report->note[i]);
    if (bare > 0)
        objects->note[objects->note_count++] =
            mem_printf("%s: %zu triangles have no texture coordinates: they are without their pictures", name, bare);
}

enum status mesh_object_make(const struct relight_job *job, uint32_t n, const struct compass *compass,
                             const double offset[3], struct parallel *pool, struct virtual_object *object,
                             struct virtual_objects *objects, struct error *err) {
    const cJSON *s = job->settings;
    struct faces_report report = {0};
    struct mesh_materials materials = {0};
    const char *name = render_settings_text(s, virtual_object_key("insert", n, "file").text);
    char *path = setting_files_path(job, name);
    enum status status = mesh_file_read_materials(path, name, MAX_TRIANGLES, &object->mesh, &materials, &report, err);
    if (status == STATUS_OK)
        status = mesh_check(&object->mesh, name, NULL, err);
    if (status == STATUS_OK) {
        move_mesh(s, n, compass, virtual_object_position(s, "insert", n, offset), &object->mesh);
        settle_materials(s, n, &object->mesh, &materials);
        add_notes(name, &report, count_bare(&object->mesh, &materials), objects);
        object->name = mem_printf("insert_%u", n);
        object->cone.outer = -1.0f;
        status = make_parts(&materials, pool, object, err);
    }
    mesh_materials_release(&materials);
    mem_free(path);
    return status;
}
