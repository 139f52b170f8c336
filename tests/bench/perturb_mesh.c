/* perturb_mesh IN.ply OUT.ply EDGE NOISE KEEP -- spoils the geometry of a known room as a scanner
 * would, for Table 1 of the paper (see paper.sh).
 *
 * EDGE   longest edge in metres: longer ones are halved first, since a wall of two triangles has
 *        no vertices to displace or to drop; within planes what comes of it is made well-shaped,
 *        as a scanner's triangles are
 * NOISE  metres: each vertex moves along its normal by a normally distributed distance of this
 *        standard deviation, always the same ones for a mesh
 * KEEP   share of the triangles that is kept, object by object, by quadric edge collapse
 *        (meshoptimizer, after Garland & Heckbert 1997)
 *
 * Coincident vertices are one, so no cracks open, and shading normals are dropped, so that they
 * cannot tell of the surface that was there before. Exit status 77: built without meshoptimizer, and
 * KEEP is not 1. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if __has_include(<meshoptimizer.h>)
#include <meshoptimizer.h>
#define CAN_DECIMATE true
#else
#define CAN_DECIMATE false
#endif

#include "common/mem.h"
#include "common/rng.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/scene/adjacency.h"
#include "server/scene/mesh.h"

/* Makes all triangles use the first of coincident vertices. */
static void weld(struct mesh *mesh) {
    uint32_t *first = mesh_weld(mesh);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            mesh->index[t][k] = first[mesh->index[t][k]];
    mem_free(first);
}

static uint32_t add_middle(struct mesh *mesh, uint32_t a, uint32_t b) {
    /* The sum is the same bits from either side of the edge: the next weld finds them. */
    mesh->position[mesh->vertex_count] = vec3_scale(vec3_add(mesh->position[a], mesh->position[b]), 0.5f);
    return (uint32_t)mesh->vertex_count++;
}

static void add_triangle(struct mesh *mesh, size_t like, uint32_t a, uint32_t b, uint32_t c) {
    memcpy(mesh->index[mesh->triangle_count], (uint32_t[3]){a, b, c}, sizeof *mesh->index);
    mesh->object_id[mesh->triangle_count++] = mesh->object_id[like];
}

/* Halves the marked edges of triangle t, which is cut into two, three or four. */
static void split_triangle(struct mesh *mesh, size_t t, const bool *marked) {
    uint32_t v[3], m[3];
    memcpy(v, mesh->index[t], sizeof v);
    const bool *cut = marked + 3 * t;
    int cuts = cut[0] + cut[1] + cut[2];
    if (cuts == 0)
        return;
    /* Turned so that with one cut it is the first edge, and with two the last is whole. */
    int turn = 0;
    while (!(cut[turn] && (cuts == 1 || cut[(turn + 1) % 3])))
        turn++;
    uint32_t a = v[turn], b = v[(turn + 1) % 3], c = v[(turn + 2) % 3];
    m[0] = add_middle(mesh, a, b);
    if (cuts == 1) {
        memcpy(mesh->index[t], (uint32_t[3]){a, m[0], c}, sizeof *mesh->index);
        add_triangle(mesh, t, m[0], b, c);
        return;
    }
    m[1] = add_middle(mesh, b, c);
    add_triangle(mesh, t, m[0], b, m[1]);
    if (cuts == 2) {
        memcpy(mesh->index[t], (uint32_t[3]){a, m[0], m[1]}, sizeof *mesh->index);
        add_triangle(mesh, t, a, m[1], c);
        return;
    }
    m[2] = add_middle(mesh, c, a);
    memcpy(mesh->index[t], (uint32_t[3]){m[0], m[1], m[2]}, sizeof *mesh->index);
    add_triangle(mesh, t, a, m[0], m[2]);
    add_triangle(mesh, t, m[2], m[1], c);
}

static vec3 corner(const struct mesh *mesh, size_t half_edge) {
    return mesh->position[mesh->index[half_edge / 3][half_edge % 3]];
}

static float edge_length(const struct mesh *mesh, size_t half_edge) {
    size_t t = half_edge / 3, e = half_edge % 3;
    return vec3_length(vec3_sub(corner(mesh, 3 * t + (e + 1) % 3), corner(mesh, half_edge)));
}

/* The angle of a triangle that lies opposite a half-edge. */
static float angle_opposite(const struct mesh *mesh, size_t half_edge) {
    size_t t = half_edge / 3, e = half_edge % 3;
    vec3 apex = corner(mesh, 3 * t + (e + 2) % 3);
    vec3 a = vec3_sub(corner(mesh, half_edge), apex), b = vec3_sub(corner(mesh, 3 * t + (e + 1) % 3), apex);
    return atan2f(vec3_length(vec3_cross(a, b)), vec3_dot(a, b));
}

