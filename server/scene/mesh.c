/* mesh.c -- see mesh.h. */
#include "server/scene/mesh.h"

#include <stdbool.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"

/* Relative height (over the longest edge) below which a triangle has no usable normal in single precision. */
#define MIN_RELATIVE_HEIGHT 1e-7

void mesh_release(struct mesh *mesh) {
    mem_free(mesh->position);
    mem_free(mesh->normal);
    mem_free(mesh->index);
    mem_free(mesh->face);
    mem_free(mesh->object_id);
    mem_free(mesh->uv);
    for (size_t i = 0; i < mesh->name_count; i++)
        mem_free(mesh->name[i]);
    mem_free(mesh->name);
    *mesh = (struct mesh){0};
}

vec3 mesh_cross(const struct mesh *mesh, size_t triangle) {
    const uint32_t *v = mesh->index[triangle];
    vec3 a = mesh->position[v[0]];
    return vec3_cross(vec3_sub(mesh->position[v[1]], a), vec3_sub(mesh->position[v[2]], a));
}

const char *mesh_object_name(const struct mesh *mesh, int64_t object_id) {
    bool has_name = object_id >= 0 && (uint64_t)object_id < mesh->name_count && mesh->name[object_id][0] != '\0';
    return has_name ? mesh->name[object_id] : NULL;
}

double mesh_area(const struct mesh *mesh) {
    double sum = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        sum += (double)mesh_triangle_area(mesh, t);
    return sum;
}

void mesh_reserve(struct mesh *mesh, size_t vertices, size_t triangles) {
    vertices += mesh->vertex_count;
    triangles += mesh->triangle_count;
    mesh->position = mem_realloc_array(mesh->position, vertices, sizeof *mesh->position);
    if (mesh->normal)
        mesh->normal = mem_realloc_array(mesh->normal, vertices, sizeof *mesh->normal);
    mesh->index = mem_realloc_array(mesh->index, triangles, sizeof *mesh->index);
    mesh->face = mem_realloc_array(mesh->face, triangles, sizeof *mesh->face);
    if (mesh->object_id)
        mesh->object_id = mem_realloc_array(mesh->object_id, triangles, sizeof *mesh->object_id);
    if (mesh->uv)
        mesh->uv = mem_realloc_array(mesh->uv, triangles, sizeof *mesh->uv);
}

void mesh_bounds(const struct mesh *mesh, vec3 *lower, vec3 *upper) {
    *lower = (vec3){INFINITY, INFINITY, INFINITY};
    *upper = vec3_neg(*lower);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (int c = 0; c < 3; c++) {
            vec3 p = mesh->position[mesh->index[t][c]];
            *lower = (vec3){fminf(lower->x, p.x), fminf(lower->y, p.y), fminf(lower->z, p.z)};
            *upper = (vec3){fmaxf(upper->x, p.x), fmaxf(upper->y, p.y), fmaxf(upper->z, p.z)};
        }
    }
}

/* The least power of two that is at least twice count: slots of an open-addressing table. */
static size_t table_size(size_t count) {
    size_t size = 16;
    while (size < 2 * count)
        size *= 2;
    return size;
}

static uint32_t float_bits(float value) {
    value += 0.0f; /* -0 and 0 are one position */
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

uint32_t *mesh_weld(const struct mesh *mesh) {
    uint32_t *weld = mem_array(mesh->vertex_count, sizeof *weld);
    size_t size = table_size(mesh->vertex_count);
    uint32_t *table = mem_array(size, sizeof *table);
    memset(table, 0xff, size * sizeof *table);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh->position[v];
        size_t slot = rng_key(float_bits(p.x), float_bits(p.y), float_bits(p.z)) & (size - 1);
        while (table[slot] != UINT32_MAX) {
            vec3 q = mesh->position[table[slot]];
            if (p.x == q.x && p.y == q.y && p.z == q.z)
                break;
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] == UINT32_MAX)
            table[slot] = (uint32_t)v;
        weld[v] = table[slot];
    }
    mem_free(table);
    return weld;
}

