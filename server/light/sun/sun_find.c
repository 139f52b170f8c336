/* sun_find.c -- see sun_find.h. */
#include "server/light/sun/sun_find.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/light/sun/missing_light.h"
#include "server/light/sun/sun_directions.h"
#include "server/render/bsdf.h"

/* Least number of bright places, in the room and of those that the sun reaches. */
#define MIN_BRIGHT 12
/* Directions are screened by up to so many bright places and as many others; the likeliest ones are fitted. */
#define SCREEN_PLACES 768
#define CANDIDATES 24
/* Half the angles of discs tried, in degrees: first the sun's own; in haze it is wider. What is best explained by
 * the last one is no disc, but a sky that no photograph shows. */
static const float radius_degrees[] = {0.27f, 0.6f, 1.2f, 2.0f, 3.0f, 4.5f, 6.0f};
#define RADII (sizeof radius_degrees / sizeof *radius_degrees)
#define DISC_RAYS 16
/* Least reduction of misfit by a sun, as a share of the greatest one possible: every place that it reaches from the
 * greatest loss to none. */
#define EXPLAINS 0.7
/* Where the best of the likeliest directions explains less than this part of that there is none. */
#define HOPEFUL 0.25
/* Greatest credible ratio of sunlit white paper to the room's median: 100,000 lux over 10. */
#define BRIGHTEST 1e4f

struct sun_search {
    struct reconstruction *r;
    float median_radiance; /* of the room */
    struct light_places places;
    struct missing_light missing;
    struct sun sun; /* that is tried */
    int rays;       /* a place, for the visible part of the disc */
};

/* --- directions ------------------------------------------------------------------------------------ */

struct screening {
    const struct sun_search *s;
    size_t count;
    uint32_t *place;        /* [count] */
    float *weight;          /* [count] places of the room that it stands for */
    double mean, deviation; /* of the residuals of all places */
    struct sun_candidate *candidate;
};

static void score_direction(void *user, size_t index, int thread) {
    (void)thread;
    const struct screening *a = user;
    struct sun_candidate *c = &a->candidate[index];
    struct sun sun = {.direction = c->direction};
    double sum = 0.0, weights = 0.0;
    for (size_t i = 0; i < a->count; i++) {
        const struct light_place *p = &a->s->places.place[a->place[i]];
        double weight = (double)(a->weight[i] * sun_visibility(&sun, a->s->r->world.accel, &p->at, 1));
        sum += weight * ((double)p->residual - a->mean);
        weights += weight;
    }
    c->score = sum / (sqrt(weights + 1.0) * a->deviation);
}

/* Up to SCREEN_PLACES places that are bright, or not. */
static void choose_places(struct screening *a, bool bright) {
    size_t above = light_places_above(&a->s->places, PLACE_BRIGHT), all = bright ? above : a->s->places.count - above;
    struct spacing spacing = {.all = all, .wanted = all < SCREEN_PLACES ? all : SCREEN_PLACES};
    for (size_t i = 0; i < a->s->places.count; i++) {
        if ((a->s->places.place[i].residual > PLACE_BRIGHT) == bright && spacing_takes(&spacing)) {
            a->weight[a->count] = (float)all / (float)spacing.wanted;
            a->place[a->count++] = (uint32_t)i;
        }
    }
}

/* Fills candidate[CANDIDATES] with the likeliest unseen directions; returns their number. */
static size_t screen_directions(const struct sun_search *s, struct sun_candidate candidate[CANDIDATES]) {
    struct screening a = {.s = s};
    a.place = mem_array(2 * SCREEN_PLACES, sizeof *a.place);
    a.weight = mem_array(2 * SCREEN_PLACES, sizeof *a.weight);
    size_t count = sun_directions_spread(&s->r->environment, environment_is_seen, &a.candidate);
    double squares = 0.0;
    for (size_t i = 0; i < s->places.count; i++) {
        a.mean += (double)s->places.place[i].residual / (double)s->places.count;
        squares += (double)(s->places.place[i].residual * s->places.place[i].residual) / (double)s->places.count;
    }
    a.deviation = sqrt(fmax(squares - a.mean * a.mean, 1e-12));
    choose_places(&a, true);
    choose_places(&a, false);
    parallel_for(s->r->pool, count, score_direction, &a);
    sun_directions_sort(a.candidate, count);
    count = count < CANDIDATES ? count : CANDIDATES;
    memcpy(candidate, a.candidate, count * sizeof *candidate);
    mem_free(a.candidate);
    mem_free(a.weight);
    mem_free(a.place);
    return count;
}

/* --- fit --------------------------------------------------------------------------------------------- */

static void find_response(void *user, size_t index, int thread) {
    (void)thread;
    struct sun_search *s = user;
    struct light_place *p = &s->places.place[index];
    p->visible = sun_visibility(&s->sun, s->r->world.accel, &p->at, s->rays);
    float cosine = vec3_dot(s->sun.direction, p->at.shading);
    p->response = p->visible > 0.0f ? p->visible * cosine * irradiance_matt(cosine) : 0.0f;
}

