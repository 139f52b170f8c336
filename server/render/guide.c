/* guide.c -- see guide.h. */
#include "server/render/guide.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"

#define CELLS_ACROSS 16      /* along the longest side */
#define SURFACE_POINTS 32768 /* by which cells that contain surface are found */
#define POINTS_A_ROW 8       /* from which a row's light is estimated */
#define PATCHES_MAX 256      /* of the emitters; with more there is no guide */
#define ROWS_MAX UINT16_MAX  /* row numbers have 16 bits */
#define POWER_SHARE 0.1f     /* of the samples */
#define HIDDEN_SHARE 0.01f   /* of the squared unoccluded light is assumed to arrive, since a few rays miss gaps */
#define SEED UINT64_C(0x6775696465)

struct guide_point {
    vec3 point, normal;
};

struct guide_builder {
    struct guide *g;
    const struct lights *lights;
    const struct accel *accel;
    struct guide_point *point; /* [row_capacity][POINTS_A_ROW] owned */
    uint8_t *point_count;      /* [row_capacity] owned */
    size_t row_capacity;
};

static float triangle_area(const struct light_triangle *t) {
    return 0.5f * vec3_length(vec3_cross(t->edge1, t->edge2));
}

/* Joins consecutive triangles of one segment, up to the size at which lights_update splits triangles. */
static bool make_patches(struct guide *g, const struct lights *lights) {
    double total = 0.0;
    for (size_t i = 0; i < lights->triangle_count; i++)
        total += (double)triangle_area(&lights->triangle[i]);
    g->first = mem_array(PATCHES_MAX + 1, sizeof *g->first);
    g->patch_of = mem_array(lights->triangle_count, sizeof *g->patch_of);
    double area = 0.0;
    for (size_t i = 0; i < lights->triangle_count; i++) {
        const struct light_triangle *t = &lights->triangle[i];
        double own = (double)triangle_area(t);
        if (i == 0 || t->segment != t[-1].segment || area + own > total / LIGHT_PARTS) {
            if (g->patch_count == PATCHES_MAX)
                return false;
            g->first[g->patch_count++] = (uint32_t)i;
            area = 0.0;
        }
        area += own;
        g->patch_of[i] = (uint16_t)(g->patch_count - 1);
    }
    g->first[g->patch_count] = (uint32_t)lights->triangle_count;
    return true;
}

static void make_grid(struct guide_grid *grid, const struct mesh *mesh) {
    vec3 low = mesh->position[0], high = low;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        vec3 p = mesh->position[i];
        low = (vec3){fminf(low.x, p.x), fminf(low.y, p.y), fminf(low.z, p.z)};
        high = (vec3){fmaxf(high.x, p.x), fmaxf(high.y, p.y), fmaxf(high.z, p.z)};
    }
    vec3 size = vec3_sub(high, low);
    grid->origin = low;
    grid->cells_per_m = CELLS_ACROSS / fmaxf(fmaxf(size.x, size.y), fmaxf(size.z, 1e-6f));
    grid->size[0] = (int32_t)(size.x * grid->cells_per_m) + 1;
    grid->size[1] = (int32_t)(size.y * grid->cells_per_m) + 1;
    grid->size[2] = (int32_t)(size.z * grid->cells_per_m) + 1;
}

static void add_point(struct guide_builder *l, vec3 point, vec3 normal) {
    struct guide *g = l->g;
    uint16_t *row = &g->row[guide_cell(&g->grid, point, normal)];
    if (*row == 0 && g->row_count < ROWS_MAX) {
        if (g->row_count == l->row_capacity) {
            l->row_capacity *= 2;
            l->point = mem_realloc_array(l->point, l->row_capacity * POINTS_A_ROW, sizeof *l->point);
            l->point_count = mem_realloc_array(l->point_count, l->row_capacity, sizeof *l->point_count);
        }
        l->point_count[g->row_count] = 0;
        *row = (uint16_t)g->row_count++;
    }
    uint8_t *count = &l->point_count[*row];
    if (*row > 0 && *count < POINTS_A_ROW)
        l->point[*row * POINTS_A_ROW + (size_t)(*count)++] = (struct guide_point){point, normal};
}

