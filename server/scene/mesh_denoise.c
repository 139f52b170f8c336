/* mesh_denoise.c -- see mesh_denoise.h. */
#include "server/scene/mesh_denoise.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/scene/face_normals.h"
#include "server/scene/mesh_planes.h"
#include "server/scene/mesh_round.h"

#define CHUNK 1024               /* vertices per work item */
#define CRUMPLED_PASSES 8        /* of averaging over direct neighbours, at most */
#define ROUNDS 3                 /* of filtering normals and then fitting vertices to them */
#define STEPS_PER_ROUND 10       /* fixed-point iterations of the vertex update */
#define CURVED_PASSES 2          /* of smoothing curved surfaces; the first gives them better normals */
#define AVERAGE_PASSES 2         /* of averaging over direct neighbours: reaches about 20 vertices */
#define SHAPE_SIGMA 0.4f         /* of noise: a mean displacement of a neighbourhood below this may be chance */
#define EXCESS_FACTOR 2.5f       /* times the noise variance: a mean square displacement below this may be chance */
#define SAME_SURFACE_COSINE 0.8f /* between normals of neighbours on one surface */

struct denoising {
    const struct face_normals *faces;
    struct mesh *mesh;
    const vec3 *start;   /* [vertex_count] positions before denoising */
    vec3 *normal;        /* [vertex_count] unit vertex normals, from the filtered triangle normals */
    vec3 *next;          /* [vertex_count] */
    float *displacement; /* [vertex_count] along the normal, metres */
    float *value;        /* [vertex_count] input of average(), and its output */
    float *average;      /* [vertex_count] scratch of average() */
    float noise;         /* standard deviation, metres */
};

static size_t chunks_of(const struct mesh *mesh) { return (mesh->vertex_count + CHUNK - 1) / CHUNK; }

/* One past the last vertex of a chunk. */
static size_t chunk_end(const struct mesh *mesh, size_t chunk) {
    size_t end = (chunk + 1) * CHUNK;
    return end < mesh->vertex_count ? end : mesh->vertex_count;
}

static vec3 centre_of(const struct mesh *mesh, size_t t) {
    const uint32_t *v = mesh->index[t];
    vec3 sum = vec3_add(vec3_add(mesh->position[v[0]], mesh->position[v[1]]), mesh->position[v[2]]);
    return vec3_scale(sum, 1.0f / 3.0f);
}

/* Coincident vertices take the position of their representative. */
static void set_positions(struct mesh *mesh, const uint32_t *weld, const vec3 *to) {
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->position[v] = to[weld[v]];
}

/* --- vertices to normals ------------------------------------------------------------------------ */

static void step_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    const struct face_normals *f = d->faces;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        vec3 at = d->mesh->position[v], sum = {0.0f, 0.0f, 0.0f};
        uint32_t count = f->first[v + 1] - f->first[v];
        for (uint32_t i = f->first[v]; i < f->first[v + 1]; i++) {
            vec3 n = f->normal[f->triangle[i]];
            sum = vec3_mad(sum, vec3_dot(n, vec3_sub(centre_of(d->mesh, f->triangle[i]), at)), n);
        }
        d->next[v] = count > 0 ? vec3_mad(at, 1.0f / (float)count, sum) : at;
    }
}

static void fit_vertices_to_normals(struct denoising *d, struct parallel *pool) {
    for (int step = 0; step < STEPS_PER_ROUND; step++) {
        parallel_for(pool, chunks_of(d->mesh), step_chunk, d);
        set_positions(d->mesh, d->faces->weld, d->next);
    }
}

/* --- shape -------------------------------------------------------------------------------------- */

static void measure_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        d->normal[v] = face_normals_at(d->faces, v);
        d->displacement[v] = vec3_dot(d->normal[v], vec3_sub(d->mesh->position[v], d->start[v]));
    }
}

/* Robust standard deviation of the displacements. */
static float displacement_sigma(const struct denoising *d) {
    float *modulus = mem_array(d->mesh->vertex_count, sizeof *modulus);
    size_t count = 0;
    for (size_t v = 0; v < d->mesh->vertex_count; v++) {
        if (d->faces->first[v + 1] > d->faces->first[v])
            modulus[count++] = fabsf(d->displacement[v]);
    }
    float noise = (float)QUANTILE_DEVIATIONS_PER_MAD * quantile(modulus, count, 0.5);
    mem_free(modulus);
    return noise;
}

static void average_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    const struct face_normals *f = d->faces;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        float sum = d->value[v], count = 1.0f;
        for (uint32_t i = f->first[v]; i < f->first[v + 1]; i++) {
            for (int c = 0; c < 3; c++) {
                uint32_t other = f->weld[d->mesh->index[f->triangle[i]][c]];
                if (other == v || vec3_dot(d->normal[v], d->normal[other]) < SAME_SURFACE_COSINE)
                    continue;
                sum += d->value[other];
                count += 1.0f;
            }
        }
        d->average[v] = sum / count;
    }
}

/* Averages d->value over about 20 neighbours on the same surface. */
static void average(struct denoising *d, struct parallel *pool) {
    for (int pass = 0; pass < AVERAGE_PASSES; pass++) {
        parallel_for(pool, chunks_of(d->mesh), average_chunk, d);
        float *averaged = d->average;
        d->average = d->value;
        d->value = averaged;
    }
}

