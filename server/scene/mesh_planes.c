/* mesh_planes.c -- see mesh_planes.h. */
#include "server/scene/mesh_planes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/mem.h"

#define UNTRIED (UINT32_MAX - 1) /* part of a triangle that none has reached yet */
#define LIKE 0.9f           /* cosine between the plane's normal and the filtered one of a triangle that lies in it */
#define REACH 1.5f          /* times the noise: so far off may a triangle's corners be */
#define PASSES 3            /* of growing a part; all but the first from the plane of the one before */
#define VERTICES_LEAST 8    /* of a part */
#define TURNED_LITTLE 0.6f  /* cosine: a triangle beside a part that is no other side of an edge */
#define CONTINUED_MOST 0.33 /* share of a part's vertices that have such beside them */
#define NOISE_MOST 1.5      /* times the noise: a part's vertices off its plane, root of the mean square */
#define BOW_MOST 0.2        /* times the noise: what a paraboloid differs by and does not matter, however sure */
#define VERTEX_NOISE 0.5    /* times the noise: of a filtered vertex */
#define PLANES_MOST 8       /* that are heeded at a vertex */

struct growing {
    const struct mesh *mesh;
    const vec3 *measured;        /* [vertex_count] */
    const struct face_normals *faces;
    float noise;
    uint32_t *part;              /* [triangle_count] whose plane a triangle lies in, MESH_PLANES_NONE or UNTRIED */
    uint32_t visit;              /* number of the pass */
    uint32_t *seen;              /* [triangle_count] the last visit */
    uint32_t *reached;           /* [vertex_count] the last visit, of welded vertices */
    size_t triangles, vertices;  /* of the part that grows */
    uint32_t *triangle;          /* [triangle_count] */
    uint32_t *vertex;            /* [vertex_count] welded */
};

/* --- fits --------------------------------------------------------------------------------------- */

/* The plane of the part's vertices, from one that they lie near. False where they do not tell it, which is then as it
 * was. */
static bool fit_plane(const struct growing *g, struct mesh_plane *p, const vec3 *position) {
    struct height_frame f;
    struct height_fit fit;
    height_frame_init(&f, p->frame.normal, position, g->vertex, g->vertices);
    for (int round = 0; round < 2; round++) {
        if (!height_fit(&fit, HEIGHT_PLANE, &f, position, g->vertex, g->vertices))
            return false;
        f.centre = vec3_mad(f.centre, (float)fit.by[0], f.normal);
        vec3 tilted = vec3_mad(f.normal, -(float)(fit.by[1] / f.unit), f.u);
        f.normal = vec3_normalize(vec3_mad(tilted, -(float)(fit.by[2] / f.unit), f.v));
        vec3_frame(f.normal, &f.u, &f.v);
    }
    p->frame = f;
    p->fit = fit;
    return true;
}

/* The variance by which, at most, the three terms that a paraboloid has more seem to be there by chance, in all but one
 * plane of a thousand: chi squared's of vertices as noisy as all, F's of such as are noisier. The latter is a fit to the
 * tables, to 3 % from 10 degrees of freedom on. Vertices of edges are less noisy, across them, than those between. */
static double curved_by_chance(double variance, double rest, double freedom) {
    return 5.42 * fmax(variance, rest * (1.0 + 8.5 / freedom + 45.0 / (freedom * freedom)));
}

/* The share of a part's vertices beyond which the surface goes on, turned by little: of what is plane few do, at holes,
 * while a piece cut from what is round does all around. */
static double share_continued(const struct growing *g, const struct mesh_plane *p) {
    const struct face_normals *f = g->faces;
    size_t count = 0;
    for (size_t i = 0; i < g->vertices; i++) {
        uint32_t v = g->vertex[i];
        bool goes_on = false;
        for (uint32_t k = f->first[v]; k < f->first[v + 1] && !goes_on; k++) {
            uint32_t t = f->triangle[k];
            goes_on = g->seen[t] != g->visit && vec3_dot(f->normal[t], p->frame.normal) > TURNED_LITTLE;
        }
        count += goes_on;
    }
    return (double)count / (double)g->vertices;
}

