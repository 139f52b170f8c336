/* mesh_planes.c -- see mesh_planes.h. */
#include "server/scene/mesh_planes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/mem.h"

#define UNASSIGNED (UINT32_MAX - 1) /* region of a triangle that no seed has tried yet */
#define MIN_NORMAL_COSINE 0.9f      /* between the plane's normal and the filtered normal of a triangle in it */
#define MAX_DISTANCE_SIGMA 1.5f     /* of noise: distance of a triangle's vertices from the plane */
#define GROW_PASSES 3               /* each after the first starts from the plane that the one before fitted */
#define MIN_VERTICES 8              /* in a region */
#define CONTINUED_COSINE                                                                                               \
    0.6f                         /* between the plane's normal and that of an adjacent triangle beyond which it is an
                                * edge */
#define MAX_CONTINUED_SHARE 0.33 /* of a region's vertices with such an adjacent triangle outside */
#define MAX_RESIDUAL_SIGMA 1.5   /* of noise: root mean square distance of a region's vertices from its plane */
#define MAX_BOW_SIGMA                                                                                                  \
    0.2                    /* of noise: a paraboloid that fits better by less than this is ignored however
                                  * significant */
#define FILTERED_SIGMA 0.5 /* of noise: standard deviation of a filtered vertex */
#define MAX_PLANES 8       /* that constrain one vertex; further ones are ignored */

struct plane_growth {
    const struct mesh *mesh;
    const vec3 *measured; /* [vertex_count] */
    const struct face_normals *faces;
    float noise;
    uint32_t *region;           /* [triangle_count] plane of a triangle, MESH_PLANES_NONE or UNASSIGNED */
    uint32_t visit;             /* number of the current pass */
    uint32_t *triangle_visit;   /* [triangle_count] last pass that tested the triangle */
    uint32_t *vertex_visit;     /* [vertex_count] last pass that added the welded vertex */
    size_t triangles, vertices; /* in the current region */
    uint32_t *triangle;         /* [triangle_count] */
    uint32_t *vertex;           /* [vertex_count] welded */
};

/* --- fits --------------------------------------------------------------------------------------- */

/* Fits the plane to the region's vertices at `position`, twice, since heights are measured along its normal. False,
 * with *p unchanged, when the vertices are degenerate. */
static bool fit_plane(const struct plane_growth *g, struct mesh_plane *p, const vec3 *position) {
    struct height_frame f;
    struct height_fit fit;
    height_frame_init(&f, p->frame.normal, position, g->vertex, g->vertices);
    for (int round = 0; round < 2; round++) {
        if (!height_fit(&fit, HEIGHT_PLANE, &f, position, g->vertex, g->vertices))
            return false;
        f.centre = vec3_mad(f.centre, (float)fit.coefficient[0], f.normal);
        vec3 tilted = vec3_mad(f.normal, -(float)(fit.coefficient[1] / f.unit), f.u);
        f.normal = vec3_normalize(vec3_mad(tilted, -(float)(fit.coefficient[2] / f.unit), f.v));
        vec3_frame(f.normal, &f.u, &f.v);
    }
    p->frame = f;
    p->fit = fit;
    return true;
}

/* Threshold per degree of freedom for the three extra terms of a paraboloid, at significance 0.001: chi squared where
 * the residuals are within the noise, F otherwise (fitted to tables of F, within 3 % from 10 degrees of freedom on).
 * Vertices on edges are filtered less, so noise alone can make the residuals too large for chi squared. */
static double curvature_threshold(double variance, double residual_variance, double degrees) {
    return 5.42 * fmax(variance, residual_variance * (1.0 + 8.5 / degrees + 45.0 / (degrees * degrees)));
}

/* Share of the region's vertices next to a triangle outside of it that is only slightly tilted. It is low for a
 * planar surface (holes only) and high for a patch cut out of a curved one. */
static double continued_share(const struct plane_growth *g, const struct mesh_plane *p) {
    const struct face_normals *f = g->faces;
    size_t count = 0;
    for (size_t i = 0; i < g->vertices; i++) {
        uint32_t v = g->vertex[i];
        bool continued = false;
        for (uint32_t k = f->first[v]; k < f->first[v + 1] && !continued; k++) {
            uint32_t t = f->triangle[k];
            continued = g->triangle_visit[t] != g->visit && vec3_dot(f->normal[t], p->frame.normal) > CONTINUED_COSINE;
        }
        count += continued;
    }
    return (double)count / (double)g->vertices;
}

