/* check_table.c -- see check_table.h. */
#include "server/check/check_table.h"

#include <math.h>
#include <string.h>

#include "common/buf.h"
#include "common/kept_pixels.h"
#include "common/mem.h"
#include "server/check/estimate.h"
#include "server/scene/adjacency.h"
#include "server/scene/segment.h"

#define REASONS_MAX 3  /* frames left out that are told one by one */
#define SIZES_MAX 4    /* sizes of pictures that are told one by one */
#define SIDE_MIN 256.0 /* texels a side, below which nobody is sent */
/* Diagonals of rooms, metres: outside of these another unit is likely. */
#define ROOM_MIN 1.0
#define ROOM_MAX 100.0

static void add_row(cJSON *table, const char *label, struct buf *value) {
    cJSON *row = cJSON_CreateObject();
    json_add_string(row, "label", label);
    json_add_string(row, "value", buf_text(value));
    cJSON_AddItemToArray(table, row);
    buf_clear(value);
}

/* --- photographs --------------------------------------------------------------------------------------- */

static void tell_frames(const struct scene *scene, struct buf *text) {
    size_t held_out = 0, told = 0;
    for (size_t i = 0; i < scene->photograph_count; i++)
        held_out += scene->photograph[i].is_test;
    if (scene->named_count > scene->photograph_count)
        buf_printf(text, "%zu of %zu", scene->photograph_count, scene->named_count);
    else
        buf_printf(text, "all %zu", scene->photograph_count);
    if (held_out > 0)
        buf_printf(text, ", %zu of them held out", held_out);
    for (size_t i = 0; i < scene->warning_count && scene->named_count > scene->photograph_count; i++) {
        if (!strstr(scene->warning[i], "left out"))
            continue;
        if (told++ < REASONS_MAX)
            buf_printf(text, "%s %s", told == 1 ? ":" : ";", scene->warning[i]);
    }
    if (told > REASONS_MAX)
        buf_printf(text, "; and %zu more: see the warnings", told - REASONS_MAX);
}

static void tell_sizes(const struct scene *scene, struct buf *text) {
    struct {
        uint32_t width, height;
        size_t count;
    } size[SIZES_MAX];
    size_t kinds = 0, others = 0;
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera c = photograph_file_camera(&scene->photograph[i]);
        size_t k = 0;
        while (k < kinds && (size[k].width != c.width || size[k].height != c.height))
            k++;
        if (k < kinds) {
            size[k].count++;
        } else if (kinds < SIZES_MAX) {
            size[kinds].width = c.width;
            size[kinds].height = c.height;
            size[kinds++].count = 1;
        } else {
            others++;
        }
    }
    for (size_t k = 0; k < kinds; k++)
        buf_printf(text, "%s%zu of %u x %u", k > 0 ? ", " : "", size[k].count, size[k].width, size[k].height);
    if (others > 0)
        buf_printf(text, ", %zu of other sizes", others);
}

static void tell_exposures(const struct scene *scene, struct buf *text) {
    size_t told = 0, hdr = 0, count = scene->photograph_count;
    double least = INFINITY, largest = 0.0;
    for (size_t i = 0; i < count; i++) {
        const struct photograph *p = &scene->photograph[i];
        hdr += p->is_hdr;
        if (!p->exposure_known)
            continue;
        told++;
        least = fmin(least, (double)p->exposure);
        largest = fmax(largest, (double)p->exposure);
    }
    if (hdr == count)
        buf_puts(text, "high dynamic range; ");
    else if (hdr > 0)
        buf_printf(text, "%zu of high dynamic range; ", hdr);
    if (told == 0)
        buf_puts(text, "not stated: they are estimated");
    else if (told < count)
        buf_printf(text, "stated for %zu of %zu, ", told, count);
    else
        buf_puts(text, "stated for all, ");
    if (told > 0)
        buf_printf(text, largest > 1.001 * least ? "over %.1f stops" : "the same for all", log2(largest / least));
}

/* --- the mesh -------------------------------------------------------------------------------------------- */

static void tell_mesh(const struct mesh *mesh, struct buf *text) {
    vec3 low, high;
    mesh_bounds(mesh, &low, &high);
    vec3 size = vec3_sub(high, low);
    double diagonal = (double)vec3_length(size);
    buf_printf(text, "%zu triangles, %.4g x %.4g x %.4g m, %.4g m2", mesh->triangle_count, (double)size.x,
               (double)size.y, (double)size.z, mesh_area(mesh));
    if (diagonal > ROOM_MAX)
        buf_puts(text, "; large for a room: is its unit a metre?");
    else if (diagonal < ROOM_MIN)
        buf_puts(text, "; small for a room: is its unit a metre?");
}

static void tell_segments(const struct mesh *mesh, struct buf *text) {
    struct segments segments;
    if (mesh->object_id)
        segments_from_object_id(&segments, mesh);
    else
        segments_automatic(&segments, mesh);
    buf_printf(text, "%zu, %s", segments.count, mesh->object_id ? "the objects of the mesh" : "found in the mesh");
    segments_release(&segments);
}

static uint32_t root_of(uint32_t *parent, uint32_t v) {
    while (parent[v] != v)
        v = parent[v] = parent[parent[v]];
    return v;
}