/* From where the vertices were measured they lie in a plane, which then is the one that fits them best. */
static bool is_plane(const struct growing *g, struct mesh_plane *p) {
    double count = (double)g->vertices, variance = (double)g->noise * (double)g->noise;
    struct height_fit curved;
    if (g->vertices < VERTICES_LEAST || share_continued(g, p) > CONTINUED_MOST || !fit_plane(g, p, g->measured) ||
        p->fit.squares > NOISE_MOST * NOISE_MOST * variance * count ||
        !height_fit(&curved, HEIGHT_PARABOLOID, &p->frame, g->measured, g->vertex, g->vertices))
        return false;
    double bow = fmax(0.0, p->fit.squares - curved.squares), freedom = count - HEIGHT_PARABOLOID;
    return bow < BOW_MOST * BOW_MOST * variance * count ||
           bow / 3.0 < curved_by_chance(variance, curved.squares / freedom, freedom);
}

/* --- growth ------------------------------------------------------------------------------------- */

static uint32_t corner(const struct growing *g, size_t t, int c) {
    return g->faces->weld[g->mesh->index[t][c]];
}

static bool lies_in(const struct growing *g, const struct mesh_plane *p, size_t t) {
    bool near = vec3_dot(g->faces->normal[t], p->frame.normal) > LIKE;
    for (int c = 0; c < 3 && near; c++)
        near = fabs(height_over(&p->frame, g->mesh->position[corner(g, t, c)])) < (double)(REACH * g->noise);
    return near;
}

static void add(struct growing *g, uint32_t t) {
    g->triangle[g->triangles++] = t;
    for (int c = 0; c < 3; c++) {
        uint32_t v = corner(g, t, c);
        if (g->reached[v] == g->visit)
            continue;
        g->reached[v] = g->visit;
        g->vertex[g->vertices++] = v;
    }
}

/* All triangles that are joined to the first by such as lie in the plane, which is fitted again whenever there are twice
 * as many as the last time. */
static void grow(struct growing *g, uint32_t first, struct mesh_plane *p) {
    const struct face_normals *f = g->faces;
    size_t fitted = VERTICES_LEAST / 2;
    g->visit++;
    g->triangles = g->vertices = 0;
    g->seen[first] = g->visit;
    add(g, first);
    for (size_t i = 0; i < g->triangles; i++) {
        for (int c = 0; c < 3; c++) {
            uint32_t v = corner(g, g->triangle[i], c);
            for (uint32_t k = f->first[v]; k < f->first[v + 1]; k++) {
                uint32_t t = f->triangle[k];
                if (g->seen[t] == g->visit || g->part[t] != UNTRIED || !lies_in(g, p, t))
                    continue;
                g->seen[t] = g->visit;
                add(g, t);
            }
        }
        if (g->vertices >= 2 * fitted) {
            fitted = g->vertices;
            fit_plane(g, p, g->mesh->position);
        }
    }
    fit_plane(g, p, g->mesh->position);
}

static bool find_part(struct growing *g, uint32_t first, struct mesh_plane *p) {
    const uint32_t *v = g->mesh->index[first];
    const vec3 *at = g->mesh->position;
    p->frame.centre = vec3_scale(vec3_add(vec3_add(at[v[0]], at[v[1]]), at[v[2]]), 1.0f / 3.0f);
    p->frame.normal = g->faces->normal[first];
    for (int pass = 0; pass < PASSES; pass++)
        grow(g, first, p);
    return is_plane(g, p);
}

/* --- seeds -------------------------------------------------------------------------------------- */

struct seed {
    float rough; /* mean square of what its neighbours' normals differ by */
    uint32_t triangle;
};

