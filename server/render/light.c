/* light.c -- see light.h. */
#include "server/render/light.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"

#define GUIDE_DENSITY 4       /* starting points per entry of a table */
#define MAX_BLOCK_COLUMNS 512 /* of the table of blocks: 512 x 256 entries are 512 KiB, which a core's cache holds */
/* Lower bound of a direction's visibility, as a fraction of the mean over the light. */
#define MIN_VISIBILITY 0.1
/* Minimum share of samples of the environment and of the emitters. */
#define MIN_TECHNIQUE_CHANCE 0.05f

/* weight[count] >= 0; if all are 0 there is no table. */
static void table_make(struct light_table *t, size_t count, const float *weight) {
    t->total = 0.0;
    for (size_t i = 0; i < count; i++)
        t->total += (double)weight[i];
    if (!(t->total > 0.0))
        return;
    t->count = count;
    t->cumulative = mem_array(count + 1 + LIGHT_TABLE_PAD, sizeof *t->cumulative);
    t->guide_count = count * GUIDE_DENSITY;
    t->guide = mem_array(t->guide_count, sizeof *t->guide);
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        t->cumulative[i] = (float)(sum / t->total);
        sum += weight[i];
    }
    /* Trailing entries of weight 0 must have an empty range. */
    t->cumulative[count] = 1.0f;
    for (size_t i = 1; i <= LIGHT_TABLE_PAD; i++)
        t->cumulative[count + i] = INFINITY;
    for (size_t i = count; i-- > 0 && weight[i] == 0.0f;)
        t->cumulative[i] = 1.0f;
    size_t entry = 0;
    for (size_t i = 0; i < t->guide_count; i++) {
        while (entry + 1 < count && (double)t->cumulative[entry + 1] * (double)t->guide_count <= (double)i)
            entry++;
        t->guide[i] = (uint32_t)entry;
    }
}

static void table_release(struct light_table *t) {
    mem_free(t->cumulative);
    mem_free(t->guide);
    memset(t, 0, sizeof *t);
}

/* Copies the pixels; the first column is repeated at the end. */
static void take_pixels(struct lights *l, const struct image *environment) {
    size_t stride = (size_t)l->width + 1;
    l->environment = mem_array(stride * l->height, sizeof *l->environment);
    for (size_t y = 0; y < l->height; y++) {
        for (size_t x = 0; x < stride; x++) {
            const float *pixel = environment->pixel + (y * l->width + x % l->width) * environment->channel_count;
            for (int c = 0; c < 3; c++)
                l->environment[y * stride + x][c] = isfinite(pixel[c]) && pixel[c] > 0.0f ? pixel[c] : 0.0f;
        }
    }
}

/* Mean luminance of a cell. */
static float cell_luminance(const struct lights *l, size_t x, size_t y) {
    size_t stride = (size_t)l->width + 1;
    float sum = 0.0f;
    for (size_t k = 0; k < 4; k++) {
        const float *p = l->environment[(y + k / 2) * stride + x + k % 2];
        sum += rgb_luminance((rgb){p[0], p[1], p[2]});
    }
    return 0.25f * sum;
}

/* Visibility of a cell of the map. */
static float cell_visibility(const struct lights *l, const struct visibility *visibility, size_t x, size_t y) {
    struct latlong middle = {((double)x + 1.0) / l->width, ((double)y + 0.5) / (l->height - 1)};
    return visibility ? visibility_at(visibility, middle) : 1.0f;
}

/* Number of cells across a block. */
static uint32_t block_width(const struct lights *l, uint32_t block) {
    uint32_t left = l->width - block % l->block_columns * l->grain;
    return left < l->grain ? left : l->grain;
}

static uint32_t block_height(const struct lights *l, uint32_t block) {
    uint32_t left = l->height - 1 - block / l->block_columns * l->grain;
    return left < l->grain ? left : l->grain;
}

