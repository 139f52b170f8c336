/* shining.c -- see shining.h. */
#include "server/light/decision/shining.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/gather/incident.h"
#include "server/light/sky/unseen_fit.h"
#include "server/render/sampler.h"

#define PLACES 64
#define POINTS 1024        /* all over the room */
#define RAYS_PER_POINT 256 /* directions at a place */
#define LAMBERT_QUANTILE 0.75
#define KEY_PLACES 31 /* keep these random numbers apart from others of the triangle */
#define KEY_RAYS 37
#define KEY_SUN 41
/* Directions in which the sun is looked for, some 3 degrees apart. */
#define SUN_DIRECTIONS 2048
/* It is found where it reaches this much more of the part than of what is beside it. */
#define SUN_CONTRAST 0.6f
/* Whatever else it reaches is this much brighter than what it does not. */
#define SUN_BRIGHTER 2.0f
/* Beside a part: within its own size of it, and about as inclined. */
#define BESIDE_COSINE 0.8f
#define MIN_BESIDE 6

/* --- places --------------------------------------------------------------------------------------- */

/* Up to `most` places, evenly spread over the area of the triangles. */
static size_t choose_places(const struct mesh *mesh, const uint32_t *triangle, size_t count, size_t most,
                            struct surface_point *place) {
    double total = 0.0, passed = 0.0;
    size_t chosen = 0;
    for (size_t i = 0; i < count; i++)
        total += (double)mesh_triangle_area(mesh, triangle[i]);
    for (size_t i = 0; i < count; i++) {
        passed += (double)mesh_triangle_area(mesh, triangle[i]);
        vec3 normal = vec3_normalize(mesh_cross(mesh, triangle[i]));
        for (; chosen < most && passed >= total * ((double)chosen + 0.5) / (double)most; chosen++) {
            vec2 u = sampler_pair(sampler_key(KEY_PLACES, triangle[i], 0), (uint32_t)chosen, 0);
            float root = sqrtf(u.x);
            vec3 at = mesh_point(mesh, triangle[i], root * (1.0f - u.y), root * u.y);
            place[chosen] =
                (struct surface_point){.triangle = triangle[i], .position = at, .normal = normal, .shading = normal};
        }
    }
    return chosen;
}

/* --- incident light ------------------------------------------------------------------------------- */

static void trace_rays(const struct shining *s, const struct surface_point *place, uint32_t key,
                       struct accel_ray ray[RAYS_PER_POINT], struct accel_hit hit[RAYS_PER_POINT]) {
    incident_cosine_rays(place, key, RAYS_PER_POINT, ray);
    accel_intersect_many(s->r->world.accel, RAYS_PER_POINT, ray, hit);
}

static float radiance_of(const struct shining *s, uint32_t triangle) {
    float mean = s->light->mean[triangle];
    if (s->light->is_bound[triangle])
        return SHINING_SATURATED * mean;
    return mean >= 0.0f ? mean : s->segment_mean[s->r->segments.of_triangle[triangle]];
}

static bool is_seen(const struct shining *s, vec3 direction) {
    const struct environment *e = &s->r->environment;
    return e->map.pixel && environment_is_seen(e, direction);
}

static float distant_radiance(const struct shining *s, vec3 direction) {
    float radiance = rgb_mean(lights_environment(s->r->world.lights, direction));
    bool seen = is_seen(s, direction);
    if (seen && !environment_is_measured(&s->r->environment, direction))
        return SHINING_SATURATED * radiance;
    if (!s->has_unseen || seen)
        return radiance;
    return fmaxf(radiance, (float)sky_cells_radiance(s->log_unseen, direction));
}

/* Lambert radiance at albedo 1 by a sun that photographs show. */
static float sun_radiance(const struct shining *s, const struct surface_point *place) {
    struct irradiance light = {0};
    sun_add_light(&s->r->sun, s->r->world.accel, place, &light);
    return rgb_mean(irradiance_diffuse(&light, place->shading, 1.0f, place->shading));
}

static float lambert_at(const struct shining *s, const struct surface_point *place, uint32_t key) {
    struct accel_ray ray[RAYS_PER_POINT];
    struct accel_hit hit[RAYS_PER_POINT];
    double sum = 0.0;
    trace_rays(s, place, key, ray, hit);
    for (size_t i = 0; i < RAYS_PER_POINT; i++) {
        bool far = hit[i].triangle == ACCEL_NONE;
        sum += (double)(far ? distant_radiance(s, ray[i].direction) : radiance_of(s, hit[i].triangle));
    }
    return (float)(sum / RAYS_PER_POINT) + sun_radiance(s, place);
}