/* Fits the plane to the measured positions and tests whether the region is planar. */
static bool accept_plane(const struct plane_growth *g, struct mesh_plane *p) {
    double count = (double)g->vertices, variance = (double)g->noise * (double)g->noise;
    struct height_fit curved;
    if (g->vertices < MIN_VERTICES || continued_share(g, p) > MAX_CONTINUED_SHARE || !fit_plane(g, p, g->measured) ||
        p->fit.residual_squares > MAX_RESIDUAL_SIGMA * MAX_RESIDUAL_SIGMA * variance * count ||
        !height_fit(&curved, HEIGHT_PARABOLOID, &p->frame, g->measured, g->vertex, g->vertices))
        return false;
    double bow_squares = fmax(0.0, p->fit.residual_squares - curved.residual_squares);
    double degrees = count - HEIGHT_PARABOLOID;
    return bow_squares < MAX_BOW_SIGMA * MAX_BOW_SIGMA * variance * count ||
           bow_squares / 3.0 < curvature_threshold(variance, curved.residual_squares / degrees, degrees);
}

/* --- growth ------------------------------------------------------------------------------------- */

static uint32_t corner(const struct plane_growth *g, size_t t, int c) { return g->faces->weld[g->mesh->index[t][c]]; }

static bool is_in_plane(const struct plane_growth *g, const struct mesh_plane *p, size_t t) {
    double limit = (double)(MAX_DISTANCE_SIGMA * g->noise);
    bool is_near = vec3_dot(g->faces->normal[t], p->frame.normal) > MIN_NORMAL_COSINE;
    for (int c = 0; c < 3 && is_near; c++)
        is_near = fabs(height_over(&p->frame, g->mesh->position[corner(g, t, c)])) < limit;
    return is_near;
}

static void add_triangle(struct plane_growth *g, uint32_t t) {
    g->triangle[g->triangles++] = t;
    for (int c = 0; c < 3; c++) {
        uint32_t v = corner(g, t, c);
        if (g->vertex_visit[v] == g->visit)
            continue;
        g->vertex_visit[v] = g->visit;
        g->vertex[g->vertices++] = v;
    }
}

/* Flood fill from triangle `first` over triangles in the plane; refits the plane each time the region has doubled. */
static void grow(struct plane_growth *g, uint32_t first, struct mesh_plane *p) {
    const struct face_normals *f = g->faces;
    size_t fitted = MIN_VERTICES / 2;
    g->visit++;
    g->triangles = g->vertices = 0;
    g->triangle_visit[first] = g->visit;
    add_triangle(g, first);
    for (size_t i = 0; i < g->triangles; i++) {
        for (int c = 0; c < 3; c++) {
            uint32_t v = corner(g, g->triangle[i], c);
            for (uint32_t k = f->first[v]; k < f->first[v + 1]; k++) {
                uint32_t t = f->triangle[k];
                if (g->triangle_visit[t] == g->visit || g->region[t] != UNASSIGNED || !is_in_plane(g, p, t))
                    continue;
                g->triangle_visit[t] = g->visit;
                add_triangle(g, t);
            }
        }
        if (g->vertices >= 2 * fitted) {
            fitted = g->vertices;
            fit_plane(g, p, g->mesh->position);
        }
    }
    fit_plane(g, p, g->mesh->position);
}

static bool grow_plane(struct plane_growth *g, uint32_t first, struct mesh_plane *p) {
    const uint32_t *v = g->mesh->index[first];
    const vec3 *at = g->mesh->position;
    p->frame.centre = vec3_scale(vec3_add(vec3_add(at[v[0]], at[v[1]]), at[v[2]]), 1.0f / 3.0f);
    p->frame.normal = g->faces->normal[first];
    for (int pass = 0; pass < GROW_PASSES; pass++)
        grow(g, first, p);
    return accept_plane(g, p);
}

/* --- seeds -------------------------------------------------------------------------------------- */

struct seed {
    float roughness; /* mean square difference from the adjacent normals */
    uint32_t triangle;
};

static int by_roughness(const void *a, const void *b) {
    const struct seed *x = a, *y = b;
    if (x->roughness != y->roughness)
        return x->roughness < y->roughness ? -1 : 1;
    return x->triangle < y->triangle ? -1 : x->triangle > y->triangle;
}

static struct seed *seeds_make(const struct plane_growth *g) {
    const struct face_normals *f = g->faces;
    struct seed *seed = mem_array(g->mesh->triangle_count, sizeof *seed);
    for (size_t t = 0; t < g->mesh->triangle_count; t++) {
        float sum = 0.0f, count = 0.0f;
        for (int c = 0; c < 3; c++) {
            uint32_t v = corner(g, t, c);
            for (uint32_t k = f->first[v]; k < f->first[v + 1]; k++) {
                vec3 off = vec3_sub(f->normal[f->triangle[k]], f->normal[t]);
                sum += vec3_dot(off, off);
                count += 1.0f;
            }
        }
        seed[t] = (struct seed){sum / count, (uint32_t)t};
    }
    qsort(seed, g->mesh->triangle_count, sizeof *seed, by_roughness);
    return seed;
}