static int by_roughness(const void *a, const void *b) {
    const struct seed *x = a, *y = b;
    if (x->rough != y->rough)
        return x->rough < y->rough ? -1 : 1;
    return x->triangle < y->triangle ? -1 : x->triangle > y->triangle;
}

static struct seed *seeds_make(const struct growing *g) {
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

/* Adds that the vertex at `at` lies in the plane to the normal equations of its move, a x = b. */
static void add_plane(const struct mesh_plane *p, vec3 at, double a[3][3], double b[3]) {
    vec3 normal = p->frame.normal;
    double weight = 1.0 / height_variance(&p->fit, &p->frame, at), n[3] = {(double)normal.x, (double)normal.y, (double)normal.z};
    for (int r = 0; r < 3; r++) {
        b[r] -= weight * n[r] * height_over(&p->frame, at);
        for (int c = 0; c <= r; c++)
            a[r][c] += weight * n[r] * n[c];
    }
}

/* The best guess of where a vertex is, from where it is now and the planes it lies in, all with their variances. */
static vec3 place(const struct mesh_planes *planes, const struct mesh *mesh, const struct face_normals *f, uint32_t v) {
    uint32_t part[PLANES_MOST];
    size_t parts = 0;
    vec3 at = mesh->position[v];
    double a[3][3] = {{0.0}}, move[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 3; i++)
        a[i][i] = 1.0 / (VERTEX_NOISE * VERTEX_NOISE);
    for (uint32_t k = f->first[v]; k < f->first[v + 1]; k++) {
        uint32_t other = planes->part[f->triangle[k]];
        size_t known = 0;
        while (known < parts && part[known] != other)
            known++;
        if (other == MESH_PLANES_NONE || known < parts || parts == PLANES_MOST)
            continue;
        part[parts++] = other;
        add_plane(&planes->plane[other], at, a, move);
    }
    if (parts == 0 || !cholesky_factor(3, 3, &a[0][0]))
        return at;
    cholesky_solve(3, 3, &a[0][0], move);
    return vec3_add(at, vec3_make((float)move[0], (float)move[1], (float)move[2]));
}

/* ------------------------------------------------------------------------------------------------ */

void mesh_planes_find(struct mesh_planes *planes, const struct mesh *mesh, const vec3 *measured, float noise_m,
                      const struct face_normals *faces) {
    size_t capacity = 0;
    struct mesh_plane found = {0};
    *planes = (struct mesh_planes){.part = mem_array(mesh->triangle_count, sizeof *planes->part)};
    for (size_t t = 0; t < mesh->triangle_count; t++)
        planes->part[t] = UNTRIED;
    struct growing g = {.mesh = mesh, .measured = measured, .faces = faces, .noise = noise_m, .part = planes->part};
    g.seen = mem_calloc(mesh->triangle_count, sizeof *g.seen);
    g.triangle = mem_array(mesh->triangle_count, sizeof *g.triangle);
    g.reached = mem_calloc(mesh->vertex_count, sizeof *g.reached);
    g.vertex = mem_array(mesh->vertex_count, sizeof *g.vertex);
    struct seed *seed = seeds_make(&g);
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        if (g.part[seed[i].triangle] != UNTRIED)
            continue;
        bool flat = find_part(&g, seed[i].triangle, &found);
        for (size_t k = 0; k < g.triangles; k++)
            g.part[g.triangle[k]] = flat ? (uint32_t)planes->count : MESH_PLANES_NONE;
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
    mem_free(g.reached);
    mem_free(g.triangle);
    mem_free(g.seen);
}

void mesh_planes_release(struct mesh_planes *planes) {
    mem_free(planes->plane);
    mem_free(planes->part);
}

void mesh_planes_flatten(const struct mesh_planes *planes, struct mesh *mesh, const struct face_normals *faces) {
    vec3 *to = mem_array(mesh->vertex_count, sizeof *to);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        to[v] = place(planes, mesh, faces, (uint32_t)v);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->position[v] = to[faces->weld[v]];
    mem_free(to);
}