/* Borders are edges of one triangle only; those that hang together are one hole or rim. */
static void tell_holes(const struct mesh *mesh, struct buf *text) {
    struct adjacency adjacency;
    double length = 0.0;
    size_t count = 0;
    adjacency_make(&adjacency, mesh);
    uint32_t *parent = mem_array(mesh->vertex_count, sizeof *parent);
    bool *is_border = mem_calloc(mesh->vertex_count, sizeof *is_border);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        parent[v] = (uint32_t)v;
    for (size_t h = 0; h < 3 * mesh->triangle_count; h++) {
        if (adjacency.next[h] != h)
            continue;
        uint32_t a = adjacency.weld[mesh->index[h / 3][h % 3]], b = adjacency.weld[mesh->index[h / 3][(h + 1) % 3]];
        is_border[a] = is_border[b] = true;
        parent[root_of(parent, a)] = root_of(parent, b);
        length += (double)vec3_length(vec3_sub(mesh->position[a], mesh->position[b]));
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        count += is_border[v] && parent[v] == v;
    if (count == 0)
        buf_puts(text, "none");
    else
        buf_printf(text, "%zu border%s, %.4g m in all", count, count == 1 ? "" : "s", length);
    mem_free(is_border);
    mem_free(parent);
    adjacency_release(&adjacency);
}

/* --- the job ------------------------------------------------------------------------------------------------ */

static void tell_bytes(double bytes, struct buf *text) {
    if (bytes < 0x1p30)
        buf_printf(text, "%.0f MiB", bytes / 0x1p20);
    else
        buf_printf(text, "%.1f GiB", bytes / 0x1p30);
}

/* Warns, with the texture size that would do. */
static void warn_of_memory(cJSON *facts, const struct scene *scene, double kept, double side, double bytes,
                           double limit) {
    struct buf text;
    double smaller = side;
    while (smaller / 2.0 >= SIDE_MIN && estimate_memory_bytes(scene, kept, smaller) > limit)
        smaller = floor(smaller / 2.0);
    buf_init(&text, 1024);
    buf_printf(&text, "a job with texture_size=%.0f will not fit the memory: it takes about ", side);
    tell_bytes(bytes, &text);
    buf_puts(&text, " of ");
    tell_bytes(limit, &text);
    if (estimate_memory_bytes(scene, kept, smaller) <= limit) {
        buf_printf(&text, "; texture_size=%.0f takes ", smaller);
        tell_bytes(estimate_memory_bytes(scene, kept, smaller), &text);
    } else {
        buf_puts(&text, "; fewer triangles or photographs take less");
    }
    cJSON_AddItemToArray(cJSON_GetObjectItemCaseSensitive(facts, "warnings"), json_new_string(buf_text(&text)));
    buf_release(&text);
}

static void add_job(cJSON *facts, cJSON *table, const struct scene *scene, const struct settings *settings,
                    double memory_limit, struct parallel *pool, struct buf *text) {
    double side = settings_number(settings, "texture_size"), kept = kept_pixels(settings, side);
    double bytes = estimate_memory_bytes(scene, kept, side);
    double sec = estimate_time_sec(scene, settings, pool);
    tell_bytes(bytes, text);
    buf_printf(text, " with texture_size=%.0f", side);
    if (memory_limit > 0.0) {
        buf_puts(text, ", of ");
        tell_bytes(memory_limit, text);
    }
    add_row(table, "memory of a job", text);
    if (sec < 90.0)
        buf_printf(text, "some %.0f seconds", ceil(sec / 10.0) * 10.0);
    else
        buf_printf(text, "some %.0f minutes", ceil(sec / 60.0));
    buf_printf(text, " on %d processor%s", parallel_thread_count(pool), parallel_thread_count(pool) == 1 ? "" : "s");
    add_row(table, "time of a job", text);
    json_add_number(facts, "memory_bytes", floor(bytes));
    json_add_number(facts, "memory_texture_size", side);
    json_add_number(facts, "memory_texel_bytes", ESTIMATE_TEXEL_BYTES);
    json_add_number(facts, "memory_kept_pixels", kept);
    json_add_number(facts, "memory_whole_bytes", floor(estimate_memory_bytes(scene, 0.0, side)));
    json_add_number(facts, "time_sec", sec);
    if (memory_limit > 0.0 && bytes > memory_limit)
        warn_of_memory(facts, scene, kept, side, bytes, memory_limit);
}

void check_table_add(cJSON *facts, const struct scene_check *room, const struct settings *settings, double memory_limit,
                     struct parallel *pool) {
    static const struct {
        const char *label;
        void (*tell)(const struct mesh *, struct buf *);
    } of_mesh[] = {{"mesh", tell_mesh}, {"segments", tell_segments}, {"holes and rims", tell_holes}};
    static const struct {
        const char *label;
        void (*tell)(const struct scene *, struct buf *);
    } of_scene[] = {{"frames used", tell_frames}, {"sizes", tell_sizes}, {"exposures", tell_exposures}};
    const struct scene *scene = &room->scene;
    cJSON *table = cJSON_AddArrayToObject(facts, "table");
    struct buf text;
    buf_init(&text, 4096);
    buf_puts(&text, scene->source ? scene->source : "unknown");
    add_row(table, "source", &text);
    for (size_t i = 0; i < sizeof of_scene / sizeof *of_scene; i++) {
        of_scene[i].tell(scene, &text);
        add_row(table, of_scene[i].label, &text);
    }
    for (size_t i = 0; i < sizeof of_mesh / sizeof *of_mesh; i++) {
        of_mesh[i].tell(&scene->mesh, &text);
        add_row(table, of_mesh[i].label, &text);
    }
    buf_puts(&text, scene->mesh.normal ? "in the file" : "none in the file: they are estimated");
    add_row(table, "normals", &text);
    add_job(facts, table, scene, settings, memory_limit, pool, &text);
    buf_release(&text);
}
