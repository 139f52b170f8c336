/* sun_caustics.c -- see sun_caustics.h. */
#include "server/gather/sun_caustics.h"

#include <math.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/render/bsdf.h"
#include "server/render/sampler.h"
#include "server/scene/surface.h"

/* Photons in all, about, and at most from one texel: bounds of time and memory (28 bytes each). The sum is the same in
 * the mean; fewer are noisier. Not measured, as the next: the demo room has no sun. */
#define MAX_PHOTONS 1000000
#define MAX_PHOTONS_PER_TEXEL 64
#define CHUNK 1024           /* texels a work item */
#define KEY_CAUSTICS 0x3a11u /* separates these random numbers from others of a texel */
/* Least cosine by which a photon's flux is converted to radiance at a probe: bounds the weight of grazing photons,
 * whose flux is kept: beyond 87 degrees. */
#define MIN_COSINE 0.05f
enum { PAIR_DISC, PAIR_LOBE };

/* A photon and the probe that receives it; UINT32_MAX: none. */
struct photon {
    uint32_t probe;
    vec3 direction; /* unit, of travel */
    rgb flux;       /* irradiance x square metres */
};

struct caustics {
    struct probes *probes;
    const struct sun *sun;
    const struct world *world;
    const struct mesh *mesh;
    const struct inverse_uv *inverse;
    uint64_t seed;
    bool *lit;               /* [valid_count] polished and sunlit */
    size_t count, rays;      /* source texels, and photons of each */
    uint32_t *texel;         /* [count] */
    float texels_per_source; /* sunlit texels that each source represents */
    struct photon *photon;   /* [count][rays] */
};

/* --- from the sun ---------------------------------------------------------------------------------- */

static bool find_point(const struct caustics *m, uint32_t texel, struct surface_point *at) {
    return surface_at_texel(m->mesh, m->world->atlas, m->inverse, texel, at);
}

static void find_lit(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct caustics *m = user;
    for (size_t i = chunk * CHUNK; i < m->inverse->valid_count && i < (chunk + 1) * CHUNK; i++) {
        uint32_t texel = m->inverse->valid[i], segment = m->world->triangle[m->inverse->triangle[texel]].segment;
        struct surface_point at;
        m->lit[i] = materials_is_polished(m->world->materials, segment) && find_point(m, texel, &at) &&
                    sun_visibility(m->sun, m->world->accel, &at, 1) > 0.0f;
    }
}

/* Chooses source texels, evenly spaced where there are many, and the photons of each. */
static void choose_texels(struct caustics *m) {
    size_t lit = 0;
    for (size_t i = 0; i < m->inverse->valid_count; i++)
        lit += m->lit[i];
    struct spacing spacing = {.all = lit, .wanted = lit < MAX_PHOTONS ? lit : MAX_PHOTONS};
    m->texel = mem_array(spacing.wanted + 1, sizeof *m->texel);
    for (size_t i = 0; i < m->inverse->valid_count; i++) {
        if (m->lit[i] && spacing_takes(&spacing))
            m->texel[m->count++] = m->inverse->valid[i];
    }
    if (m->count == 0)
        return;
    m->rays = MAX_PHOTONS / m->count < MAX_PHOTONS_PER_TEXEL ? MAX_PHOTONS / m->count : MAX_PHOTONS_PER_TEXEL;
    m->texels_per_source = (float)lit / (float)m->count;
}

/* Samples the lobe: the fraction of the light that the photon carries; 0 where it would enter the surface. */
static float sample_lobe(const struct caustics *m, const struct surface_point *at, uint32_t segment, uint32_t key,
                         uint32_t ray, vec3 *direction) {
    const struct materials *materials = m->world->materials;
    vec3 frame[3] = {[2] = at->shading};
    vec3_frame(at->shading, &frame[0], &frame[1]);
    vec3 wo = vec3_to_frame(frame, sun_sample(m->sun, sampler_pair(key, ray, PAIR_DISC)));
    if (!(wo.z > 0.0f))
        return 0.0f;
    struct bsdf b = bsdf_lobe(materials->roughness[segment], materials->specular[segment]);
    vec2 u = sampler_pair(key, ray, PAIR_LOBE);
    vec3 wi = bsdf_sample(&b, wo, 0.0f, u.x, u.y);
    struct bsdf_value value = bsdf_eval(&b, wo, wi);
    *direction = vec3_from_frame(frame, wi);
    bool leaves = value.pdf > 0.0f && vec3_dot(*direction, at->normal) > 0.0f;
    return leaves ? value.specular / value.pdf * wo.z : 0.0f;
}

