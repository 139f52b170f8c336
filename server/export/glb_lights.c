/* glb_lights.c -- see glb_lights.h. */
#include "server/export/glb_lights.h"

#include <math.h>
#include <stdio.h>

#include "common/mem.h"

#define FLAT_SHARE 0.5f   /* of the area, that the sum of a flat emitter's normals has at least; a hemisphere's is .5 */
#define IN_FRONT_M 0.01f  /* of the surface */
#define HALF_PI 1.5707963 /* rounded down: the extension's largest cone */

/* Part of an emitter, which gets one light. */
struct lamp {
    uint32_t segment, part; /* part: number within the segment */
    size_t first, count;    /* in `triangle` */
    vec3 lower, upper;      /* bounds of the triangles' centres */
    vec3 centre, normal;    /* area-weighted mean; sum of areas times normals */
    float area;
};

struct lamps {
    const struct export_input *in;
    uint32_t *triangle; /* of emitters, by lamp; owned */
    struct lamp *lamp;  /* [count]; owned */
    size_t count;
};

static vec3 centre_of(const struct mesh *mesh, uint32_t t) { return mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f); }

static void measure(const struct lamps *l, struct lamp *lamp) {
    const struct mesh *mesh = l->in->mesh;
    vec3 sum = {0.0f, 0.0f, 0.0f};
    lamp->normal = sum;
    lamp->area = 0.0f;
    lamp->lower = (vec3){INFINITY, INFINITY, INFINITY};
    lamp->upper = vec3_neg(lamp->lower);
    for (size_t i = lamp->first; i < lamp->first + lamp->count; i++) {
        vec3 cross = vec3_scale(mesh_cross(mesh, l->triangle[i]), 0.5f), at = centre_of(mesh, l->triangle[i]);
        float area = vec3_length(cross);
        lamp->area += area;
        lamp->normal = vec3_add(lamp->normal, cross);
        sum = vec3_mad(sum, area, at);
        lamp->lower = (vec3){fminf(lamp->lower.x, at.x), fminf(lamp->lower.y, at.y), fminf(lamp->lower.z, at.z)};
        lamp->upper = (vec3){fmaxf(lamp->upper.x, at.x), fmaxf(lamp->upper.y, at.y), fmaxf(lamp->upper.z, at.z)};
    }
    lamp->centre = vec3_scale(sum, 1.0f / lamp->area);
}

/* The axis along which the centres lie farthest apart, and how far. */
static int longest_axis(const struct lamp *lamp, float *span) {
    vec3 d = vec3_sub(lamp->upper, lamp->lower);
    *span = fmaxf(d.x, fmaxf(d.y, d.z));
    return *span == d.x ? 0 : *span == d.y ? 1 : 2;
}

/* --- one for each emitter ---------------------------------------------------------------------- */

static void list_emitters(struct lamps *l) {
    const struct export_input *in = l->in;
    size_t *start = mem_calloc(in->segments->count + 2, sizeof *start);
    for (size_t t = 0; t < in->mesh->triangle_count; t++)
        start[in->segments->of_triangle[t] + 2] += !rgb_is_black(in->materials->emission[in->segments->of_triangle[t]]);
    for (size_t s = 2; s <= in->segments->count; s++)
        start[s] += start[s - 1];
    l->triangle = mem_array(in->mesh->triangle_count, sizeof *l->triangle);
    for (size_t t = 0; t < in->mesh->triangle_count; t++) {
        uint32_t s = in->segments->of_triangle[t];
        if (!rgb_is_black(in->materials->emission[s]))
            l->triangle[start[s + 1]++] = (uint32_t)t;
    }
    l->lamp = mem_array(in->segments->count + LIGHTS_MAX, sizeof *l->lamp);
    for (size_t s = 0; s < in->segments->count; s++) {
        struct lamp lamp = {.segment = (uint32_t)s, .first = start[s], .count = start[s + 1] - start[s]};
        if (lamp.count == 0)
            continue;
        measure(l, &lamp);
        l->lamp[l->count++] = lamp;
    }
    mem_free(start);
}

static float flux_of(const struct lamps *l, const struct lamp *lamp) {
    return lamp->area * rgb_luminance(l->in->materials->emission[lamp->segment]);
}

static void keep_strongest(struct lamps *l) {
    for (size_t i = 0; i < l->count && i < LIGHTS_MAX; i++) {
        size_t best = i;
        for (size_t k = i + 1; k < l->count; k++)
            best = flux_of(l, &l->lamp[k]) > flux_of(l, &l->lamp[best]) ? k : best;
        struct lamp lamp = l->lamp[i];
        l->lamp[i] = l->lamp[best];
        l->lamp[best] = lamp;
    }
    l->count = l->count < LIGHTS_MAX ? l->count : LIGHTS_MAX;
}

/* --- long ones divided --------------------------------------------------------------------------- */

