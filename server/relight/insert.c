/* insert.c -- see insert.h. The settings insert.N.base_color and so on stand for all materials of the file where they
 * are given, and for the one of a file without materials where they are not. */
#include "server/relight/insert.h"

#include <math.h>

#include "common/mem.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/relight/files.h"
#include "server/relight/thing_settings.h"

#define MAX_TRIANGLES ((size_t)1 << 24)

/* The file's y is up. */
static void move_mesh(const cJSON *s, uint32_t n, const struct compass *compass, vec3 to, struct mesh *m) {
    double turn = thing_number(s, "insert", n, "turn") * PI / 180.0;
    float scale = (float)thing_number(s, "insert", n, "scale"), c = (float)cos(turn), i = (float)sin(turn);
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
    return !has_own || render_settings_has(s, thing_key("insert", n, name).text);
}

static void apply_settings(const cJSON *s, uint32_t n, bool has_own, struct look_material *m) {
    static const struct {
        const char *name;
        enum look_quantity quantity;
    } mapped[] = {{"base_color", LOOK_BASE_COLOR},
                  {"emission", LOOK_EMISSION},
                  {"roughness", LOOK_ROUGHNESS},
                  {"metallic", LOOK_METALLIC}};
    for (size_t i = 0; i < sizeof mapped / sizeof *mapped; i++) {
        if (!decides(s, n, mapped[i].name, has_own))
            continue;
        rgb value = thing_color(s, "insert", n, mapped[i].name);
        float number = (float)thing_number(s, "insert", n, mapped[i].name);
        m->map[mapped[i].quantity].is_there = false;
        switch (mapped[i].quantity) {
        case LOOK_BASE_COLOR: m->base_color = value; break;
        case LOOK_EMISSION: m->emission = value; break;
        case LOOK_ROUGHNESS: m->roughness = number; break;
        case LOOK_METALLIC: m->metallic = number; break;
        case LOOK_QUANTITIES: break;
        }
    }
    if (decides(s, n, "specular", has_own))
        m->specular = (float)thing_number(s, "insert", n, "specular");
    m->emission = rgb_scale(m->emission, (float)thing_number(s, "insert", n, "emission_scale"));
}

/* Leaves the materials that triangles have, in the order of their numbers; each triangle's object_id is its new one. */
static void keep_used(struct mesh *mesh, struct mesh_look *look) {
    size_t kept = 0;
    int64_t *number = mem_array(look->material_count, sizeof *number);
    for (size_t i = 0; i < look->material_count; i++)
        number[i] = -1;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        number[mesh->object_id[t]] = 0;
    for (size_t i = 0; i < look->material_count; i++) {
        struct look_material own = look->material[i];
        if (number[i] < 0)
            continue;
        number[i] = (int64_t)kept;
        look->material[i] = look->material[kept];
        look->material[kept++] = own;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        mesh->object_id[t] = number[mesh->object_id[t]];
    for (size_t i = kept; i < look->material_count; i++)
        mem_free(look->material[i].name);
    look->material_count = kept;
    mem_free(number);
}

/* Of a file without materials: one of the settings. */
static void settle_materials(const cJSON *s, uint32_t n, struct mesh *mesh, struct mesh_look *look) {
    bool has_own = look->material_count > 0 && mesh->object_id;
    if (!has_own) {
        look_release(look);
        look_add(look, "");
        mem_free(mesh->object_id);
        mesh->object_id = mem_calloc(mesh->triangle_count, sizeof *mesh->object_id);
    }
    keep_used(mesh, look);
    for (size_t i = 0; i < look->material_count; i++)
        apply_settings(s, n, has_own && look->material[i].is_own, &look->material[i]);
}

/* --- the thing ------------------------------------------------------------------------------------ */

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

static enum status make_parts(const struct mesh_look *look, struct parallel *pool, struct thing *thing,
                              struct error *err) {
    thing->part_count = look->material_count;
    thing->part = mem_calloc(thing->part_count, sizeof *thing->part);
    for (size_t i = 0; i < thing->part_count; i++) {
        const struct look_material *m = &look->material[i];
        thing->part[i] = (struct thing_part){m->base_color, m->emission, m->roughness, m->specular, m->metallic};
    }
    if (!look_has_maps(look))
        return STATUS_OK;
    thing->baked = mem_calloc(1, sizeof *thing->baked);
    enum status status = bake_make(&thing->mesh, look, pool, thing->baked, err);
    for (size_t i = 0; i < thing->part_count && status == STATUS_OK && thing->baked->emission; i++)
        thing->part[i].emission = mean_emission(thing->baked, i);
    return status;
}

/* Triangles of materials with pictures that have no texture coordinates. */
static size_t count_bare(const struct mesh *mesh, const struct mesh_look *look) {
    size_t count = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const struct look_map *map = look->material[mesh->object_id[t]].map;
        bool has_map = false, has_uv = mesh->uv && isfinite(mesh->uv[t][0].x) && isfinite(mesh->uv[t][0].y);
        for (int q = 0; q < LOOK_QUANTITIES; q++)
            has_map = has_map || map[q].is_there;
        count += has_map && !has_uv;
    }
    return count;
}

static void add_notes(const char *name, const struct faces_report *report, size_t bare, struct things *things) {
    things->note = mem_realloc_array(things->note, things->note_count + report->note_count + 1, sizeof *things->note);
    for (size_t i = 0; i < report->note_count; i++)
        things->note[things->note_count++] = mem_printf("%s: %s", name, report->note[i]);
    if (bare > 0)
        things->note[things->note_count++] =
            mem_printf("%s: %zu triangles have no texture coordinates: they are without their pictures", name, bare);
}

enum status insert_make(const struct relight_job *job, uint32_t n, const struct compass *compass,
                        const double offset[3], struct parallel *pool, struct thing *thing, struct things *things,
                        struct error *err) {
    const cJSON *s = job->settings;
    struct faces_report report = {0};
    struct mesh_look look = {0};
    const char *name = render_settings_text(s, thing_key("insert", n, "file").text);
    char *path = files_path(job, name);
    enum status status = mesh_file_read_look(path, name, MAX_TRIANGLES, &thing->mesh, &look, &report, err);
    if (status == STATUS_OK)
        status = mesh_check(&thing->mesh, name, NULL, err);
    if (status == STATUS_OK) {
        move_mesh(s, n, compass, thing_place(s, "insert", n, offset), &thing->mesh);
        settle_materials(s, n, &thing->mesh, &look);
        add_notes(name, &report, count_bare(&thing->mesh, &look), things);
        thing->name = mem_printf("insert_%u", n);
        thing->cone.outer = -1.0f;
        status = make_parts(&look, pool, thing, err);
    }
    look_release(&look);
    mem_free(path);
    return status;
}