/* Two triangles of one object meet at the edge and lie in one plane. */
static bool is_inner(const struct mesh *mesh, const struct adjacency *adjacency, size_t half_edge) {
    size_t other = adjacency->next[half_edge], t = half_edge / 3, u = other / 3;
    return other != half_edge && adjacency->next[other] == half_edge && mesh->object_id[t] == mesh->object_id[u] &&
           mesh->index[t][half_edge % 3] == mesh->index[u][(other % 3 + 1) % 3] &&
           vec3_dot(vec3_normalize(mesh_cross(mesh, t)), vec3_normalize(mesh_cross(mesh, u))) > 0.99999f;
}

/* Within planes the triangles of Delaunay (1934), by flips of edges: no slivers where a narrow strip was cut. */
static void flip_edges(struct mesh *mesh) {
    for (bool more = true; more;) {
        struct adjacency adjacency;
        bool *touched = mem_calloc(mesh->triangle_count, sizeof *touched);
        adjacency_make(&adjacency, mesh);
        more = false;
        for (size_t h = 0; h < 3 * mesh->triangle_count; h++) {
            size_t other = adjacency.next[h], t = h / 3, u = other / 3;
            if (touched[t] || touched[u] || !is_inner(mesh, &adjacency, h) ||
                angle_opposite(mesh, h) + angle_opposite(mesh, other) < 3.1417f)
                continue;
            const uint32_t *v = mesh->index[t], *w = mesh->index[u];
            uint32_t a = v[h % 3], b = v[(h % 3 + 1) % 3], c = v[(h % 3 + 2) % 3], d = w[(other % 3 + 2) % 3];
            memcpy(mesh->index[t], (uint32_t[3]){a, d, c}, sizeof *mesh->index);
            memcpy(mesh->index[u], (uint32_t[3]){d, b, c}, sizeof *mesh->index);
            more = touched[t] = touched[u] = true;
        }
        adjacency_release(&adjacency);
        mem_free(touched);
    }
}

static bool is_longest(const struct mesh *mesh, size_t half_edge) {
    size_t first = half_edge - half_edge % 3;
    float length = edge_length(mesh, half_edge);
    return length >= edge_length(mesh, first) && length >= edge_length(mesh, first + 1) &&
           length >= edge_length(mesh, first + 2);
}

/* Marks, [3 * triangle_count] by half-edges, those longer than `edge`: creases and outlines first; where none of those
 * is left, within planes what is the longest of both its triangles. False where there is none at all. */
static bool mark_edges(const struct mesh *mesh, float edge, bool *marked) {
    struct adjacency adjacency;
    bool any = false;
    adjacency_make(&adjacency, mesh);
    for (int inner = 0; inner < 2 && !any; inner++) {
        for (size_t h = 0; h < 3 * mesh->triangle_count; h++) {
            marked[h] = edge_length(mesh, h) > edge && is_inner(mesh, &adjacency, h) == inner &&
                        (!inner || (is_longest(mesh, h) && is_longest(mesh, adjacency.next[h])));
            any = any || marked[h];
        }
    }
    adjacency_release(&adjacency);
    return any;
}

static void split(struct mesh *mesh, float edge) {
    bool *marked = mem_array(3 * mesh->triangle_count, sizeof *marked);
    while (mark_edges(mesh, edge, marked)) {
        size_t before = mesh->triangle_count;
        mesh->position = mem_realloc_array(mesh->position, mesh->vertex_count + 3 * before, sizeof *mesh->position);
        mesh->index = mem_realloc_array(mesh->index, 4 * before, sizeof *mesh->index);
        mesh->object_id = mem_realloc_array(mesh->object_id, 4 * before, sizeof *mesh->object_id);
        for (size_t t = 0; t < before; t++)
            split_triangle(mesh, t, marked);
        weld(mesh);
        flip_edges(mesh);
        marked = mem_realloc_array(marked, 3 * mesh->triangle_count, sizeof *marked);
    }
    mem_free(marked);
}

/* A draw from the normal distribution (Box & Muller 1958). */
static float normal_draw(uint64_t number) {
    uint64_t bits = rng_key(number, 0, 0);
    float u = 1.0f - rng_to_float((uint32_t)bits), v = rng_to_float((uint32_t)(bits >> 32));
    return sqrtf(-2.0f * logf(u)) * cosf(6.2831853f * v);
}