/* Subtracts the mean displacement of the neighbourhood (shrunk towards 0 by what chance explains) and sets `value` to
 * the square of the remainder. */
static void subtract_shape_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    float shape_variance = SHAPE_SIGMA * SHAPE_SIGMA * d->noise * d->noise;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        float mean = d->value[v], square = mean * mean;
        d->displacement[v] -= square > shape_variance ? mean * (1.0f - shape_variance / square) : 0.0f;
        d->value[v] = d->displacement[v] * d->displacement[v];
    }
}

static void apply_wiener_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    float variance = d->noise * d->noise;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        float excess = fmaxf(0.0f, d->value[v] - EXCESS_FACTOR * variance);
        float share = variance > 0.0f ? variance / (variance + excess) : 0.0f;
        d->next[v] = vec3_mad(d->start[v], share * d->displacement[v], d->normal[v]);
    }
}

static void restore_shape(struct denoising *d, struct parallel *pool) {
    memcpy(d->value, d->displacement, d->mesh->vertex_count * sizeof *d->value);
    average(d, pool);
    parallel_for(pool, chunks_of(d->mesh), subtract_shape_chunk, d);
    average(d, pool);
    parallel_for(pool, chunks_of(d->mesh), apply_wiener_chunk, d);
    set_positions(d->mesh, d->faces->weld, d->next);
}

/* ------------------------------------------------------------------------------------------------ */

static void recompute_normals(struct denoising *d, struct face_normals *faces, struct parallel *pool) {
    face_normals_release(faces);
    face_normals_init(faces, d->mesh, pool);
}

/* --- noise as large as triangles ---------------------------------------------------------------- */

static void mean_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct denoising *d = user;
    const struct face_normals *f = d->faces;
    for (size_t v = chunk * CHUNK; v < chunk_end(d->mesh, chunk); v++) {
        vec3 sum = d->mesh->position[v];
        float count = 1.0f;
        for (uint32_t i = f->first[v]; i < f->first[v + 1]; i++) {
            for (int c = 0; c < 3; c++) {
                uint32_t other = f->weld[d->mesh->index[f->triangle[i]][c]];
                sum = other == v ? sum : vec3_add(sum, d->mesh->position[other]);
                count += other != v;
            }
        }
        d->next[v] = vec3_scale(sum, 1.0f / count);
    }
}

/* Moves vertices to the mean of their neighbours until normals tell of the surface again. What is lost at edges the
 * planes bring back, which are fitted to where the vertices were. */
static void average_crumpled(struct denoising *d, struct face_normals *faces, struct parallel *pool) {
    for (int pass = 0; pass < CRUMPLED_PASSES && face_normals_are_crumpled(faces); pass++) {
        parallel_for(pool, chunks_of(d->mesh), mean_chunk, d);
        set_positions(d->mesh, faces->weld, d->next);
        recompute_normals(d, faces, pool);
    }
}

static void denoise_rough(struct denoising *d, struct face_normals *faces, struct parallel *pool) {
    size_t vertices = d->mesh->vertex_count;
    struct mesh_planes planes;
    vec3 *start = mem_array(vertices, sizeof *start);
    memcpy(start, d->mesh->position, vertices * sizeof *start);
    d->start = start;
    d->normal = mem_array(vertices, sizeof *d->normal);
    d->next = mem_array(vertices, sizeof *d->next);
    d->displacement = mem_array(vertices, sizeof *d->displacement);
    d->value = mem_array(vertices, sizeof *d->value);
    d->average = mem_array(vertices, sizeof *d->average);
    average_crumpled(d, faces, pool);
    for (int round = 0; round < ROUNDS; round++) {
        fit_vertices_to_normals(d, pool);
        recompute_normals(d, faces, pool);
    }
    parallel_for(pool, chunks_of(d->mesh), measure_chunk, d);
    d->noise = displacement_sigma(d);
    mesh_planes_find(&planes, d->mesh, start, d->noise, faces);
    restore_shape(d, pool);
    mesh_planes_flatten(&planes, d->mesh, faces);
    mesh_planes_release(&planes);
    recompute_normals(d, faces, pool); /* planes have moved vertices */
    mesh_planes_find(&planes, d->mesh, start, d->noise, faces);
    mesh_planes_flatten(&planes, d->mesh, faces);
    for (int round = 0; round < CURVED_PASSES; round++) {
        recompute_normals(d, faces, pool);
        mesh_round_smooth(d->mesh, start, d->noise, faces, &planes, pool);
    }
    mesh_planes_release(&planes);
    mem_free(d->average);
    mem_free(d->value);
    mem_free(d->displacement);
    mem_free(d->next);
    mem_free(d->normal);
    mem_free(start);
}

float mesh_denoise(struct mesh *mesh, struct parallel *pool) {
    if (mesh->normal)
        return 0.0f;
    struct face_normals faces;
    face_normals_init(&faces, mesh, pool);
    struct denoising denoising = {.faces = &faces, .mesh = mesh};
    if (face_normals_are_noisy(&faces))
        denoise_rough(&denoising, &faces, pool);
    face_normals_release(&faces);
    return denoising.noise;
}