float shining_lambert(const struct shining *s, const uint32_t *triangle, size_t count) {
    struct surface_point place[PLACES];
    float lambert[PLACES];
    size_t places = choose_places(&s->r->scene->mesh, triangle, count, PLACES, place);
    for (size_t i = 0; i < places; i++)
        lambert[i] = lambert_at(s, &place[i], sampler_key(KEY_RAYS, triangle[0], (uint32_t)i));
    return quantile(lambert, places, LAMBERT_QUANTILE);
}

/* --- light from unobserved directions ------------------------------------------------------------- */

struct shining_survey {
    const struct shining *shining;
    struct unseen_point point[POINTS];
};

/* Lambert radiance at a place, by known and unknown light. */
static void gather_point(void *user, size_t index, int thread) {
    (void)thread;
    struct shining_survey *survey = user;
    const struct shining *s = survey->shining;
    uint32_t triangle = s->room[index].triangle;
    struct unseen_point *p = &survey->point[index];
    struct accel_ray ray[RAYS_PER_POINT];
    struct accel_hit hit[RAYS_PER_POINT];
    *p = (struct unseen_point){.segment = s->r->segments.of_triangle[triangle], .observed = s->light->mean[triangle]};
    trace_rays(s, &s->room[index], sampler_key(KEY_RAYS, triangle, 0), ray, hit);
    for (size_t i = 0; i < RAYS_PER_POINT; i++) {
        vec3 direction = ray[i].direction;
        if (hit[i].triangle != ACCEL_NONE || is_seen(s, direction)) {
            bool far = hit[i].triangle == ACCEL_NONE;
            p->known += (far ? distant_radiance(s, direction) : radiance_of(s, hit[i].triangle)) / RAYS_PER_POINT;
            continue;
        }
        unseen_add_ray(p, direction, 1.0f / RAYS_PER_POINT, distant_radiance(s, direction));
    }
}

static void find_segment_means(struct shining *s) {
    const struct reconstruction *r = s->r;
    size_t segments = r->segments.count;
    double *pixels = mem_calloc(segments + 1, sizeof *pixels), *sum = mem_calloc(segments + 1, sizeof *sum);
    for (size_t t = 0; t < r->scene->mesh.triangle_count; t++) {
        for (size_t i = r->segments.of_triangle[t], k = 0; k < 2; i = segments, k++) {
            pixels[i] += (double)s->light->pixels[t];
            sum[i] += (double)s->light->pixels[t] * (double)fmaxf(s->light->mean[t], 0.0f);
        }
    }
    s->segment_mean = mem_calloc(segments, sizeof *s->segment_mean);
    for (size_t i = 0; i < segments; i++) {
        size_t from = pixels[i] > 0.0 ? i : segments; /* the room */
        s->segment_mean[i] = pixels[from] > 0.0 ? (float)(sum[from] / pixels[from]) : 0.0f;
    }
    mem_free(sum);
    mem_free(pixels);
}

/* The fit of unseen_light.h, made unconditionally: overestimated light only makes fewer splits. */
static void find_unseen_light(struct shining *s) {
    const struct reconstruction *r = s->r;
    const struct mesh *mesh = &r->scene->mesh;
    struct shining_survey *survey = mem_alloc(sizeof *survey);
    uint32_t *observed = mem_array(mesh->triangle_count + 1, sizeof *observed);
    size_t count = 0;
    survey->shining = s;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (s->light->observed[t] >= 0.0f)
            observed[count++] = (uint32_t)t;
    }
    s->room_count = choose_places(mesh, observed, count, POINTS, s->room);
    parallel_for(r->pool, s->room_count, gather_point, survey);
    s->unseen_share = (float)unseen_share(survey->point, s->room_count);
    size_t kept = unseen_keep_informative(survey->point, s->room_count);
    if (kept >= UNSEEN_MIN_POINTS) {
        unseen_fit(survey->point, kept, r->pool, s->log_unseen);
        s->has_unseen = true;
    }
    mem_free(observed);
    mem_free(survey);
}

void shining_init(struct shining *s, const struct reconstruction *r, const struct triangle_light *light) {
    *s = (struct shining){.r = r, .light = light, .room = mem_array(POINTS, sizeof *s->room)};
    find_segment_means(s);
    find_unseen_light(s);
}