static enum status check_input(const struct mesh *mesh, const char *name, struct error *err) {
    if (mesh->triangle_count == 0)
        return error_set(err, STATUS_INPUT, "mesh %s: it has no faces", name);
    if (mesh->triangle_count > MESH_MAX_TRIANGLES || mesh->vertex_count >= UINT32_MAX)
        return error_set(err, STATUS_INPUT,
                         "mesh %s: %zu triangles and %zu vertices, at most %zu "
                         "and %u can be used",
                         name, mesh->triangle_count, mesh->vertex_count, MESH_MAX_TRIANGLES, UINT32_MAX - 1);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            if (mesh->index[t][c] >= mesh->vertex_count)
                return error_set(err, STATUS_INPUT,
                                 "mesh %s: face %u: vertex index %u, but there "
                                 "are %zu vertices",
                                 name, mesh->face[t], mesh->index[t][c], mesh->vertex_count);
    return STATUS_OK;
}

static bool is_usable(vec3 p) {
    return vec3_is_finite(p) && fmaxf(fabsf(p.x), fmaxf(fabsf(p.y), fabsf(p.z))) <= MESH_MAX_COORDINATE_M;
}

static enum status unusable_vertex(const struct mesh *mesh, const char *name, size_t vertex, struct error *err) {
    vec3 p = mesh->position[vertex];
    if (!vec3_is_finite(p))
        return error_set(err, STATUS_INPUT, "mesh %s: vertex %zu: a coordinate is not a finite number", name, vertex);
    return error_set(err, STATUS_INPUT, "mesh %s: vertex %zu at (%g, %g, %g) is farther than %g m from the origin",
                     name, vertex, mesh->offset[0] + (double)p.x, mesh->offset[1] + (double)p.y,
                     mesh->offset[2] + (double)p.z, (double)MESH_MAX_COORDINATE_M);
}

/* Drops the unusable vertices, none of which a triangle may use, and renumbers the others. */
static void drop_vertices(struct mesh *mesh) {
    uint32_t *number = mem_array(mesh->vertex_count, sizeof *number);
    size_t kept = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        number[v] = (uint32_t)kept;
        if (!is_usable(mesh->position[v]))
            continue;
        mesh->position[kept] = mesh->position[v];
        if (mesh->normal)
            mesh->normal[kept] = mesh->normal[v];
        kept++;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            mesh->index[t][c] = number[mesh->index[t][c]];
    mesh->vertex_count = kept;
    mem_free(number);
}

/* Files of some programs have vertices without coordinates that no face uses. */
static enum status check_vertices(struct mesh *mesh, const char *name, struct mesh_report *report, struct error *err) {
    size_t unusable = 0, worst = SIZE_MAX;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        unusable += !is_usable(mesh->position[v]);
    if (unusable == 0)
        return STATUS_OK;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            uint32_t v = mesh->index[t][c];
            if (v < worst && !is_usable(mesh->position[v]))
                worst = v;
        }
    if (worst != SIZE_MAX)
        return unusable_vertex(mesh, name, worst, err);
    drop_vertices(mesh);
    report->unused_count = unusable;
    return STATUS_OK;
}

static bool is_degenerate(const struct mesh *mesh, size_t triangle) {
    const uint32_t *v = mesh->index[triangle];
    double longest = 0.0; /* squared; in double: the squares of tiny floats vanish */
    double edge[3][3];
    for (int c = 0; c < 3; c++) {
        vec3 a = mesh->position[v[c]], b = mesh->position[v[(c + 1) % 3]];
        edge[c][0] = (double)b.x - (double)a.x;
        edge[c][1] = (double)b.y - (double)a.y;
        edge[c][2] = (double)b.z - (double)a.z;
        longest = fmax(longest, edge[c][0] * edge[c][0] + edge[c][1] * edge[c][1] + edge[c][2] * edge[c][2]);
    }
    double x = edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1];
    double y = edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2];
    double z = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
    if (!(vec3_length(mesh_cross(mesh, triangle)) > 0.0f)) /* normals are divided by this length */
        return true;
    return sqrt(x * x + y * y + z * z) <= MIN_RELATIVE_HEIGHT * longest;
}