/* Points distributed evenly over all surfaces, each for both sides. */
static void sample_surface(struct guide_builder *l, const struct mesh *mesh) {
    double total = 0.0, until = 0.0;
    for (size_t i = 0; i < mesh->triangle_count; i++)
        total += (double)mesh_triangle_area(mesh, i);
    size_t at = 0;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        vec3 cross = mesh_cross(mesh, i);
        until += 0.5 * (double)vec3_length(cross);
        for (; at < SURFACE_POINTS && ((double)at + 0.5) * total < until * SURFACE_POINTS; at++) {
            uint64_t bits = rng_key(SEED, at, 0);
            float root = sqrtf(rng_to_float((uint32_t)bits)), along = rng_to_float((uint32_t)(bits >> 32));
            vec3 point = mesh_point(mesh, i, root * (1.0f - along), root * along);
            vec3 normal = vec3_normalize(cross);
            add_point(l, point, normal);
            add_point(l, point, vec3_neg(normal));
        }
    }
}

/* Irradiance at a point from a random point of a patch if it is visible, and whether it is. */
static float light_between(const struct guide_builder *l, const struct guide_point *p, size_t patch, uint64_t bits,
                           bool *arrives) {
    const struct guide *g = l->g;
    uint32_t first = g->first[patch], end = g->first[patch + 1];
    uint32_t entry = first + rng_below((uint32_t)rng_mix64(bits), end - first);
    const struct light_triangle *t = &l->lights->triangle[entry];
    float root = sqrtf(rng_to_float((uint32_t)bits)), along = rng_to_float((uint32_t)(bits >> 32));
    vec3 on = vec3_mad(vec3_mad(t->corner, root * (1.0f - along), t->edge1), root * along, t->edge2);
    vec3 cross = vec3_cross(t->edge1, t->edge2), to = vec3_sub(on, p->point);
    float area = 0.5f * vec3_length(cross) * (float)(end - first), distance = vec3_length(to);
    vec3 direction = vec3_scale(to, 1.0f / fmaxf(distance, 1e-20f)), normal = vec3_normalize(cross);
    float emitted = -vec3_dot(direction, normal), received = vec3_dot(direction, p->normal);
    *arrives = false;
    if (!(emitted > 0.0f && received > 0.0f))
        return 0.0f;
    vec3 origin = accel_offset(p->point, p->normal, direction);
    vec3 ray = vec3_sub(accel_offset(on, normal, vec3_neg(direction)), origin);
    float length = vec3_length(ray);
    *arrives = !accel_occluded(l->accel, origin, vec3_scale(ray, 1.0f / fmaxf(length, 1e-20f)), 0.0f, length);
    /* Adding the area avoids the singularity close to the patch. */
    return area * emitted * received / (distance * distance + area);
}

/* Row 0 is by power. */
static void estimate_row(void *user, size_t index, int thread) {
    const struct guide_builder *l = user;
    const struct guide *g = l->g;
    size_t row = index + 1;
    (void)thread;
    for (size_t patch = 0; patch < g->patch_count; patch++) {
        float sum = 0.0f;
        for (size_t i = 0; i < l->point_count[row]; i++) {
            bool arrives;
            float light =
                light_between(l, &l->point[row * POINTS_A_ROW + i], patch, rng_key(SEED + row, patch, i), &arrives);
            sum += light * light * (arrives ? 1.0f : HIDDEN_SHARE);
        }
        /* The density of least variance is proportional to the root mean square. */
        g->transfer[row * g->patch_count + patch] = sqrtf(sum / (float)l->point_count[row]);
    }
}