/* Puts the triangles before the middle of the longest axis first; returns how many they are. */
static size_t partition(const struct lamps *l, const struct lamp *lamp) {
    float span, middle[3] = {0.5f * (lamp->lower.x + lamp->upper.x), 0.5f * (lamp->lower.y + lamp->upper.y),
                             0.5f * (lamp->lower.z + lamp->upper.z)};
    int axis = longest_axis(lamp, &span);
    size_t kept = lamp->first;
    for (size_t i = lamp->first; i < lamp->first + lamp->count; i++) {
        uint32_t t = l->triangle[i];
        vec3 c = centre_of(l->in->mesh, t);
        const float at[3] = {c.x, c.y, c.z};
        if (at[axis] >= middle[axis])
            continue;
        l->triangle[i] = l->triangle[kept];
        l->triangle[kept++] = t;
    }
    return kept - lamp->first;
}

static void divide_longest(struct lamps *l) {
    uint32_t part = 0;
    while (l->count > 0 && l->count < LIGHTS_MAX) {
        size_t longest = 0;
        float span, most = LIGHT_SPAN_M;
        for (size_t i = 0; i < l->count; i++) {
            longest_axis(&l->lamp[i], &span);
            longest = span > most ? i : longest;
            most = fmaxf(most, span);
        }
        if (!(most > LIGHT_SPAN_M))
            return;
        struct lamp *half = &l->lamp[longest], *other = &l->lamp[l->count++];
        size_t before = partition(l, half);
        *other = *half;
        other->part = ++part;
        other->first += before;
        other->count -= before;
        half->count = before;
        measure(l, half);
        measure(l, other);
    }
}

/* --- JSON ---------------------------------------------------------------------------------------- */

static cJSON *append(cJSON *array) {
    cJSON *object = cJSON_CreateObject();
    cJSON_AddItemToArray(array, object);
    return object;
}

/* Adds a light with its node. `direction`: where it shines; ignored without is_directed. */
static cJSON *add_light(cJSON *lights, cJSON *nodes, const char *type, const char *name, rgb intensity,
                        bool is_directed, vec3 direction, vec3 at) {
    cJSON *light = append(lights), *node = append(nodes);
    float most = rgb_max(intensity);
    const float color[3] = {intensity.r / most, intensity.g / most, intensity.b / most};
    json_add_string(light, "type", type);
    json_add_string(light, "name", name);
    json_add(light, "color", cJSON_CreateFloatArray(color, 3));
    json_add_number(light, "intensity", (double)most);
    json_add_string(node, "name", name);
    cJSON *use = cJSON_AddObjectToObject(cJSON_AddObjectToObject(node, "extensions"), "KHR_lights_punctual");
    json_add_int(use, "light", cJSON_GetArraySize(lights) - 1);
    vec3 x, y, z = vec3_neg(direction); /* lights shine along -z */
    if (is_directed) {
        vec3_frame(z, &x, &y);
        const float m[16] = {x.x, x.y, x.z, 0.0f, y.x, y.y, y.z, 0.0f, z.x, z.y, z.z, 0.0f, at.x, at.y, at.z, 1.0f};
        json_add(node, "matrix", cJSON_CreateFloatArray(m, 16));
    } else {
        json_add(node, "translation", cJSON_CreateFloatArray((const float[3]){at.x, at.y, at.z}, 3));
    }
    return light;
}

static void add_lamp(const struct lamps *l, const struct lamp *lamp, cJSON *lights, cJSON *nodes) {
    const struct export_input *in = l->in;
    float length = vec3_length(lamp->normal), unit = (float)glb_lights_unit(in);
    bool is_flat = length >= FLAT_SHARE * lamp->area;
    rgb power = rgb_scale(in->materials->emission[lamp->segment], unit * lamp->area);
    vec3 normal = is_flat ? vec3_scale(lamp->normal, 1.0f / length) : (vec3){0.0f, 0.0f, 1.0f};
    const char *own = segments_name(in->segments, in->mesh, lamp->segment);
    char number[32], part[32];
    snprintf(number, sizeof number, "segment %u", lamp->segment);
    snprintf(part, sizeof part, lamp->part ? " light %u" : " light", lamp->part + 1);
    char *name = mem_printf("%s%s", own ? own : number, part);
    cJSON *light = add_light(lights, nodes, is_flat ? "spot" : "point", name, rgb_scale(power, is_flat ? 1.5f : 0.25f),
                             is_flat, normal, is_flat ? vec3_mad(lamp->centre, IN_FRONT_M, normal) : lamp->centre);
    if (is_flat) {
        cJSON *spot = cJSON_AddObjectToObject(light, "spot");
        json_add_number(spot, "innerConeAngle", 0.0);
        json_add_number(spot, "outerConeAngle", HALF_PI);
    }
    mem_free(name);
}

double glb_lights_unit(const struct export_input *in) {
    return in->options.glb_has_lights && in->luminance_per_unit > 0.0 ? in->luminance_per_unit : 1.0;
}

void glb_lights_add(const struct export_input *in, cJSON *lights, cJSON *nodes) {
    struct lamps l = {.in = in};
    list_emitters(&l);
    keep_strongest(&l);
    divide_longest(&l);
    for (size_t i = 0; i < l.count; i++)
        add_lamp(&l, &l.lamp[i], lights, nodes);
    if (in->sun.is_there && rgb_max(in->sun.irradiance) > 0.0f)
        add_light(lights, nodes, "directional", "Sun", rgb_scale(in->sun.irradiance, (float)glb_lights_unit(in)), true,
                  vec3_neg(in->sun.direction), (vec3){0.0f, 0.0f, 0.0f});
    mem_free(l.lamp);
    mem_free(l.triangle);
}