void shining_release(struct shining *s) {
    mem_free(s->room);
    mem_free(s->segment_mean);
    *s = (struct shining){0};
}

/* --- the sun -------------------------------------------------------------------------------------- */

struct sunlight {
    const struct shining *shining;
    const struct accel *accel;
    struct surface_point part[PLACES], beside[PLACES];
    size_t part_count, beside_count;
};

/* Whether light may come from far away in a direction. */
static bool is_open(const struct accel *accel, const struct surface_point *place, vec3 direction) {
    vec3 origin = accel_offset(place->position, place->normal, direction);
    return vec3_dot(direction, place->normal) > 0.0f && !accel_occluded(accel, origin, direction, 0.0f, INFINITY);
}

static float share_open(const struct sunlight *sun, const struct surface_point *place, size_t count, vec3 direction) {
    size_t open = 0;
    for (size_t i = 0; i < count; i++)
        open += is_open(sun->accel, &place[i], direction);
    return (float)open / (float)count;
}

/* Whether a direction reaches much more of the part than of what is beside it. */
static bool separates(const struct sunlight *sun, vec3 direction) {
    float share = share_open(sun, sun->part, sun->part_count, direction);
    return share >= SUN_CONTRAST && share - share_open(sun, sun->beside, sun->beside_count, direction) >= SUN_CONTRAST;
}

/* The places of `darker` that are beside the part. */
static size_t choose_beside(struct sunlight *sun, const struct mesh *mesh, const uint32_t *darker, size_t count) {
    vec3 middle = {0, 0, 0}, normal = {0, 0, 0};
    float reach_m = 0.0f;
    for (size_t i = 0; i < sun->part_count; i++) {
        middle = vec3_mad(middle, 1.0f / (float)sun->part_count, sun->part[i].position);
        normal = vec3_add(normal, sun->part[i].normal);
    }
    normal = vec3_normalize(normal);
    for (size_t i = 0; i < sun->part_count; i++)
        reach_m = fmaxf(reach_m, 2.0f * vec3_length(vec3_sub(sun->part[i].position, middle)));
    uint32_t *near = mem_array(count + 1, sizeof *near);
    size_t near_count = 0;
    for (size_t i = 0; i < count; i++) {
        vec3 at = mesh_point(mesh, darker[i], 1.0f / 3.0f, 1.0f / 3.0f);
        if (vec3_length(vec3_sub(at, middle)) < reach_m &&
            vec3_dot(vec3_normalize(mesh_cross(mesh, darker[i])), normal) > BESIDE_COSINE)
            near[near_count++] = darker[i];
    }
    size_t chosen = near_count > 0 ? choose_places(mesh, near, near_count, PLACES, sun->beside) : 0;
    mem_free(near);
    return near_count < MIN_BESIDE ? 0 : chosen;
}

/* Whether the places that a direction reaches are no brighter than the rest of the room. */
static bool is_contradicted(const struct sunlight *sun, vec3 direction) {
    const struct shining *s = sun->shining;
    float value[2][POINTS];
    size_t count[2] = {0, 0};
    for (size_t i = 0; i < s->room_count; i++) {
        int open = is_open(sun->accel, &s->room[i], direction) ? 1 : 0;
        value[open][count[open]++] = s->light->mean[s->room[i].triangle];
    }
    return count[1] >= MIN_BESIDE &&
           quantile(value[1], count[1], 0.5) < SUN_BRIGHTER * quantile(value[0], count[0], 0.5);
}

bool shining_is_sunlit(const struct shining *s, const uint32_t *part, size_t part_size, const uint32_t *darker,
                       size_t darker_count) {
    const struct mesh *mesh = &s->r->scene->mesh;
    struct sunlight sun = {.shining = s, .accel = s->r->world.accel};
    sun.part_count = choose_places(mesh, part, part_size, PLACES, sun.part);
    sun.beside_count = choose_beside(&sun, mesh, darker, darker_count);
    if (sun.beside_count == 0)
        return false;
    uint32_t key = sampler_key(KEY_SUN, part[0], 0);
    vec3 frame[3] = {[2] = sun.part[0].normal};
    vec3_frame(frame[2], &frame[0], &frame[1]);
    for (uint32_t i = 0; i < SUN_DIRECTIONS; i++) {
        vec3 direction = incident_cosine_direction(frame, sampler_pair(key, i, 0));
        if (separates(&sun, direction) && !is_contradicted(&sun, direction))
            return true;
    }
    return false;
}