/* Reduction of misfit by a sun in a direction. */
static double try_direction(void *user, vec3 direction) {
    struct sun_search *s = user;
    double explained;
    s->sun.direction = direction;
    parallel_for(s->r->pool, s->places.count, find_response, s);
    missing_light_strength(&s->missing, MISSING_MEAN, &explained);
    return explained;
}

/* Sunlit places of a greater residual, each weighted by the visible part of the disc. */
static double count_reached(const struct sun_search *s, float residual) {
    double reached = 0.0;
    for (size_t i = 0; i < s->places.count; i++)
        reached += s->places.place[i].residual > residual ? (double)s->places.place[i].visible : 0.0;
    return reached;
}

static struct sun_candidate best_direction(struct sun_search *s) {
    struct sun_candidate candidate[CANDIDATES], best = {.score = 0.0};
    size_t count = screen_directions(s, candidate);
    s->rays = 1;
    for (size_t i = 0; i < count; i++) {
        candidate[i].score = try_direction(s, candidate[i].direction);
        if (candidate[i].score > best.score)
            best = candidate[i];
    }
    if (best.score > 0.0)
        try_direction(s, best.direction);
    if (best.score <= HOPEFUL * EXPLAINS * count_reached(s, -INFINITY))
        best.score = 0.0;
    else
        sun_directions_walk(&best, 2.0, 0.25, try_direction, s);
    return best;
}

/* False if the light is wider than a disc. */
static bool find_radius(struct sun_search *s, struct sun_candidate *best) {
    size_t radius = 0;
    best->score = 0.0;
    s->rays = DISC_RAYS;
    for (size_t i = 0; i < RADII; i++) {
        s->sun.radius_rad = radius_degrees[i] * BSDF_PI / 180.0f;
        double explained = try_direction(s, best->direction);
        if (explained > best->score)
            best->score = explained, radius = i;
    }
    s->sun.radius_rad = radius_degrees[radius] * BSDF_PI / 180.0f;
    sun_directions_walk(best, 0.5, 0.1, try_direction, s);
    return radius + 1 < RADII;
}

/* --- the whole ------------------------------------------------------------------------------------- */

/* Fills s->sun; the share of what it lights that it explains goes to *explains. */
static void look_for_sun(struct sun_search *s, double *explains) {
    struct sun_candidate best = best_direction(s);
    if (!(best.score > 0.0))
        return;
    bool is_disc = find_radius(s, &best);
    try_direction(s, best.direction);
    *explains = best.score / fmax(count_reached(s, -INFINITY), 1.0);
    rgb strength = missing_light_color(&s->missing);
    s->sun.is_there = is_disc && count_reached(s, PLACE_BRIGHT) >= MIN_BRIGHT && *explains > EXPLAINS &&
                      rgb_mean(strength) < BRIGHTEST * s->median_radiance;
    s->sun.irradiance = rgb_scale(strength, BSDF_PI);
}

static cJSON *report_found(const struct reconstruction *r) {
    cJSON *figures = cJSON_AddObjectToObject(r->report, "sun");
    json_add_bool(figures, "found", r->sun.is_there);
    json_add_bool(figures, "measured", r->sun.is_measured);
    return figures;
}

static void report(const struct sun_search *s, double explains) {
    cJSON *figures = report_found(s->r);
    json_add_number(figures, "explains", explains);
    json_add_number(figures, "lights_share", count_reached(s, -INFINITY) / fmax((double)s->places.count, 1.0));
}

void sun_report(const struct reconstruction *r) {
    cJSON *figures = cJSON_GetObjectItem(r->report, "sun");
    cJSON *direction = cJSON_AddArrayToObject(figures, "direction"),
          *irradiance = cJSON_AddArrayToObject(figures, "irradiance");
    for (int c = 0; c < 3; c++) {
        cJSON_AddItemToArray(direction, cJSON_CreateNumber((double)(&r->sun.direction.x)[c]));
        cJSON_AddItemToArray(irradiance, cJSON_CreateNumber((double)(&r->sun.irradiance.r)[c]));
    }
    json_add_number(figures, "radius_deg", (double)r->sun.radius_rad * 180.0 / PI);
}

void sun_find(struct reconstruction *r, const struct views *views) {
    struct sun_search s = {.r = r, .median_radiance = views->median_radiance};
    double explains = 0.0;
    struct survey survey;
    if (r->sun.is_there) {
        report_found(r);
        return;
    }
    survey_init(&survey, r, views, NULL, NULL, false, LIGHT_PLACES);
    light_places_init(&s.places, &survey);
    survey_release(&survey);
    light_places_leave_out_lamps(&s.places);
    missing_light_init(&s.missing, &s.places, r->pool);
    if (light_places_above(&s.places, PLACE_BRIGHT) >= MIN_BRIGHT)
        look_for_sun(&s, &explains);
    r->sun = s.sun;
    report(&s, explains);
    missing_light_release(&s.missing);
    light_places_release(&s.places);
}