static void make_blocks(struct lights *l, const struct visibility *visibility) {
    l->grain = (l->width + MAX_BLOCK_COLUMNS - 1) / MAX_BLOCK_COLUMNS;
    l->block_columns = (l->width + l->grain - 1) / l->grain;
    size_t block_count = (size_t)l->block_columns * ((l->height - 2) / l->grain + 1);
    float *weight = mem_calloc(block_count, sizeof *weight);
    double shines = 0.0, arrives = 0.0;
    /* The second pass raises the visibility of directions that no ray of the estimate found open. */
    for (int pass = 0; pass < 2; pass++) {
        float least = arrives > 0.0 ? (float)(MIN_VISIBILITY * arrives / shines) : 1.0f;
        for (uint32_t y = 0; y + 1 < l->height; y++) {
            float angle = (float)latlong_cell_angle(l->width, l->height, y);
            for (uint32_t x = 0; x < l->width; x++) {
                float light = angle * cell_luminance(l, x, y), share = cell_visibility(l, visibility, x, y);
                if (pass == 1)
                    weight[y / l->grain * l->block_columns + x / l->grain] += light * fmaxf(least, share);
                shines += pass == 0 ? (double)light : 0.0;
                arrives += pass == 0 ? (double)(light * share) : 0.0;
            }
        }
    }
    l->environment_power = visibility ? arrives * visibility->area : -1.0;
    table_make(&l->blocks, block_count, weight);
    mem_free(weight);
}

static float chance_of_environment(const struct lights *l) {
    double emitter_power = PI * l->triangles.total;
    if (!(l->blocks.total > 0.0))
        return 0.0f;
    if (!(emitter_power > 0.0))
        return 1.0f;
    if (l->environment_power < 0.0)
        return 0.5f;
    double share = l->environment_power / (l->environment_power + emitter_power);
    return clampf((float)share, MIN_TECHNIQUE_CHANCE, 1.0f - MIN_TECHNIQUE_CHANCE);
}

/* Updates the probability of environment against emitters after either changed. */
static void share_samples(struct lights *l) {
    l->environment_chance = chance_of_environment(l);
    if (!(l->triangles.total > 0.0))
        return;
    for (size_t s = 0; s < l->segment_count; s++)
        l->area_density[s] = (float)((1.0 - (double)l->environment_chance) *
                                     fmax(0.0, (double)rgb_luminance(l->emission[s])) / l->triangles.total);
    for (size_t i = 0; i < l->triangle_count; i++)
        l->triangle[i].density = l->area_density[l->triangle[i].segment];
}

void lights_set_environment(struct lights *l, const struct image *environment, const struct visibility *visibility) {
    table_release(&l->blocks);
    mem_free(l->environment);
    l->environment = NULL;
    l->width = l->height = 0;
    if (environment && environment->height >= 2) {
        assert(environment->channel_count >= 3);
        l->width = environment->width;
        l->height = environment->height;
        take_pixels(l, environment);
        make_blocks(l, visibility);
    }
    share_samples(l);
}

struct lights *lights_new(const struct image *environment) {
    struct lights *l = mem_calloc(1, sizeof *l);
    lights_set_environment(l, environment, NULL);
    return l;
}

static void release_triangles(struct lights *l) {
    mem_free(l->triangle);
    mem_free(l->emission);
    mem_free(l->area_density);
    mem_free(l->first_of);
    table_release(&l->triangles);
    l->triangle = NULL;
    l->emission = NULL;
    l->area_density = NULL;
    l->first_of = NULL;
    l->triangle_count = 0;
}

void lights_free(struct lights *l) {
    if (!l)
        return;
    release_triangles(l);
    table_release(&l->blocks);
    mem_free(l->environment);
    mem_free(l);
}

static float cross_area(vec3 edge1, vec3 edge2) { return 0.5f * vec3_length(vec3_cross(edge1, edge2)); }

/* Writes the parts of a triangle in the order of lights_part; returns how many. */
static size_t cut(const struct light_triangle *whole, struct light_triangle *part) {
    uint32_t n = UINT32_C(1) << whole->level;
    vec3 step1 = vec3_scale(whole->edge1, 1.0f / (float)n), step2 = vec3_scale(whole->edge2, 1.0f / (float)n);
    size_t count = 0;
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j + i < n; j++) {
            struct light_triangle p = *whole;
            p.corner = vec3_mad(vec3_mad(whole->corner, (float)i, step1), (float)j, step2);
            p.edge1 = step1;
            p.edge2 = step2;
            part[count++] = p;
            if (i + j + 1 == n)
                continue;
            p.corner = vec3_add(vec3_add(p.corner, step1), step2);
            p.edge1 = vec3_neg(step1);
            p.edge2 = vec3_neg(step2);
            part[count++] = p;
        }
    }
    return count;
}