/* --- vertices ----------------------------------------------------------------------------------- */

/* Adds the constraint "the vertex at `at` lies in plane p" to the normal equations a x = b of its displacement x. */
static void add_plane_constraint(const struct mesh_plane *p, vec3 at, double a[3][3], double b[3]) {
    vec3 normal = p->frame.normal;
    double weight = 1.0 / height_variance(&p->fit, &p->frame, at);
    double n[3] = {(double)normal.x, (double)normal.y, (double)normal.z};
    for (int r = 0; r < 3; r++) {
        b[r] -= weight * n[r] * height_over(&p->frame, at);
        for (int c = 0; c <= r; c++)
            a[r][c] += weight * n[r] * n[c];
    }
}

/* Maximum-likelihood position of a vertex from its current position and the planes of its triangles, each weighted by
 * its inverse variance (in units of the noise). */
static vec3 fuse_position(const struct mesh_planes *planes, const struct mesh *mesh, const struct face_normals *f,
                          uint32_t v) {
    uint32_t region[MAX_PLANES];
    size_t region_count = 0;
    vec3 at = mesh->position[v];
    double a[3][3] = {{0.0}}, offset[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 3; i++)
        a[i][i] = 1.0 / (FILTERED_SIGMA * FILTERED_SIGMA);
    for (uint32_t k = f->first[v]; k < f->first[v + 1]; k++) {
        uint32_t other = planes->region[f->triangle[k]];
        size_t known = 0;
        while (known < region_count && region[known] != other)
            known++;
        if (other == MESH_PLANES_NONE || known < region_count || region_count == MAX_PLANES)
            continue;
        region[region_count++] = other;
        add_plane_constraint(&planes->plane[other], at, a, offset);
    }
    if (region_count == 0 || !cholesky_factor(3, 3, &a[0][0]))
        return at;
    cholesky_solve(3, 3, &a[0][0], offset);
    return vec3_add(at, vec3_make((float)offset[0], (float)offset[1], (float)offset[2]));
}

/* ------------------------------------------------------------------------------------------------ */

void mesh_planes_find(struct mesh_planes *planes, const struct mesh *mesh, const vec3 *measured, float noise_m,
                      const struct face_normals *faces) {
    size_t capacity = 0;
    struct mesh_plane found = {0};
    *planes = (struct mesh_planes){.region = mem_array(mesh->triangle_count, sizeof *planes->region)};
    for (size_t t = 0; t < mesh->triangle_count; t++)
        planes->region[t] = UNASSIGNED;
    struct plane_growth g = {.mesh = mesh, .measured = measured, .faces = faces, .noise = noise_m};
    g.region = planes->region;
    g.triangle_visit = mem_calloc(mesh->triangle_count, sizeof *g.triangle_visit);
    g.triangle = mem_array(mesh->triangle_count, sizeof *g.triangle);
    g.vertex_visit = mem_calloc(mesh->vertex_count, sizeof *g.vertex_visit);
    g.vertex = mem_array(mesh->vertex_count, sizeof *g.vertex);
    struct seed *seed = seeds_make(&g);
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        if (g.region[seed[i].triangle] != UNASSIGNED)
            continue;
        bool flat = grow_plane(&g, seed[i].triangle, &found);
        for (size_t k = 0; k < g.triangles; k++)
            g.region[g.triangle[k]] = flat ? (uint32_t)planes->count : MESH_PLANES_NONE;
        if (!flat)
            continue;
        if (planes->count == capacity) {
            capacity = 2 * capacity + 64;
            planes->plane = mem_realloc_array(planes->plane, capacity, sizeof *planes->plane);
        }
        planes->plane[planes->count++] = found;
    }
    mem_free(seed);
    mem_free(g.vertex);
    mem_free(g.vertex_visit);
    mem_free(g.triangle);
    mem_free(g.triangle_visit);
}

void mesh_planes_release(struct mesh_planes *planes) {
    mem_free(planes->plane);
    mem_free(planes->region);
}

void mesh_planes_flatten(const struct mesh_planes *planes, struct mesh *mesh, const struct face_normals *faces) {
    vec3 *to = mem_array(mesh->vertex_count, sizeof *to);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        to[v] = fuse_position(planes, mesh, faces, (uint32_t)v);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->position[v] = to[faces->weld[v]];
    mem_free(to);
}