/* The greatest power of two below count, or 0: the first step of a binary search over `count` entries. */
static size_t first_step(size_t count) {
    size_t step = 0;
    for (size_t next = 1; next < count; next *= 2)
        step = next;
    return step;
}

static void plan_searches(struct guide *g) {
    size_t most = 1, step = first_step(g->patch_count);
    for (size_t p = 0; p < g->patch_count; p++) {
        size_t own = g->first[p + 1] - g->first[p];
        most = own > most ? own : most;
    }
    g->row_step = (int32_t)step;
    g->patch_step = (int32_t)first_step(most);
    g->stride = step > 0 ? 2 * step : 1;
}

struct guide *guide_new(const struct lights *lights, const struct mesh *mesh, const struct accel *accel,
                        struct parallel *pool) {
    if (!(lights->triangles.total > 0.0))
        return NULL;
    struct guide *g = mem_calloc(1, sizeof *g);
    if (!make_patches(g, lights)) {
        guide_free(g);
        return NULL;
    }
    make_grid(&g->grid, mesh);
    g->row =
        mem_calloc(6 * (size_t)g->grid.size[0] * (size_t)g->grid.size[1] * (size_t)g->grid.size[2], sizeof *g->row);
    g->row_count = 1;
    struct guide_builder l = {.g = g, .lights = lights, .accel = accel, .row_capacity = 256};
    l.point = mem_array(l.row_capacity * POINTS_A_ROW, sizeof *l.point);
    l.point_count = mem_calloc(l.row_capacity, sizeof *l.point_count);
    sample_surface(&l, mesh);
    g->transfer = mem_calloc(g->row_count * g->patch_count, sizeof *g->transfer); /* row 0 is by power */
    g->power = mem_array(g->patch_count, sizeof *g->power);
    plan_searches(g);
    g->cumulative = mem_calloc_large(g->row_count * g->stride, sizeof *g->cumulative);
    parallel_for(pool, g->row_count - 1, estimate_row, &l);
    mem_free(l.point);
    mem_free(l.point_count);
    guide_update(g, lights);
    return g;
}

void guide_free(struct guide *g) {
    if (!g)
        return;
    mem_free(g->row);
    mem_free(g->first);
    mem_free(g->patch_of);
    mem_free(g->transfer);
    mem_free(g->power);
    mem_free(g->cumulative);
    mem_free(g);
}

static void make_row(struct guide *g, size_t row, const float *luminance) {
    const float *transfer = g->transfer + row * g->patch_count;
    float *c = g->cumulative + row * g->stride;
    double total = 0.0, sum = 0.0;
    for (size_t p = 0; p < g->patch_count; p++)
        total += (double)(transfer[p] * luminance[p]);
    double by_power = total > 0.0 ? (double)POWER_SHARE : 1.0;
    double by_transfer = total > 0.0 ? (1.0 - by_power) / total : 0.0;
    for (size_t p = 0; p < g->patch_count; p++) {
        sum += by_power * (double)g->power[p] + by_transfer * (double)(transfer[p] * luminance[p]);
        c[p] = (float)sum;
    }
    c[g->patch_count - 1] = 1.0f;
    for (size_t i = g->patch_count; i < g->stride; i++)
        c[i] = INFINITY;
}

void guide_update(struct guide *g, const struct lights *lights) {
    float luminance[PATCHES_MAX];
    for (size_t p = 0; p < g->patch_count; p++) {
        double area = 0.0;
        for (uint32_t i = g->first[p]; i < g->first[p + 1]; i++)
            area += (double)triangle_area(&lights->triangle[i]);
        luminance[p] = rgb_luminance(lights->triangle[g->first[p]].radiance);
        g->power[p] = fmaxf((float)(area * (double)luminance[p] / lights->triangles.total), FLT_MIN);
    }
    for (size_t row = 0; row < g->row_count; row++)
        make_row(g, row, luminance);
}