static void trace_texel(void *user, size_t index, int thread) {
    (void)thread;
    const struct caustics *m = user;
    const struct world *world = m->world;
    uint32_t texel = m->texel[index], key = sampler_key(m->seed, texel, KEY_CAUSTICS);
    uint32_t triangle = m->inverse->triangle[texel], segment = world->triangle[triangle].segment;
    rgb sent = rgb_scale(m->sun->irradiance,
                         surface_texel_m2(m->mesh, m->world->atlas, triangle) * m->texels_per_source / (float)m->rays);
    struct surface_point at;
    find_point(m, texel, &at);
    for (uint32_t i = 0; i < m->rays; i++) {
        struct photon *photon = &m->photon[index * m->rays + i];
        struct accel_hit hit;
        *photon = (struct photon){.probe = UINT32_MAX};
        float part = sample_lobe(m, &at, segment, key, i, &photon->direction);
        if (!(part > 0.0f) ||
            !accel_intersect(world->accel, accel_offset(at.position, at.normal, photon->direction), photon->direction,
                             0.0f, INFINITY, &hit) ||
            !(vec3_dot(world->triangle[hit.triangle].normal, photon->direction) < 0.0f))
            continue;
        vec2 place = atlas_point(world->atlas, hit.triangle, hit.b1, hit.b2);
        photon->probe = probes_at(m->probes, (uint32_t)clampf(place.x, 0.0f, (float)(world->atlas->width - 1)),
                                  (uint32_t)clampf(place.y, 0.0f, (float)(world->atlas->height - 1)),
                                  world->atlas->chart_of_triangle[hit.triangle]);
        photon->flux = rgb_scale(sent, part);
    }
}

/* --- to the probes ---------------------------------------------------------------------------------- */

/* Area in square metres that each probe stands for. [probe count]; the caller's. */
static float *probe_areas(const struct caustics *m) {
    float *area = mem_calloc(m->probes->count + 1, sizeof *area);
    for (size_t i = 0; i < m->inverse->valid_count; i++) {
        uint32_t texel = m->inverse->valid[i], triangle = m->inverse->triangle[texel];
        area[probes_at(m->probes, texel % m->inverse->width, texel / m->inverse->width,
                       m->world->atlas->chart_of_triangle[triangle])] +=
            surface_texel_m2(m->mesh, m->world->atlas, triangle);
    }
    return area;
}

/* Flux that arrives at the whole surface, square metres times the mean of the channels. */
static double total_flux(const struct probes *probes, const float *area) {
    double sum = 0.0;
    for (size_t k = 0; k < probes->count; k++) {
        const float *arrives = probes->probe[k].light.moment[0];
        sum += (double)(area[k] * rgb_mean(rgb_make(arrives[0], arrives[1], arrives[2])));
    }
    return sum;
}

static void deposit(struct probe *probe, const struct photon *photon, float area) {
    vec3 toward = vec3_neg(photon->direction);
    float facing = fmaxf(vec3_dot(toward, probe->shading), MIN_COSINE);
    irradiance_add(&probe->light, probe->shading, toward, rgb_scale(photon->flux, 1.0f / (facing * area)));
}

/* Deposits all photons; returns their share of the flux that arrives at the surface. */
static double deposit_all(const struct caustics *m) {
    float *area = probe_areas(m);
    double before = total_flux(m->probes, area);
    for (size_t i = 0; i < m->count * m->rays; i++) {
        const struct photon *photon = &m->photon[i];
        if (photon->probe != UINT32_MAX && area[photon->probe] > 0.0f)
            deposit(&m->probes->probe[photon->probe], photon, area[photon->probe]);
    }
    double after = total_flux(m->probes, area);
    mem_free(area);
    return after > 0.0 ? (after - before) / after : 0.0;
}

double sun_caustics_add(struct probes *probes, const struct sun *sun, const struct world *world,
                        const struct mesh *mesh, const struct inverse_uv *inverse, uint64_t seed,
                        struct parallel *pool) {
    struct caustics m = {.probes = probes, .sun = sun, .world = world, .mesh = mesh, .inverse = inverse, .seed = seed};
    if (!sun->is_there)
        return 0.0;
    m.lit = mem_calloc(inverse->valid_count, sizeof *m.lit);
    parallel_for(pool, (inverse->valid_count + CHUNK - 1) / CHUNK, find_lit, &m);
    choose_texels(&m);
    m.photon = mem_array(m.count * m.rays + 1, sizeof *m.photon);
    parallel_for(pool, m.count, trace_texel, &m);
    double share = deposit_all(&m);
    mem_free(m.photon);
    mem_free(m.texel);
    mem_free(m.lit);
    return share;
}