/* The welded corners in ascending order: the same for every winding and start. */
static void sorted_corners(const struct mesh *mesh, const uint32_t *weld, size_t triangle, uint32_t corner[3]) {
    for (int c = 0; c < 3; c++) {
        uint32_t v = weld[mesh->index[triangle][c]];
        int place = c;
        for (; place > 0 && corner[place - 1] > v; place--)
            corner[place] = corner[place - 1];
        corner[place] = v;
    }
}

void mesh_move_triangle(struct mesh *mesh, size_t from, size_t to) {
    memmove(mesh->index[to], mesh->index[from], sizeof *mesh->index);
    mesh->face[to] = mesh->face[from];
    if (mesh->object_id)
        mesh->object_id[to] = mesh->object_id[from];
    if (mesh->uv)
        memmove(mesh->uv[to], mesh->uv[from], sizeof *mesh->uv);
}

void mesh_turn_triangle(struct mesh *mesh, size_t triangle) {
    uint32_t *v = mesh->index[triangle], second = v[1];
    v[1] = v[2];
    v[2] = second;
    if (mesh->uv) {
        vec2 *uv = mesh->uv[triangle], second_uv = uv[1];
        uv[1] = uv[2];
        uv[2] = second_uv;
    }
}

static void drop_unfit(struct mesh *mesh, struct mesh_report *report) {
    uint32_t *weld = mesh_weld(mesh);
    size_t size = table_size(mesh->triangle_count);
    uint32_t *table = mem_array(size, sizeof *table); /* kept triangles, by their corners */
    memset(table, 0xff, size * sizeof *table);
    size_t kept = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (is_degenerate(mesh, t)) {
            report->degenerate_count++;
            continue;
        }
        uint32_t corner[3], other[3];
        sorted_corners(mesh, weld, t, corner);
        size_t slot = rng_key(corner[0], corner[1], corner[2]) & (size - 1);
        while (table[slot] != UINT32_MAX) {
            sorted_corners(mesh, weld, table[slot], other);
            if (memcmp(corner, other, sizeof corner) == 0)
                break;
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] != UINT32_MAX) {
            report->duplicate_count++;
            continue;
        }
        table[slot] = (uint32_t)kept;
        mesh_move_triangle(mesh, t, kept);
        kept++;
    }
    mesh->triangle_count = kept;
    mem_free(table);
    mem_free(weld);
}

static void repair_normals(struct mesh *mesh) {
    size_t bad = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        vec3 n = mesh->normal[v];
        /* Scaled first, so that squares neither overflow nor underflow. */
        float largest = fmaxf(fabsf(n.x), fmaxf(fabsf(n.y), fabsf(n.z)));
        if (!vec3_is_finite(n) || !(largest > 0.0f)) {
            mesh->normal[v] = (vec3){0.0f, 0.0f, 0.0f};
            bad++;
            continue;
        }
        mesh->normal[v] = vec3_normalize((vec3){n.x / largest, n.y / largest, n.z / largest});
    }
    if (bad == 0)
        return;
    vec3 *sum = mem_calloc(mesh->vertex_count, sizeof *sum);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            sum[mesh->index[t][c]] = vec3_add(sum[mesh->index[t][c]], mesh_cross(mesh, t));
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        vec3 n = mesh->normal[v];
        if (n.x == 0.0f && n.y == 0.0f && n.z == 0.0f) {
            vec3 mean = vec3_normalize(sum[v]);
            /* an unused vertex, or faces that cancel out: any unit vector serves */
            mesh->normal[v] = vec3_length(mean) > 0.5f ? mean : (vec3){0.0f, 0.0f, 1.0f};
        }
    }
    mem_free(sum);
}

enum status mesh_check(struct mesh *mesh, const char *name, struct mesh_report *report, struct error *err) {
    struct mesh_report found = {0};
    enum status status = check_input(mesh, name, err);
    if (status == STATUS_OK)
        status = check_vertices(mesh, name, &found, err);
    if (status != STATUS_OK)
        return status;
    drop_unfit(mesh, &found);
    if (report)
        *report = found;
    if (mesh->triangle_count == 0)
        return error_set(err, STATUS_INPUT, "mesh %s: none of its %zu faces has an area", name, mesh->face_count);
    if (mesh->normal)
        repair_normals(mesh);
    return STATUS_OK;
}