static struct light_triangle whole_triangle(const struct mesh *mesh, size_t triangle) {
    const uint32_t *v = mesh->index[triangle];
    vec3 a = mesh->position[v[0]];
    return (struct light_triangle){.corner = a,
                                   .edge1 = vec3_sub(mesh->position[v[1]], a),
                                   .edge2 = vec3_sub(mesh->position[v[2]], a),
                                   .whole = (uint32_t)triangle};
}

/* Lists the triangles of the emitting segments, large ones in parts. */
static void find_triangles(struct lights *l, const struct mesh *mesh, const struct segments *segments) {
    l->first_of = mem_array(mesh->triangle_count, sizeof *l->first_of);
    double total = 0.0;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        struct light_triangle t = whole_triangle(mesh, i);
        if (rgb_luminance(l->emission[segments->of_triangle[i]]) > 0.0f)
            total += (double)cross_area(t.edge1, t.edge2);
    }
    size_t capacity = 0;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        uint32_t segment = segments->of_triangle[i];
        if (!(rgb_luminance(l->emission[segment]) > 0.0f))
            continue;
        struct light_triangle t = whole_triangle(mesh, i);
        double part = (double)cross_area(t.edge1, t.edge2);
        for (; t.level < LIGHT_MAX_LEVEL && part > total / LIGHT_PARTS; t.level++)
            part *= 0.25;
        t.segment = segment;
        size_t needed = l->triangle_count + ((size_t)1 << 2 * t.level);
        if (needed > capacity) {
            capacity = needed + capacity / 2;
            l->triangle = mem_realloc_array(l->triangle, capacity, sizeof *l->triangle);
        }
        l->first_of[i] = (uint32_t)l->triangle_count;
        l->triangle_count += cut(&t, l->triangle + l->triangle_count);
    }
}

bool lights_update(struct lights *l, const struct mesh *mesh, const struct segments *segments,
                   const struct atlas *atlas, const struct materials *materials) {
    l->atlas = atlas;
    l->materials = materials;
    bool same = l->segment_count == segments->count && l->first_of;
    for (size_t s = 0; s < segments->count && same; s++)
        same = (rgb_luminance(l->emission[s]) > 0.0f) == (rgb_luminance(materials->emission[s]) > 0.0f);
    if (!same)
        release_triangles(l);
    table_release(&l->triangles);
    if (!l->emission) {
        l->segment_count = segments->count;
        l->emission = mem_array(segments->count, sizeof *l->emission);
        l->area_density = mem_calloc(segments->count, sizeof *l->area_density);
    }
    memcpy(l->emission, materials->emission, segments->count * sizeof *l->emission);
    if (!same)
        find_triangles(l, mesh, segments);
    float *power = mem_array(l->triangle_count, sizeof *power);
    for (size_t i = 0; i < l->triangle_count; i++) {
        struct light_triangle *t = &l->triangle[i];
        t->radiance = l->emission[t->segment];
        power[i] = cross_area(t->edge1, t->edge2) * rgb_luminance(t->radiance);
    }
    table_make(&l->triangles, l->triangle_count, power);
    share_samples(l);
    mem_free(power);
    return !same;
}

/* The map at coordinates of latlong_place. */
static rgb radiance_at(const struct lights *l, float x, float y) {
    size_t i = (size_t)x, j = (size_t)y, stride = (size_t)l->width + 1;
    float fx = x - (float)i, fy = y - (float)j;
    const float(*p)[3] = (const float(*)[3])l->environment + j * stride + i;
    float value[3];
    for (int c = 0; c < 3; c++) {
        float top = p[0][c] + fx * (p[1][c] - p[0][c]);
        float bottom = p[stride][c] + fx * (p[stride + 1][c] - p[stride][c]);
        value[c] = top + fy * (bottom - top);
    }
    return (rgb){value[0], value[1], value[2]};
}