static void displace(struct mesh *mesh, float deviation_m) {
    vec3 *normal = mem_calloc(mesh->vertex_count, sizeof *normal);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            normal[mesh->index[t][k]] = vec3_add(normal[mesh->index[t][k]], mesh_cross(mesh, t));
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        float length = vec3_length(normal[v]);
        if (length > 0.0f)
            mesh->position[v] = vec3_mad(mesh->position[v], deviation_m * normal_draw(v) / length, normal[v]);
    }
    mem_free(normal);
}

#if CAN_DECIMATE
static int by_object(const void *a, const void *b) {
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void decimate(struct mesh *mesh, float keep) {
    size_t count = mesh->triangle_count, kept = 0;
    int64_t *object = mem_array(count, sizeof *object);
    uint32_t(*from)[3] = mem_array(count, sizeof *from), (*to)[3] = mem_array(count, sizeof *to);
    uint32_t(*out)[3] = mem_array(count, sizeof *out);
    int64_t *out_object = mem_array(count, sizeof *out_object);
    memcpy(object, mesh->object_id, count * sizeof *object);
    qsort(object, count, sizeof *object, by_object);
    for (size_t i = 0; i < count; i++) {
        size_t of_object = 0;
        if (i > 0 && object[i] == object[i - 1])
            continue;
        for (size_t t = 0; t < count; t++)
            if (mesh->object_id[t] == object[i])
                memcpy(from[of_object++], mesh->index[t], sizeof *from);
        size_t wanted = (size_t)(keep * (float)of_object);
        size_t left = meshopt_simplify(&to[0][0], &from[0][0], 3 * of_object, &mesh->position[0].x, mesh->vertex_count,
                                       sizeof *mesh->position, 3 * wanted, 1.0f, 0, NULL) /
                      3;
        memcpy(out[kept], to, left * sizeof *to);
        for (size_t t = 0; t < left; t++)
            out_object[kept++] = object[i];
    }
    memcpy(mesh->index, out, kept * sizeof *out);
    memcpy(mesh->object_id, out_object, kept * sizeof *out_object);
    mesh->triangle_count = kept;
    mem_free(out_object);
    mem_free(out);
    mem_free(to);
    mem_free(from);
    mem_free(object);
}
#else
static void decimate(struct mesh *mesh, float keep) { (void)mesh, (void)keep; }
#endif

static bool write_ply(const char *path, const struct mesh *mesh) {
    FILE *file = fopen(path, "w");
    if (!file)
        return false;
    fprintf(file,
            "ply\nformat ascii 1.0\nelement vertex %zu\nproperty float x\nproperty float y\nproperty float z\n"
            "element face %zu\nproperty list uchar int vertex_indices\nproperty int object_id\nend_header\n",
            mesh->vertex_count, mesh->triangle_count);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        fprintf(file, "%.9g %.9g %.9g\n", (double)mesh->position[v].x, (double)mesh->position[v].y,
                (double)mesh->position[v].z);
    for (size_t t = 0; t < mesh->triangle_count; t++)
        fprintf(file, "3 %u %u %u %lld\n", mesh->index[t][0], mesh->index[t][1], mesh->index[t][2],
                (long long)mesh->object_id[t]);
    return fclose(file) == 0;
}

int main(int argc, char **argv) {
    if (argc != 6) {
        fprintf(stderr, "usage: perturb_mesh IN.ply OUT.ply EDGE NOISE KEEP\n");
        return 2;
    }
    float edge = strtof(argv[3], NULL), noise = strtof(argv[4], NULL), keep = strtof(argv[5], NULL);
    struct mesh mesh;
    struct error err;
    if (!CAN_DECIMATE && keep < 1.0f) {
        fprintf(stderr, "perturb_mesh: built without libmeshoptimizer-dev: cannot decimate\n");
        return 77;
    }
    if (!(edge > 0.0f) || mesh_file_read(argv[1], argv[1], MESH_MAX_TRIANGLES, &mesh, NULL, &err) != STATUS_OK ||
        !mesh.object_id) {
        fprintf(stderr, "perturb_mesh: %s: not a mesh with object_id, or EDGE is not positive\n", argv[1]);
        return 1;
    }
    weld(&mesh);
    split(&mesh, edge);
    if (noise > 0.0f)
        displace(&mesh, noise);
    if (keep < 1.0f)
        decimate(&mesh, keep);
    printf("%zu triangles\n", mesh.triangle_count);
    bool written = write_ply(argv[2], &mesh);
    mesh_release(&mesh);
    return written ? 0 : 1;
}