/* Density by solid angle of the directions of a block, at this sine of the polar angle. */
static float density_of(const struct lights *l, uint32_t block, float sine) {
    float probability = l->blocks.cumulative[block + 1] - l->blocks.cumulative[block];
    float cell_angle = (float)(2.0 * PI * PI) / ((float)l->width * (float)(l->height - 1));
    float cells = (float)(block_width(l, block) * block_height(l, block));
    return l->environment_chance * probability / (cells * cell_angle * sine);
}

static void sample_environment(const struct lights *l, float pick, float u, float v, struct light_sample *s) {
    uint32_t block = light_table_pick(&l->blocks, pick);
    uint32_t left = block % l->block_columns * l->grain, top = block / l->block_columns * l->grain;
    float x = fminf((float)left + u * (float)block_width(l, block), (float)l->width * 0x1.fffffep-1f);
    float y = fminf((float)top + v * (float)block_height(l, block), (float)(l->height - 1) * 0x1.fffffep-1f);
    s->direction = latlong_pixel(l->width, l->height, (double)x, (double)y);
    s->point = s->normal = (vec3){0.0f, 0.0f, 0.0f};
    s->distance_m = INFINITY;
    s->segment = LIGHT_ENVIRONMENT;
    s->radiance = radiance_at(l, x, y);
    s->pdf = density_of(l, block, fmaxf((float)sin(latlong_polar(l->height, (double)y)), 1e-6f));
}

rgb lights_pattern(const struct lights *l, const struct light_triangle *t, float u, float v) {
    if (!l->materials->emission_pattern)
        return rgb_gray(1.0f);
    float root = sqrtf(u), b1 = root * (1.0f - v), b2 = root * v;
    /* From barycentrics of the part to those of the whole triangle; see lights_part for the order. */
    uint32_t n = UINT32_C(1) << t->level, part = (uint32_t)(t - l->triangle) - l->first_of[t->whole], i = 0;
    for (; part >= 2 * (n - i) - 1; i++)
        part -= 2 * (n - i) - 1;
    bool turned = part % 2 == 1;
    b1 = ((float)i + (turned ? 1.0f - b1 : b1)) / (float)n;
    b2 = ((float)(part / 2) + (turned ? 1.0f - b2 : b2)) / (float)n;
    vec2 at = atlas_point(l->atlas, t->whole, b1, b2);
    return materials_emission_pattern(l->materials, at.x, at.y);
}

void lights_sample(const struct lights *l, vec3 point, float pick, float u, float v, struct light_sample *s) {
    float chance = l->environment_chance;
    s->pdf = 0.0f;
    if (pick < chance) {
        sample_environment(l, pick / chance, u, v, s);
        return;
    }
    if (!(l->triangles.total > 0.0))
        return;
    const struct light_triangle *t = lights_pick(l, pick);
    float root = sqrtf(u);
    s->point = vec3_mad(vec3_mad(t->corner, root * (1.0f - v), t->edge1), root * v, t->edge2);
    s->normal = vec3_normalize(vec3_cross(t->edge1, t->edge2));
    vec3 to = vec3_sub(s->point, point);
    float distance2 = vec3_dot(to, to);
    s->distance_m = sqrtf(distance2);
    s->direction = vec3_scale(to, 1.0f / fmaxf(s->distance_m, 1e-20f));
    s->segment = t->segment;
    s->radiance = rgb_mul(t->radiance, lights_pattern(l, t, u, v));
    float cosine = -vec3_dot(s->direction, s->normal);
    if (cosine > 0.0f && distance2 > 0.0f)
        s->pdf = lights_pdf_segment(l, t->segment, s->distance_m, cosine);
}

rgb lights_environment(const struct lights *l, vec3 direction) {
    if (l->width == 0)
        return (rgb){0.0f, 0.0f, 0.0f};
    float x, y;
    latlong_place(l->width, l->height, direction, &x, &y);
    return radiance_at(l, x, y);
}

float lights_pdf_environment(const struct lights *l, vec3 direction) {
    if (!(l->environment_chance > 0.0f))
        return 0.0f;
    float x, y;
    latlong_place(l->width, l->height, direction, &x, &y);
    uint32_t block = (uint32_t)y / l->grain * l->block_columns + (uint32_t)x / l->grain;
    return density_of(l, block, sqrtf(fmaxf(1.0f - direction.y * direction.y, 1e-12f)));
}
